#!/usr/bin/env python3
"""The hidden effects against closed forms. They are the same code in every engine; one engine is enough.

    python tests/peers/worlds/check_effects.py [--engine mujoco --variant hard]

Prints measured, expected and allowed difference; exit status 1 beyond it.
"""

import argparse
import math
import sys

import numpy as np

import sensors
from plan import Course, Episode
from scene import GRAVITY, Rig, Scene
from world import World

G, MASS = GRAVITY, 0.5


def scene(kind="box", mu=0.35):
    size = {"box": [0.08, 0.06, 0.05], "sphere": [0.03], "upright": [0.035, 0.05]}[kind]
    return Scene(kind, size, MASS, mu, 0.1, 0.015, [0.0, 0.0], {})


def free(s, effects, which, seconds, velocity=(0, 0, 0, 0, 0, 0)):
    episode = Episode([0, 0, s.half_height_m, *s.orientation(0.0)], list(velocity), None, seconds)
    return World(s, effects, *which).run(episode)


def pushed(s, effects, which, speed=0.1, way=0.1, wait=0.0, retreat=0.0, added=0.0):
    course = Course([-0.04 - s.tool_radius_m - 0.002, 0, 0.025]).wait(wait).move([way, 0, 0], speed)
    if retreat:
        course.wait(0.3).move([-retreat, 0, 0], 0.02)
    episode = Episode([0, 0, s.half_height_m, 0, 0, 0, 1], [0.0] * 6, course, course.end_s, added)
    return World(s, effects, *which).run(episode)


def steady(trace, begin=0.5, end=0.85):
    n = len(trace.time_s)
    return -trace.wrench[int(begin * n):int(end * n), 0].mean()


def force_checks(which):
    smooth = scene(mu=1e-4)
    v = (0.3, 0, 0, 0, 0, 0)
    t = free(smooth, {"viscous_damping": {"coefficient_nspm": 1.0}}, which, 0.5, v)
    yield "viscous speed", t.velocity[-1, 0], 0.3 * math.exp(-t.time_s[-1] / MASS), 0.003
    t = free(smooth, {"quadratic_drag": {"coefficient_ns2pm2": 3.0}}, which, 0.5, v)
    yield "drag speed", t.velocity[-1, 0], 0.3 / (1 + 3.0 * 0.3 * t.time_s[-1] / MASS), 0.003
    t = free(smooth, {"constant_force": {"force_x_n": 0.2, "force_y_n": 0.0}}, which, 0.5)
    yield "constant force speed", t.velocity[-1, 0], 0.2 / MASS * t.time_s[-1], 0.003
    t = free(smooth, {"table_tilt": {"slope_x_rad": 0.02, "slope_y_rad": 0.0}}, which, 0.5)
    yield "tilt speed", t.velocity[-1, 0], G * math.sin(0.02) * t.time_s[-1], 0.003
    t = free(smooth, {"tether": {"stiffness_npm": 5.0, "anchor_x_m": 0.1, "anchor_y_m": 0.0}}, which, math.pi * math.sqrt(MASS / 5.0))
    yield "tether half period", t.pose[-1, 0], 0.2, 0.003
    t = free(scene("sphere"), {"rolling_resistance": {"lever_m": 0.001}}, which, 0.5, (0.2, 0, 0, 0, 0.2 / 0.03, 0))
    yield "rolling slows by", (0.2 - t.velocity[-1, 0]) / t.time_s[-1], 5 / 7 * 0.001 * G / 0.03, 0.01


def friction_checks(which):
    slide = lambda mu, v: v * v / (2 * mu * G)
    for direction in (0.0, math.pi / 2):
        p = {"amplitude": 0.3, "axis_rad": 0.0}
        v = (0.4 * math.cos(direction), 0.4 * math.sin(direction), 0, 0, 0, 0)
        t = free(scene(), {"anisotropic_friction": p}, which, 0.5, v)
        expected = slide(0.35 * (1 + 0.3 * math.cos(2 * direction)), 0.4)
        yield f"anisotropic slide {direction:.2f}", math.hypot(*t.pose[-1, :2]), expected, 0.04 * expected
    t = free(scene(), {"friction_patch": {"excess": 0.8, "x_m": 0.0, "y_m": 0.0, "radius_m": 1.0}}, which, 0.5, (0.4, 0, 0, 0, 0, 0))
    yield "slide in a patch", t.pose[-1, 0], slide(0.35 * 1.8, 0.4), 0.04 * slide(0.35 * 1.8, 0.4)
    weight = 0.35 * MASS * G
    t = pushed(scene(), {"stribeck_friction": {"excess": 0.6, "velocity_mps": 0.05}}, which, speed=0.03, way=0.05)
    yield "Stribeck push", steady(t), weight * (1 + 0.6 * math.exp(-0.36)), 0.06 * weight
    t = pushed(scene(), {"friction_level": {"coefficient": 0.5}}, which)
    yield "friction level push", steady(t), 0.5 * MASS * G, 0.06 * weight
    t = pushed(scene(), {"mass_leak": {"rate_ps": 0.02}}, which, wait=4.0)
    middle = 4.0 + 0.7 * (t.time_s[-1] - 4.0)
    yield "leaking push", steady(t, 0.87, 0.97), weight * (1 - 0.02 * middle), 0.06 * weight
    t = pushed(scene(), {}, which, added=0.5)
    yield "push with a weight", steady(t), 2 * weight, 0.08 * weight
    s = scene(mu=0.05)
    t = pushed(s, {"adhesion": {"pull_off_n": 1.0}}, which, retreat=0.03)
    yield "adhesion pulls back", t.pose[:, 0].max() - t.pose[-1, 0], 0.03, 0.004
    k = 200.0
    t = pushed(scene(), {"arm_compliance": {"stiffness_npm": k}}, which, speed=0.05)
    n = int(0.75 * len(t.time_s))
    yield "compliant arm lags", float((t.command[n - 200:n, 0] - t.tool[n - 200:n, 0]).mean()), weight / k, 0.1 * weight / k


def sensor_checks(which):
    rig = Rig(False, False, {"command", "tool", "force", "torque", "orientation", "velocity"}, force_mean=True, force_period_s=0.01)
    at = np.arange(1, 90) * 0.01
    times = {key: at for key in ("tool", "force", "object")}
    base = pushed(scene(), {}, which)
    plain = sensors.read(base, times, {}, rig)
    late = sensors.read(base, times, {"pose_delay": {"delay_secs": 0.05}}, rig)
    yield "pose delay shifts", float((late["position"][1][60:, 0] - plain["position"][1][55:-5, 0]).max()), 0.0, 1e-4
    turned = sensors.read(base, times, {"pose_rotation": {"yaw_rad": 0.05}}, rig)
    yield "pose rotation", math.atan2(*turned["position"][1][-1, 1::-1]), 0.05 + math.atan2(*plain["position"][1][-1, 1::-1]), 1e-6
    yield "pose rotation turns", 2 * turned["orientation"][1][-1, 2], 0.05 + 2 * plain["orientation"][1][-1, 2], 1e-4
    gain = sensors.read(base, times, {"force_gain": {"gain": 1.2}}, rig)
    yield "force gain", float(gain["force"][1].sum() / plain["force"][1].sum()), 1.2, 1e-9
    slow = sensors.read(base, times, {"force_low_pass": {"time_constant_secs": 0.03}}, rig)
    yield "low pass keeps the mean", float(slow["force"][1][40:80, 0].mean() / plain["force"][1][40:80, 0].mean()), 1.0, 0.03
    fast = pushed(scene(), {"time_base": {"rate": 1.05}}, which)
    read = sensors.read(fast, times, {"time_base": {"rate": 1.05}}, rig)
    yield "time base: read tool follows the command", float(abs(read["tool"][1] - read["command"][1]).max()), 0.0, 1e-6
    yield "time base: read speed", float(read["linear"][1][70:80, 0].mean()), 0.1, 0.003


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", default="mujoco")
    parser.add_argument("--variant", default="hard")
    options = parser.parse_args()
    fine = True
    for checks in (force_checks, friction_checks, sensor_checks):
        for name, measured, expected, allowed in checks((options.engine, options.variant)):
            ok = abs(measured - expected) <= allowed
            fine &= bool(ok)
            print(f"{'ok  ' if ok else 'OFF '} {name:42} {measured:10.5f}  expected {expected:10.5f} ± {allowed:.5f}", flush=True)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
