#!/usr/bin/env python3
"""Motions with a closed form in every engine: slide, fall, push, roll, oblique forces.

    python tests/peers/worlds/check_engines.py [--engines mujoco,bullet] [--out FILE.md]

Prints a table: measured over expected. Exit status 1 where an engine is more than 25 % off in a slide, a fall or a push.
"""

import argparse
import math
import pathlib
import sys
import time

import numpy as np

import engines
from scene import GRAVITY, solid_inertia

SIZES = {"small": 0.25, "medium": 1.0, "large": 5.0}


def body(shape="box", scale=1.0, mass=None, mu=0.35, gravity=(0, 0, -GRAVITY), **more):
    size = {"box": [0.08, 0.06, 0.05], "cylinder": [0.035, 0.05], "sphere": [0.03]}[shape]
    size = [v * scale for v in size]
    mass = 0.5 * scale ** 3 if mass is None else mass
    return engines.Body(shape, size, mass, mass, np.zeros(3), solid_inertia(shape, size, mass), mu, 0.1, 0.015 * scale,
                        np.array(gravity, float), **more)


def run(name, variant, b, seconds, velocity=(0,) * 6, lift=0.0, load=None, tool=None, friction=None):
    """Poses, velocities and wrenches, a row a step."""
    engine = engines.make(name, b, variant)
    far = np.array([0.0, 50.0 * max(b.half_m), 2 * b.half_m[2] + 1.0])
    course = (lambda t: far) if tool is None else tool
    engine.place([0, 0, b.half_m[2] + lift, 0, 0, 0, 1], list(velocity), course(0.0))
    if friction:
        engine.set_friction(friction)
    rows, h = [], engine.step_s
    for k in range(round(seconds / h)):
        f = None if load is None else np.array(load, float)
        w = engine.step(f, None if f is None else np.zeros(3), course((k + 1) * h))
        rows.append(np.concatenate([*engine.state(), w]))
    return np.array(rows), h


def checks(name, variant):
    """(name, measured, expected) each."""
    g, mu = GRAVITY, 0.35
    for label, scale in SIZES.items():
        v = 0.6 * math.sqrt(scale)
        rows, _ = run(name, variant, body(scale=scale), 1.2 * v / (mu * g) + 0.1, (v, 0, 0, 0, 0, 0))
        yield f"slide {label}", rows[-1, 0], v * v / (2 * mu * g)
    for degrees in (22.5, 45.0):
        c, n = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        rows, _ = run(name, variant, body(), 0.4, (0.6 * c, 0.6 * n, 0, 0, 0, 0))
        yield f"slide at {degrees}°", math.hypot(*rows[-1, :2]), 0.36 / (2 * mu * g)
    height = 0.08
    rows, h = run(name, variant, body(), 0.12, lift=height)
    yield "fall", 0.025 + height - rows[-1, 2], g * (len(rows) * h) ** 2 / 2
    for label, scale in SIZES.items():
        b = body(scale=scale)
        v, start = 0.15 * math.sqrt(scale), -0.04 * scale - b.tool_radius_m - 0.005 * scale
        seconds = 0.08 * scale / v
        rows, _ = run(name, variant, b, seconds, tool=lambda t: np.array([start + v * t, 0, b.half_m[2]]))
        yield f"push force {label}", -rows[len(rows) // 2:, 13].mean(), mu * b.mass_kg * g
    rows, _ = run(name, variant, body("sphere"), 0.6, (0.3, 0, 0, 0, 0, 0))
    yield "sphere rolls", rows[-1, 7], 0.3 * 5 / 7
    rows, h = run(name, variant, body(mu=0.001), 0.5, load=[0.5, 0, 0])
    yield "force on a slippery box", rows[-1, 7], 0.5 / 0.5 * len(rows) * h - 0.001 * g * len(rows) * h
    rows, h = run(name, variant, body(mu=0.35), 0.5, (0.6, 0, 0, 0, 0, 0), friction=0.7)
    yield "friction set later", rows[-1, 0], 0.36 / (2 * 0.7 * g)
    tilt = 0.4
    rows, h = run(name, variant, body(gravity=(g * math.sin(tilt), 0, -g * math.cos(tilt))), 0.4)
    yield "tilted table", rows[-1, 7], g * (math.sin(tilt) - mu * math.cos(tilt)) * len(rows) * h
    rows, h = run(name, variant, body(), 0.6)
    yield "rest height", rows[-1, 2], 0.025
    moment, corner = (0.08 ** 2 + 0.06 ** 2) / 12, math.hypot(0.04, 0.03)
    rows, h = run(name, variant, body(), 0.6, (0, 0, 0, 0, 0, 6.0))
    yield "spin (corners bear)", abs(rows[:, 12].sum()) * h, 36.0 * moment / (2 * mu * g * corner)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", default=",".join(engines.ENGINES))
    parser.add_argument("--out", type=pathlib.Path)
    options = parser.parse_args()
    table, columns, fine = {}, [], True
    for name in options.engines.split(","):
        for variant in engines.ENGINES[name]:
            columns.append(f"{name} {variant}")
            began = time.perf_counter()
            for what, measured, expected in checks(name, variant):
                ratio = measured / expected
                table.setdefault(what, []).append(f"{ratio:.3f}")
                held = what.split()[0] in ("slide", "fall", "push") and "°" not in what
                if held and not 0.75 < ratio < 1.25:
                    fine = False
            table.setdefault("seconds", []).append(f"{time.perf_counter() - began:.1f}")
    lines = ["| measured / expected | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    lines += [f"| {what} | " + " | ".join(cells) + " |" for what, cells in table.items()]
    print("\n".join(lines))
    if options.out:
        options.out.write_text("\n".join(lines) + "\n")
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
