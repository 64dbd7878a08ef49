#!/usr/bin/env python3
"""Measured logs for `diagnose` from engines that are not ours, of scenes that a seed draws; the truth apart from them.

    python tests/peers/worlds/make_logs.py --engine mujoco --variant default --seed 11 --logs 30 --out DIR

DIR/ENGINE-VARIANT-seedN/log-000 is what a solver may read (docs/src/reference/measured-log.md). DIR/ENGINE-VARIANT-seedN/truth/log-000.json is
what it has to find. `--variant all` takes the variants in turn. Seed, engine and number decide everything: the same bytes each time.
Seeds 1–99 are for development, those from 500 on for judging.
"""

import argparse
import concurrent.futures
import json
import math
import multiprocessing
import pathlib
import shutil
import sys
import time
import zlib

import numpy as np

import engines
import hidden
import scene as wide
import sensors
import usual
from plan import draw_plan
from scene import GRAVITY
from world import World

SHARES = {"none": 0.4, "one": 0.45, "pair": 0.05, "outside": 0.1}
LEAST_DETECTABLE = 0.15  # mean square, standard deviations
PROBED, COMPARED = 3, 8  # episodes
MOST_ROWS = 12000
DRAWS = {"wide": wide, "usual": usual}


class Faint(Exception):
    """No effect could be drawn that this rig sees."""


def simulate(world, plan):
    return [world.run(episode) for episode in plan]


def compared(with_it, without, stamps, effects, rig, others=None):
    """`detectable`: the mean square, in noise standard deviations, by which readings of the episodes differ with `effects` and with `others` alone.
    Episodes that an engine ended at once are left out."""
    total, count = 0.0, 0
    for a, b, times in zip(with_it, without, stamps):
        if len(a.time_s) < 3 or len(b.time_s) < 3:
            continue
        t, n = sensors.difference(sensors.read(a, times, effects, rig), sensors.read(b, times, others or {}, rig), rig)
        total, count = total + t, count + n
    return total / max(count, 1)


def four_digits(value):
    """None where the engine went astray: JSON has no NaN."""
    return float(f"{value:.4g}") if math.isfinite(value) else None


def draw_effects(rng, scene, rig, kind, strength, unsupported):
    """Names and parameters; the scene changes where an effect says what its true value is."""
    table = hidden.OUTSIDE if kind == "outside" else hidden.DRAWS
    names = [n for n in table if hidden.possible(n, scene, rig, unsupported)]
    if rig.tosses:
        names = [n for n in names if n not in ("hidden_obstacle", "actuator_gain")]
    chosen = rng.choice(names, size=2 if kind == "pair" else 1, replace=False)
    return {str(name): table[str(name)](rng, scene, strength) for name in chosen}


def stream(seed, index, engine, retry=0):
    return np.random.default_rng([seed, index, zlib.crc32(engine.encode()), retry])


def draw_log(seed, index, engine, variant, draws=wide):
    """Scene, rig, plan, effects, their traces and how well they can be seen. Of another scene, where nothing shows in the first."""
    for retry in range(10):
        try:
            return try_log(stream(seed, index, engine, retry), engine, variant, draws=draws)
        except Faint:
            continue
    raise Faint(f"log {index}: nothing shows in ten scenes")


def try_log(rng, engine, variant, simulate=simulate, draws=wide):
    scene = draws.draw_scene(rng, engines.unsuitable(engine))
    rig = draws.draw_rig(rng, scene)
    kind = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    unsupported = engines.unsupported(engine)
    for attempt in range(12):
        effects = {} if kind == "none" else draw_effects(rng, scene, rig, kind, 1.5 ** (attempt % 4), unsupported)
        rig.long_rests |= bool({"mass_leak", "force_drift"} & set(effects))
        if {"mass_leak", "force_drift"} & set(effects):
            rig.episodes = min(rig.episodes, 24)
        plan = draw_plan(rng, scene, rig)
        if "hidden_obstacle" in effects:
            plan = [episode for episode in plan if begins_free(scene, episode, effects["hidden_obstacle"])]
            if len(plan) < max(6, rig.episodes / 2):
                continue
        thin(rig, plan)
        for episode in plan:
            episode.tick_s = rig.period_s if episode.tick_s else 0.0
        stamps = [sensors.draw_stamps(rng, rig, episode.seconds) for episode in plan]
        bare, full = World(scene, {}, engine, variant), World(scene, effects, engine, variant)
        if kind == "none":
            return rng, scene, rig, kind, effects, plan, stamps, simulate(full, plan), 0.0, {}
        some = list(range(0, len(plan), max(1, len(plan) // PROBED)))[:PROBED]
        seen = probe(bare, full, plan, stamps, some, effects, rig)
        if seen >= LEAST_DETECTABLE:
            traces = simulate(full, plan)
            some = list(range(0, len(plan), max(1, math.ceil(len(plan) / COMPARED))))
            without = [bare.run(plan[i]) for i in some]
            seen = compared([traces[i] for i in some], without, [stamps[i] for i in some], effects, rig)
            each = {}
            if kind == "pair":
                for name in effects:
                    others = {n: p for n, p in effects.items() if n != name}
                    alone = World(scene, others, engine, variant)
                    rest = [alone.run(plan[i]) for i in some]
                    each[name] = compared([traces[i] for i in some], rest, [stamps[i] for i in some], effects, rig, others)
            return rng, scene, rig, kind, effects, plan, stamps, traces, seen, each
    raise Faint(f"no effect of kind {kind} shows in 12 draws")


def begins_free(scene, episode, obstacle):
    """Whether object and tool begin an episode beside the body in the way: engines throw apart what begins in one another."""
    x, y, radius = obstacle["x_m"], obstacle["y_m"], obstacle["size_0_m"]
    object_m = math.hypot(*scene.footprint)
    tool = [] if episode.course is None else [(episode.places(np.zeros(1))[0], scene.tool_radius_m)]
    return all(math.hypot(at[0] - x, at[1] - y) > radius + own for at, own in [(episode.pose, object_m), *tool])


def probe(bare, full, plan, stamps, some, effects, rig):
    pick = [stamps[i] for i in some]
    return compared([full.run(plan[i]) for i in some], [bare.run(plan[i]) for i in some], pick, effects, rig)


def thin(rig, plan):
    """A slower clock where the log would have too many rows."""
    seconds = sum(episode.seconds for episode in plan)
    fast = seconds / min(rig.period_s, rig.object_period_s, rig.force_period_s)
    if fast > MOST_ROWS:
        factor = fast / MOST_ROWS
        rig.period_s = round(rig.period_s * factor, 4)
        rig.object_period_s, rig.force_period_s = rig.object_period_s * factor, rig.force_period_s * factor
        if not rig.own_rows:
            rig.object_period_s = rig.force_period_s = rig.period_s


def number(pair):
    mean, stddev = pair
    return f"{mean:.6g}" if stddev is None else f"{{ mean = {mean:.6g}, stddev = {stddev:.6g} }}"


def header(scene, rig):
    tool = "" if rig.tosses else f"tool_radius_m = {scene.tool_radius_m}\ntool_friction = {number(scene.stated['tool_friction'])}\n"
    stated = [f"{key} = {value:.6g}" for key, value in rig.noise.items() if key in rig.noise_stated]
    noise = "[noise]\n" + "\n".join(stated) + "\n\n" if stated else ""
    return f"""version = 1
robot = "none"
period_secs = {rig.period_s}
{tool}gravity_mps2 = {GRAVITY}

[table]
height_m = 0.0
friction = {number(scene.stated["friction"])}

[object]
shape = "{scene.shape}"
size_m = {scene.size_m}
mass_kg = {number(scene.stated["mass_kg"])}
com_m = [0.0, 0.0, 0.0]

{noise}[split]
holdout_fraction = 0.3
"""


def truth_of(seed, index, engine, variant, scene, rig, kind, effects, plan, seen, each, kept, rows):
    catalogue = kind in ("one", "pair")
    friction = effects["friction_level"]["coefficient"] if "friction_level" in effects else scene.friction
    listed = [{"name": n, "parameters": p} | ({"in_range": hidden.in_range(n, p)} if catalogue else {})
              | ({"detectable": four_digits(each[n])} if n in each else {}) for n, p in effects.items()]
    return {
        "name": f"log-{index:03d}", "seed": seed, "engine": engine, "variant": variant, "engine_version": engines.version(engine),
        "natural": list(engines.NATURAL.get((engine, variant), ())), "kind": kind,
        "effects": listed if catalogue else [], "outside": listed if kind == "outside" else [],
        "detectable": four_digits(seen), "designed": rig.designed and not rig.tosses, "tosses": rig.tosses,
        "sensors": sorted(rig.sensors), "period_s": rig.period_s, "straight": rig.straight,
        "jitter": round(rig.jitter, 4), "dropped": round(rig.dropped, 4),
        "lost_poses": round(rig.lost_poses, 4), "own_rows": rig.own_rows, "force_mean": rig.force_mean, "skew_s": rig.skew_s,
        "noise": rig.noise, "noise_stated": sorted(rig.noise_stated), "episodes": kept, "planned": len(plan), "rows": rows,
        "seconds": round(sum(e.seconds for e in plan), 2),
        "object": {"shape": scene.shape, "kind": scene.kind, "size_m": scene.size_m, "mass_kg": scene.mass_kg, "friction": friction,
                   "tool_friction": scene.tool_friction, "tool_radius_m": scene.tool_radius_m},
        "stated": {key: {"mean": mean, "stddev": stddev} for key, (mean, stddev) in scene.stated.items()},
    }


def make(options, index):
    """Draws, simulates and writes one log."""
    began = time.perf_counter()
    variants = engines.ENGINES[options.engine]
    variant = variants[index % len(variants)] if options.variant == "all" else options.variant
    rng, scene, rig, kind, effects, plan, stamps, traces, seen, each = draw_log(options.seed, index, options.engine, variant, DRAWS[options.draws])
    of = "" if options.draws == "wide" else f"-{options.draws}"
    folder = options.out / f"{options.engine}-{options.variant}{of}-seed{options.seed}"
    name = f"log-{index:03d}"
    weighed = rig.designed and not rig.tosses
    columns = ["episode", "time_secs", *(c for g in sensors.groups(rig) for c in sensors.GROUPS[g])] + (["added_mass_kg"] if weighed else [])
    out, kept = [",".join(columns)], 0
    for episode, times, trace in zip(plan, stamps, traces):
        if len(trace.time_s) < 3:
            continue
        readings = sensors.noisy(rng, sensors.read(trace, times, effects, rig), rig)
        rows = list(sensors.lines(kept, readings, rig, episode.added_kg, weighed))
        if len(rows) >= 5:
            out += rows
            kept += 1
    shutil.rmtree(folder / name, ignore_errors=True)
    (folder / name).mkdir(parents=True)
    (folder / "truth").mkdir(exist_ok=True)
    (folder / name / "log.toml").write_text(header(scene, rig))
    (folder / name / "samples.csv").write_text("\n".join(out) + "\n")
    truth = truth_of(options.seed, index, options.engine, variant, scene, rig, kind, effects, plan, seen, each, kept, len(out) - 1)
    (folder / "truth" / f"{name}.json").write_text(json.dumps(truth, indent=1, ensure_ascii=False) + "\n")
    what = "+".join(effects) or "none"
    print(f"{folder.name}/{name}: {what}, {variant}, {kept} episodes, {len(out) - 1} rows, detectable {seen:.3g}, "
          f"{time.perf_counter() - began:.1f} s", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", choices=sorted(engines.ENGINES), required=True)
    parser.add_argument("--variant", default="all", help="one of the engine's, or all in turn")
    parser.add_argument("--draws", choices=list(DRAWS), default="wide", help="objects and rigs of all kinds, or as most laboratories have them")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--logs", type=int, default=30)
    parser.add_argument("--first", type=int, default=0, help="number of the first log")
    parser.add_argument("--jobs", type=int, default=1, help="logs at a time, at most 2")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    options = parser.parse_args()
    if options.variant != "all" and options.variant not in engines.ENGINES[options.engine]:
        parser.error(f"{options.engine} has the variants all, {', '.join(engines.ENGINES[options.engine])}")
    numbers = range(options.first, options.first + options.logs)
    if options.jobs == 1:
        for index in numbers:
            make(options, index)
        return 0
    # New workers now and then, as engines keep memory. `max_tasks_per_child` would wait for ever (CPython issue 115634).
    for first in range(0, len(numbers), 16):
        batch = numbers[first : first + 16]
        with concurrent.futures.ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
            list(pool.map(make, [options] * len(batch), batch))
    return 0


if __name__ == "__main__":
    sys.exit(main())
