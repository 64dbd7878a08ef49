#!/usr/bin/env python3
"""Small misfits made in good logs, and how well `log align` finds them.

    python tests/peers/log_align.py target/release/log LOG…    # numpy; folders of logs with samples.csv

Each log's object is moved by up to 2 cm in x and y and 5 mm in z, turned by up to 6° about the vertical, shifted by up to three rows in time, and its
lengths are divided by 0.93 to 1.07, drawn by the log's place on the command line. Where the log has a truth beside it (tests/peers/worlds), its own skew
of the object's clock counts as well. Prints errors beside the stated standard deviations, their medians, and how many of the 90 % intervals hold.
"""

import csv
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import tomllib

import numpy as np

SEED = 7
NAMES = ("x_m", "y_m", "z_m", "yaw_rad", "size", "late_s")


def product(a, b):
    """Of quaternions x, y, z, w."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return [aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz]


def spoil(log, out, rng):
    """Writes the spoilt log; what was made of it, in the order of NAMES."""
    shift = np.array([*rng.uniform(-0.02, 0.02, 2), rng.uniform(-0.005, 0.005)])
    yaw, factor, late_rows = math.radians(rng.uniform(-6, 6)), float(rng.uniform(0.93, 1.07)), int(rng.integers(-3, 4))
    with open(log / "samples.csv") as file:
        rows = list(csv.DictReader(file))
    head = (log / "log.toml").read_text()
    c, s = math.cos(-yaw), math.sin(-yaw)
    for row in rows:
        if row["object_x_m"] == "":
            continue
        x, y, z = np.array([float(row[f"object_{axis}_m"]) for axis in "xyz"]) - shift
        for axis, value in zip("xyz", (c * x - s * y, s * x + c * y, z)):
            row[f"object_{axis}_m"] = repr(float(value))
        if row.get("object_qx", "") != "":
            turned = product([0, 0, math.sin(-yaw / 2), math.cos(-yaw / 2)], [float(row[f"object_q{part}"]) for part in "xyzw"])
            row.update({f"object_q{part}": repr(float(value)) for part, value in zip("xyzw", turned)})
    episodes, columns = {}, [name for name in rows[0] if name.startswith("object_")]
    for row in rows:
        episodes.setdefault(row["episode"], []).append(row)
    for episode in episodes.values():
        seen = [{name: row[name] for name in columns} for row in episode]
        for index, row in enumerate(episode):
            row.update(seen[min(max(index - late_rows, 0), len(episode) - 1)])
    with open(out / "samples.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)

    def divided(value):
        if isinstance(value, dict):
            return f"{{ mean = {value['mean'] / factor!r}, stddev = {value['stddev'] / factor!r} }}"
        return repr(value / factor)

    sizes = ", ".join(divided(value) for value in tomllib.loads(head)["object"]["size_m"])
    (out / "log.toml").write_text(re.sub(r"size_m = \[.*\]", f"size_m = [{sizes}]", head, count=1))
    times = [float(row["time_secs"]) for row in next(iter(episodes.values()))]
    truth = log.parent / "truth" / f"{log.name}.json"
    skew_s = json.loads(truth.read_text())["skew_s"] if truth.exists() else 0.0
    return [*shift, yaw, factor, late_rows * float(np.median(np.diff(times))) + skew_s]


def main():
    program, errors, spreads = sys.argv[1], [], []
    for place, log in enumerate(map(pathlib.Path, sys.argv[2:])):
        with tempfile.TemporaryDirectory() as folder:
            made = spoil(log, pathlib.Path(folder), np.random.default_rng([SEED, place]))
            answer = subprocess.run([program, "align", folder, "--json"], capture_output=True, text=True)
        if answer.returncode != 0:
            print(f"{log}: refused: {answer.stderr.strip().split(': ', 1)[-1]}")
            continue
        found = json.loads(answer.stdout)
        found = [*found["translation_m"], found["yaw_rad"], found["size_factor"], found["late_secs"]]
        errors.append([value["value"] - true for value, true in zip(found, made)])
        spreads.append([value["stddev"] for value in found])
        print(f"{log}: " + "  ".join(f"{name} {e:+.5f} ± {s:.5f}" for name, e, s in zip(NAMES, errors[-1], spreads[-1])))
    errors, spreads = np.abs(errors), np.array(spreads)
    for column, name in enumerate(NAMES):
        inside = int((errors[:, column] < 1.645 * spreads[:, column]).sum())
        print(f"{name}: median error {np.median(errors[:, column]):.5f}, {inside} of {len(errors)} within 90 %")


if __name__ == "__main__":
    main()
