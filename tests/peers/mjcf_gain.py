#!/usr/bin/env python3
"""What the MuJoCo scenes that `diagnose` writes gain in MuJoCo itself, beside what its report promises.

    pip install mujoco numpy
    python tests/peers/mjcf_gain.py LOG ANSWER [LOG ANSWER ...]     # a line each: held-out errors before and after
    python tests/peers/mjcf_gain.py --json LOG ANSWER ...

LOG is a measured log with `robot = "none"` and a ball as its tool; ANSWER is the folder that `diagnose` wrote about it. The held-out episodes that the report
is of are replayed twice, in `nominal.mjcf.xml` and in `model.mjcf.xml`: the object begins where it was read before the tool moved, and the tool goes
where it was sent. Both are compared with the log as the report does under `heldout.plain`: sums of (read - simulated) / noise over blocks of rows, divided by
the root of the block's length, mean squares of object position, orientation and force. Clocks are those of `model.toml`. The share of the gap that is closed,
(before - after) / (before - 1), is that of these errors for both.
"""

import argparse
import csv
import json
import math
import pathlib
import re
import sys
import tomllib

try:
    import mujoco
    import numpy as np
except ImportError:
    sys.stderr.write("missing: pip install mujoco numpy\n")
    sys.exit(3)

BLOCKS = 80
CHANNELS = ("object_position", "object_orientation", "wrist_force")
TOOL_KG = 1e4  # as in the scene


def rows_of(log):
    episodes = {}
    with open(log / "samples.csv", newline="") as file:
        for row in csv.DictReader(file):
            episodes.setdefault(int(row["episode"]), []).append(row)
    return episodes


def columns(rows, names):
    """[rows, names], NaN where nothing was read."""
    read = lambda row, name: float(row[name]) if row.get(name) not in (None, "") else math.nan
    return np.array([[read(row, name) for name in names] for row in rows])


def rotation_vectors(read, simulated):
    """Of read · simulated⁻¹, both as w, x, y, z."""
    result = []
    for a, b in zip(read, simulated):
        turn = np.zeros(4)
        mujoco.mju_mulQuat(turn, a, np.array([b[0], -b[1], -b[2], -b[3]]))
        turn *= -1.0 if turn[0] < 0 else 1.0
        length = np.linalg.norm(turn[1:])
        result.append(2.0 * turn[1:] * (math.atan2(length, turn[0]) / length if length > 1e-12 else 1.0))
    return np.array(result)


def replay(xml, rows, period_s, rest_height):
    """Position, orientation (w first) and force on the tool at each tick; what was read, at its times in ticks."""
    added = float(rows[0].get("added_mass_kg") or 0.0)
    if added:
        centre = re.search(r'<site name="object" pos="([^"]*)"', xml)[1]
        weight = f'<body name="added" pos="{centre}"><inertial pos="0 0 0" mass="{added}" diaginertia="1e-9 1e-9 1e-9"/></body>'
        xml = re.sub(r'(<body name="object">.*?)(</body>)', lambda m: m[1] + weight + m[2], xml, count=1, flags=re.S)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    place = columns(rows, [f"object_{a}_m" for a in "xyz"])
    turn = columns(rows, [f"object_q{a}" for a in "wxyz"])
    times = columns(rows, ["time_secs"])[:, 0]
    sent = columns(rows, [f"command_{a}_m" for a in "xyz"])
    if np.isnan(sent).all():
        sent = columns(rows, [f"tool_{a}_m" for a in "xyz"])
    known = ~np.isnan(sent[:, 0])
    ticks = int(round((times[-1] - times[0]) / period_s))
    grid = times[0] + period_s * np.arange(ticks + 1)
    sent = np.stack([np.interp(grid, times[known], sent[known, axis]) for axis in range(3)], 1)
    moved = np.flatnonzero(np.linalg.norm(sent - sent[0], axis=1) > 1e-6)
    rest = times < grid[moved[0]] if len(moved) else times <= times[0]
    seen = np.flatnonzero(~np.isnan(place[:, 0]))
    still = seen[rest[seen]][:50]
    still = still if len(still) else seen[:1]
    start = place[still].mean(axis=0)
    start[2] = rest_height
    if np.isnan(turn).all():
        first = np.array([1.0, 0.0, 0.0, 0.0])
        turn[:] = first
    else:
        read = turn[still][~np.isnan(turn[still][:, 0])]
        first = np.mean([q * (1.0 if q @ read[0] >= 0 else -1.0) for q in read], axis=0)
    # It stands flat.
    first = first / np.linalg.norm(first)
    half = 0.5 * math.atan2(2 * (first[0] * first[3] + first[1] * first[2]), 1 - 2 * (first[2] ** 2 + first[3] ** 2))
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    own = model.joint("object_x").qposadr[0]
    tool, tool_speed = model.joint("tool_x").qposadr[0], model.joint("tool_x").dofadr[0]
    # The joints are at the centre of mass, the site at the centre of the shape.
    to_com = -model.site("object").pos
    turned = np.zeros(3)
    mujoco.mju_rotVecQuat(turned, to_com, np.array([math.cos(half), 0.0, 0.0, math.sin(half)]))
    data.qpos[own:own + 7] = [*(start + turned), math.cos(half), 0.0, 0.0, math.sin(half)]
    data.qpos[tool:tool + 3] = sent[0]
    mujoco.mj_forward(model, data)
    steps = max(1, round(period_s / model.opt.timestep))
    model.opt.timestep = period_s / steps
    places, turns, forces = [data.site("object").xpos.copy()], [data.qpos[own + 3:own + 7].copy()], [np.zeros(3)]
    for tick in range(1, ticks + 1):
        speed = (sent[tick] - sent[tick - 1]) / period_s
        data.qpos[tool:tool + 3], data.qvel[tool_speed:tool_speed + 3] = sent[tick - 1], speed
        mujoco.mj_step(model, data, nstep=steps)
        forces.append((data.qvel[tool_speed:tool_speed + 3] - speed) * TOOL_KG / period_s)
        mujoco.mj_kinematics(model, data)
        places.append(data.site("object").xpos.copy())
        turns.append(data.qpos[own + 3:own + 7].copy())
    return (grid, np.array(places), np.array(turns), np.array(forces)), (times, place, turn)


def at(times, grid, values):
    return np.stack([np.interp(times, grid, values[:, axis]) for axis in range(values.shape[1])], 1)


def residuals(xml, rows, header, noise, clocks, rest_height):
    """Channel to standardised residuals, one a block."""
    (grid, places, turns, forces), (times, place, turn) = replay(xml, rows, header["period_secs"], rest_height)
    # A clock that is late shows now what was before.
    pose_times, force_times = times - clocks[0], times - clocks[1]
    near = turns[np.clip(np.round((pose_times - grid[0]) / header["period_secs"]).astype(int), 0, len(turns) - 1)]
    blend = at(pose_times, grid, turns * np.sign((turns * turns[0]).sum(axis=1))[:, None])
    simulated = np.where(np.linalg.norm(blend, axis=1)[:, None] > 0.9, blend / np.linalg.norm(blend, axis=1)[:, None], near)
    differences = {
        "object_position": place - at(pose_times, grid, places),
        "object_orientation": rotation_vectors(turn, simulated),
        "wrist_force": columns(rows, [f"wrist_f{a}_n" for a in "xyz"]) - at(force_times, grid, forces),
    }
    width = max(1, math.ceil((len(rows) - 1) / BLOCKS))
    found = {}
    for channel, values in differences.items():
        if channel not in noise:
            continue
        # The first row is where the simulation starts.
        for component in (values[1:] / noise[channel]).T:
            for first in range(0, len(component), width):
                block = component[first:first + width]
                block = block[~np.isnan(block)]
                if len(block):
                    found.setdefault(channel, []).append(block.sum() / math.sqrt(len(block)))
    return found


def rest_height(header, model):
    mean = lambda value: value["mean"] if isinstance(value, dict) else value
    shape, known = header["object"], model.get("nominal", {})
    sizes = [known.get(f"object.size_m[{i}]", mean(v)) for i, v in enumerate(shape["size_m"])]
    half = sizes[-1] if shape["shape"] == "sphere" else sizes[-1] / 2
    return known.get("table.height_m", mean(header["table"]["height_m"])) + half


def compare(log, answer):
    header = tomllib.loads((log / "log.toml").read_text())
    report = json.loads((answer / "report.json").read_text())
    model = tomllib.loads((answer / "model.toml").read_text())
    noise = {entry["channel"]: entry["stddev"] for entry in report["noise"]}
    nominal = model.get("nominal", {})
    clocks = [nominal.get(f"clock.{name}_secs", 0.0) for name in ("object", "force")]
    episodes = rows_of(log)
    height = rest_height(header, model)
    squares = {}
    for part, name in enumerate(("nominal.mjcf.xml", "model.mjcf.xml")):
        xml = (answer / name).read_text()
        for number, *_ in report["heldout"]["episodes"]:
            for channel, values in residuals(xml, episodes[number], header, noise, clocks, height).items():
                squares.setdefault(channel, [[], []])[part].extend(value * value for value in values)
    promised = {entry["channel"]: entry for entry in report["heldout"]["plain"]}
    channels = [channel for channel in CHANNELS if channel in squares and channel in promised]
    mean = lambda values: float(np.mean(values))
    here = [mean(np.concatenate([squares[c][part] for c in channels])) for part in (0, 1)]
    weights = [promised[c]["residuals"] for c in channels]
    there = [float(np.average([promised[c][part] for c in channels], weights=weights)) for part in ("before", "after")]
    closed = lambda before, after: (before - after) / (before - 1.0) if before > 1.0 else None
    return {
        "log": str(log),
        "effects": [effect["name"] for effect in report["effects"]] if report["verdict"] == "effect" else report["verdict"],
        "report": {"before": there[0], "after": there[1]},
        "mujoco": {"before": here[0], "after": here[1]},
        "closed": {"promised": closed(*there), "mujoco": closed(*here)},
        "channels": {c: {"report": [promised[c]["before"], promised[c]["after"]], "mujoco": [mean(s) for s in squares[c]]} for c in channels},
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=pathlib.Path, metavar="LOG ANSWER")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    arguments = parser.parse_args()
    if len(arguments.folders) % 2:
        parser.error("expected pairs of LOG and ANSWER")
    for log, answer in zip(arguments.folders[::2], arguments.folders[1::2]):
        found = compare(log, answer)
        if arguments.json:
            print(json.dumps(found), flush=True)
            continue
        numbers = "; ".join(f"{who} {found[who]['before']:.2f} to {found[who]['after']:.2f}" for who in ("report", "mujoco"))
        shares = ["-" if share is None else f"{100 * share:.0f} %" for share in found["closed"].values()]
        print(f"{log.name}: {found['effects']}: {numbers}; of the gap {shares[0]} closed as promised, {shares[1]} in MuJoCo", flush=True)


if __name__ == "__main__":
    main()
