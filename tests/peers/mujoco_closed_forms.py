#!/usr/bin/env python3
"""Motions with a closed form, as MuJoCo simulates them with the fine settings of mujoco_scenes.py.

    python tests/peers/mujoco_closed_forms.py

Writes crates/physics-model/tests/data/mujoco_closed_forms.csv: name, MuJoCo's value, closed form (empty where there is none), SI units.
"""

import argparse
import math
import os

import numpy as np

import mujoco_scenes as peer
from mujoco_scenes import Body, Scene

mujoco = peer.mujoco
H = peer.CONTROL_DT_S / peer.SUBSTEPS


def launch(body, seconds, linear=0.0, spin=0.0, lying=False):
    """A body launched along x, or turning about z. Returns the end and how far it has turned about z, rad."""
    body.pos = (0.0, 0.0, body.size[0] if lying else body.half_height())
    m = peer.model(Scene("launch", body, None, "ball", (0.0, 0.0, 5.0), 0), H)
    d = mujoco.MjData(m)
    if lying:
        # Axis along y, so that it rolls along x.
        d.qpos[6:10] = [math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0]
    d.qvel[3], d.qvel[8] = linear, spin
    turned = 0.0
    for _ in range(round(seconds / H)):
        d.qpos[:3], d.qvel[:3] = 0.0, 0.0
        mujoco.mj_step(m, d)
        turned += d.qvel[8] * H
    return d.qvel[3], d.qpos[3], turned


def yaw(quaternion):
    w, x, y, z = quaternion
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def measures():
    g = peer.GRAVITY
    body = Body("box", (0.08, 0.08, 0.07), pos=(0.0, 0.0, 0.035), mass=0.6, friction=0.45)
    push = peer.simulate(Scene("push", body, None, "ball", (-0.065, 0.0, 0.035), 0), speed=0.06)
    yield "push_force_n", -float(np.mean([w[0] for w in push.series[10:]])), 0.45 * 0.6 * g
    _, x, _ = launch(Body("box", (0.1, 0.1, 0.04), mass=0.7, friction=0.4), 0.5, linear=1.0)
    yield "slide_m", x, 1.0 / (2 * 0.4 * g)
    v, _, _ = launch(Body("sphere", (0.04, 0, 0), mass=0.7, friction=0.4), 0.5, linear=0.5)
    yield "sphere_rolls_mps", v, 0.5 * 5 / 7
    v, _, _ = launch(Body("cylinder", (0.04, 0.1, 0), mass=0.7, friction=0.4), 0.5, linear=0.5, lying=True)
    yield "lying_cylinder_rolls_mps", v, 0.5 * 2 / 3
    _, _, turned = launch(Body("box", (0.08, 0.08, 0.03), mass=0.5, friction=0.4), 0.5, spin=15.0)
    # The weight is on the four corners.
    inertia, corner = (0.08**2 + 0.08**2) / 12, math.hypot(0.04, 0.04)
    yield "spin_rad", turned, 15.0**2 * inertia / (2 * 0.4 * g * corner)
    for name, com, offset in (("yaw_com_rad", 0.02, 0.0), ("yaw_offset_rad", 0.0, 0.02), ("yaw_both_rad", -0.01, 0.015)):
        body = Body("box", (0.08, 0.08, 0.08), pos=(0.0, 0.0, 0.04), mass=0.5, friction=0.4, com=(0.0, com, 0.0))
        end = peer.simulate(Scene(name, body, None, "ball", (-0.065, offset, 0.04), 0))
        yield name, yaw(end.object[3:]), None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    here = os.path.dirname(os.path.abspath(__file__))
    data = os.path.join(here, "..", "..", "crates", "physics-model", "tests", "data")
    parser.add_argument("--out", default=os.path.join(data, "mujoco_closed_forms.csv"))
    out = parser.parse_args().out
    lines = [f"# MuJoCo {mujoco.__version__}; written by: python tests/peers/mujoco_closed_forms.py", "name,mujoco,closed_form"]
    for name, value, exact in measures():
        print(f"{name:26} {value:.6f}" + ("" if exact is None else f"  closed form {exact:.6f}"))
        lines.append(f"{name},{value:.9g},{'' if exact is None else format(exact, '.9g')}")
    with open(out, "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
