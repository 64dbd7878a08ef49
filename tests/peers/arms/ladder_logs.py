"""Logs of a simulated servo that swings a weight, with one of six friction laws that the URDF lacks.

    python ladder_logs.py --out DIR --seed 1 --logs 60 [--first K] [--noise-share 0.01] [--published]

The laws are the rungs M1 to M6 of Duclusaud and Passault, "Extended friction models for the physics simulation of servo
actuators" (ICRA 2025): Coulomb and viscous; Stribeck; with load; both; by direction; and quadratic in load.  By default load
is the torque that the gear passes on, with one share where the motor drives and another where the load does.  With
--published it is what they publish: |K_e external torque - K_m motor torque|.
Log K has rung 1 + K mod 6.  Each log is a folder DIR/NNNN with log.toml, samples.csv and robot.urdf; the truth goes to
DIR/truth.json.  The integration is this file's own: no engine.  SI units, radians.
"""

from __future__ import annotations

import argparse
import math
import os

import numpy as np

from common import log_uniform, read_truth, write_truth

GRAVITY = 9.81
STEP_SECS = 0.00025
RATE_HZ = 500
RUNGS = ["M1", "M2", "M3", "M4", "M5", "M6"]


def draw_law(rng: np.random.Generator, rung: int, torque: float, rate: float) -> dict:
    """Constants of rung 1 to 6 for a typical torque [N m] and rate [rad/s]."""
    law = dict(viscous=0.0, peak=0.0, stribeck=1.0, curvature=2.0, driving=0.0, driven=0.0, driving_peak=0.0,
               driven_peak=0.0, driving_square=0.0, driven_square=0.0)
    law["coulomb"] = torque * (log_uniform(rng, 0.02, 0.1) if rung < 3 else log_uniform(rng, 0.01, 0.05))
    law["viscous"] = law["coulomb"] * log_uniform(rng, 0.5, 1.5) / rate
    if rung in (2, 4, 5, 6):
        law["peak"] = law["coulomb"] * rng.uniform(0.5, 1.5)
        law["stribeck"] = log_uniform(rng, 0.03, 0.3)
        law["curvature"] = rng.uniform(1.2, 2.5)
    if rung >= 3:
        law["driving"] = law["driven"] = log_uniform(rng, 0.03, 0.15)
    if rung >= 4:
        law["driving_peak"] = law["driven_peak"] = law["driving"] * rng.uniform(0.5, 1.5)
    if rung >= 5:
        for key in ("driven", "driven_peak"):
            law[key] *= rng.uniform(0.0, 0.5) if rng.random() < 0.7 else rng.uniform(1.6, 2.5)
    if rung == 6:
        law["driving_square"] = log_uniform(rng, 0.05, 0.2) / torque
        law["driven_square"] = log_uniform(rng, 0.05, 0.2) / torque
    return law


def draw_published(rng: np.random.Generator, rung: int, torque: float, rate: float) -> dict:
    """The same with shares of motor and external torque, which add up to what a load is multiplied by."""
    law = draw_law(rng, rung, torque, rate)
    law["motor"] = law["external"] = law["driving"] / 2
    law["motor_peak"] = law["external_peak"] = law["driving_peak"] / 2
    if rung >= 5:
        for key in ("external", "external_peak"):
            law[key] *= rng.uniform(0.0, 0.5)
        for key in ("motor", "motor_peak"):
            law[key] *= 1.5
    law["square"] = law["driving_square"]
    return law


def level(law: dict, v: float, passed: float, motor: float, external: float) -> float:
    """Largest friction [N m] at a rate, a torque that the gear passes on to the link, and torques of motor and load."""
    slow = math.exp(-((abs(v) / law["stribeck"]) ** law["curvature"]))
    if "motor" in law:
        load = abs(external * law["external"] - motor * law["motor"])
        load_peak = abs(external * law["external_peak"] - motor * law["motor_peak"])
        against = external * motor < 0.0
        square = law["square"] * min(external * external, motor * motor) if against else 0.0
        return law["coulomb"] + law["viscous"] * abs(v) + load + slow * (law["peak"] + load_peak + square)
    way = "driving" if passed * v >= 0.0 else "driven"
    size = abs(passed)
    return (law["coulomb"] + law["viscous"] * abs(v) + law[way] * size
            + slow * (law["peak"] + law[way + "_peak"] * size + law[way + "_square"] * size * size))


def reference(rng: np.random.Generator, secs: float) -> np.ndarray:
    """Commanded angles, every millisecond: sums of sines, or to and fro at constant speeds from 0.02 rad/s on."""
    t = np.arange(int(secs * 1000)) / 1000
    if rng.random() < 0.5:
        q = sum(rng.uniform(0.15, 0.6) * np.sin(2 * np.pi * f * t + rng.uniform(-np.pi, np.pi))
                for f in (log_uniform(rng, 0.04, 0.12), log_uniform(rng, 0.12, 0.4), log_uniform(rng, 0.4, 0.9)))
        return q + rng.uniform(-0.6, 0.6)
    q, direction, here = np.empty(len(t)), 1.0, rng.uniform(-0.3, 0.3)
    left, speed = 0.0, 0.0
    for k in range(len(t)):
        if left <= 0.0:
            speed, left = direction * log_uniform(rng, 0.02, 1.5), rng.uniform(0.8, 2.5)
            direction = -direction
        if abs(here + speed * 0.001) > 1.4:
            speed = -speed
        here, left = here + speed * 0.001, left - 0.001
        q[k] = here
    width = 60  # round the corners within 60 ms
    return np.convolve(np.pad(q, width, mode="edge"), np.ones(2 * width + 1) / (2 * width + 1), mode="valid")


def simulate(law: dict, load: float, inertia: float, rotor: float, command: np.ndarray) -> tuple[np.ndarray, ...]:
    """Angles, rates and motor torques at 1 kHz.  `load` is m g l [N m]; the angle is 0 where the weight hangs."""
    whole = inertia + rotor
    stiffness, damping = whole * 60.0**2, whole * 2.0 * 60.0
    q, v, passed = float(command[0]), 0.0, load * math.sin(float(command[0]))
    out, before = np.zeros((3, len(command))), load * math.sin(q)
    for k in range(-500, len(command)):
        now = max(k, 0)
        want = float(command[now])
        rate = float(command[min(now + 1, len(command) - 1)] - command[now]) * 1000.0 if k >= 0 else 0.0
        motor = load * math.sin(want) + stiffness * (want - q) + damping * (rate - v)
        if k >= 0:
            # a motor holds its torque for a millisecond: at the instant between two holds it is the mean
            out[:, k] = q, v, 0.5 * (before + motor)
        before = motor
        for _ in range(int(round(0.001 / STEP_SECS))):
            gravity = load * math.sin(q)
            free = v + STEP_SECS * (motor - gravity) / whole
            most = STEP_SECS * level(law, v if v else free, passed, motor, -gravity) / whole
            new = free - min(max(free, -most), most)
            # the gear passes on what moves the link
            passed = gravity + inertia * (new - v) / STEP_SECS
            v = new
            q += STEP_SECS * v
    return out[0], out[1], out[2]


def write_urdf(path: str, mass: float, place: float, inertia: float) -> None:
    moment = f'ixx="{inertia:.8g}" iyy="{inertia:.8g}" izz="{inertia * 0.1:.8g}" ixy="0" ixz="0" iyz="0"'
    with open(path, "w", encoding="ascii") as file:
        file.write('<robot name="servo"><link name="base"/><link name="arm"><inertial>'
                   f'<origin xyz="0 0 {-place:.8g}"/><mass value="{mass:.8g}"/><inertia {moment}/></inertial></link>'
                   '<joint name="servo" type="revolute"><parent link="base"/><child link="arm"/>'
                   '<axis xyz="0 -1 0"/><limit lower="-3" upper="3" effort="100" velocity="20"/></joint></robot>\n')


def make_log(folder: str, seed: int, index: int, noise_share: float, published: bool) -> dict:
    rng = np.random.default_rng([seed, index])
    rung = 1 + index % 6
    mass, place = log_uniform(rng, 0.3, 5.0), rng.uniform(0.1, 0.3)
    about_centre = mass * (0.2 * place) ** 2
    inertia, load = about_centre + mass * place**2, mass * GRAVITY * place
    rotor = inertia * rng.uniform(0.05, 0.3)
    law = (draw_published if published else draw_law)(rng, rung, 0.5 * load, 0.5)
    os.makedirs(folder, exist_ok=True)
    wrong = 1.0 + rng.uniform(-0.05, 0.05)
    write_urdf(os.path.join(folder, "robot.urdf"), mass * wrong, place + rng.uniform(-0.003, 0.003),
               about_centre * (1.0 + rng.uniform(-0.1, 0.1)))
    gain = 1.0 + 0.01 * rng.normal()  # of the torque constant
    noise = max(noise_share * load, 1e-4)
    lines, stride = ["episode,time_secs,joint_0_rad,joint_0_rps,joint_torque_0_nm"], 1000 // RATE_HZ
    for episode in range(5):
        q, v, motor = (column[::stride] for column in simulate(law, load, inertia, rotor, reference(rng, 12.0)))
        read = motor * gain + noise * rng.normal(size=len(q))
        q, v = q + 5e-5 * rng.normal(size=len(q)), v + 3e-3 * rng.normal(size=len(q))
        lines += [f"{episode},{k / RATE_HZ:.4f},{q[k]:.7f},{v[k]:.6f},{read[k]:.6f}" for k in range(len(q))]
    with open(os.path.join(folder, "samples.csv"), "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")
    with open(os.path.join(folder, "log.toml"), "w", encoding="utf-8") as file:
        file.write('version = 1\nrobot = "robot.urdf"\njoints = ["servo"]\ntip_link = "arm"\n'
                   f"period_secs = {1.0 / RATE_HZ:g}\ngravity_mps2 = {GRAVITY}\n\n[gear]\n"
                   f"reflected_inertia_kgm2 = [{rotor * (1.0 + rng.uniform(-0.1, 0.1)):.6g}]\n")
    return {"rung": RUNGS[rung - 1], "law": law, "load_nm": load, "noise_nm": noise, "seed": seed}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--logs", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--noise-share", type=float, default=0.005, help="of torque readings, of m g l")
    parser.add_argument("--published", action="store_true", help="load as the paper has it")
    options = parser.parse_args()
    truth = read_truth(options.out)
    for index in range(options.first, options.first + options.logs):
        name = f"{index:04d}"
        if name in truth:
            continue
        truth[name] = make_log(os.path.join(options.out, name), options.seed, index, options.noise_share,
                               options.published)
        write_truth(options.out, truth)
        print(name, truth[name]["rung"], flush=True)


if __name__ == "__main__":
    main()
