#!/usr/bin/env python3
"""How far engines are apart on the same scenes without any hidden effect, in standard deviations of the sensors' noise.

    python tests/peers/worlds/gap.py --seed 1 --scenes 20 [--episodes 3]
    python tests/peers/worlds/gap.py --logs DIR/ENGINE-VARIANT-seedN

What two good engines differ by, no diagnosis can call a missing effect. Whole episodes are compared, from the same start. The first form prints,
for each pair of engines and channel, the mean square in noise variances: median and nine tenths over the scenes, tosses left out. The second
compares each log of a set that hides nothing with another engine, and writes truth/gap.json: {log: {channel: mean square}}.
"""

import argparse
import itertools
import json
import pathlib
import sys

import numpy as np

import make_logs
import sensors
from plan import draw_plan
from scene import draw_rig, draw_scene
from world import World

CHOSEN = (("mujoco", "default"), ("mujoco", "hard"), ("bullet", "fine"), ("dart", "default"), ("drake", "point"))


def scene_gaps(seed, index, episodes):
    """{(engine, engine): {channel: mean square}} of one scene."""
    retry = 0
    while True:
        rng = np.random.default_rng([seed, index, 77, retry])
        scene = draw_scene(rng, {"lying"})
        rig = draw_rig(rng, scene)
        rig.episodes, retry = episodes, retry + 1
        if not rig.tosses:
            break
    rig.skew_s = 0.0
    plan = draw_plan(rng, scene, rig)
    stamps = [sensors.draw_stamps(rng, rig, e.seconds) for e in plan]
    read = {}
    for engine in CHOSEN:
        world = World(scene, {}, *engine)
        read[engine] = [sensors.read(world.run(e), times, {}, rig) for e, times in zip(plan, stamps)]
    out = {}
    for a, b in itertools.combinations(CHOSEN, 2):
        sums = {}
        for one, two in zip(read[a], read[b]):
            for key in one:
                total, count = sensors.difference({key: one[key]}, two, rig)
                had = sums.setdefault(key, [0.0, 0])
                had[0], had[1] = had[0] + total, had[1] + count
        out[a, b] = {key: t / n for key, (t, n) in sums.items() if n}
    return out, scene, rig


def of_logs(folder, episodes):
    """Gaps to another engine of the logs that hide nothing."""
    out = {}
    for path in sorted((folder / "truth").glob("log-*.json")):
        truth = json.loads(path.read_text())
        if truth["kind"] != "none":
            continue
        one = truth["engine"], truth["variant"]
        other = ("bullet", "fine") if one[0] in ("mujoco", "drake") else ("mujoco", "hard")
        # As it was drawn, but not simulated once more.
        rng = make_logs.stream(truth["seed"], int(truth["name"][-3:]), one[0])
        _, scene, rig, _, _, plan, stamps, *_ = make_logs.try_log(rng, *one, simulate=lambda world, plan: None)
        sums = {}
        for i in range(0, len(plan), max(1, len(plan) // episodes)):
            both = [sensors.read(World(scene, {}, *engine).run(plan[i]), stamps[i], {}, rig) for engine in (one, other)]
            for key in both[0]:
                had = sums.setdefault(key, [0.0, 0])
                for k, v in enumerate(sensors.difference({key: both[0][key]}, both[1], rig)):
                    had[k] += v
        out[path.stem] = {key: float(f"{t / n:.4g}") for key, (t, n) in sums.items() if n}
        print(path.stem, *one, out[path.stem], flush=True)
    (folder / "truth" / "gap.json").write_text(json.dumps(out, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--episodes", type=int, default=3)
    parser.add_argument("--logs", type=pathlib.Path)
    options = parser.parse_args()
    if options.logs:
        of_logs(options.logs, options.episodes)
        return 0
    all_gaps = [scene_gaps(options.seed, i, options.episodes)[0] for i in range(options.scenes)]
    channels = ("position", "orientation", "force", "torque")
    print("| engines | " + " | ".join(f"{c}: median, 90 %" for c in channels) + " |\n|" + "---|" * (1 + len(channels)))
    for pair in itertools.combinations(CHOSEN, 2):
        cells = []
        for channel in channels:
            values = [g[pair][channel] for g in all_gaps if channel in g[pair]]
            cells.append(f"{np.median(values):.3g}, {np.percentile(values, 90):.3g}" if values else "–")
        print(f"| {' '.join(pair[0])} – {' '.join(pair[1])} | " + " | ".join(cells) + " |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
