"""Logs of arms with loads, by Pinocchio's inverse dynamics along smooth motions: no engine, no controller, no code of `arm_logs.py`'s physics.

    python load_logs.py --out DIR --seed 1              logs of eight arms with each load, and truth.json
    python load_logs.py --score DIR ANSWERS             what `diagnose --out ANSWERS/NAME` says of each, beside the truth

All joints have Coulomb and viscous friction and a motor's inertia that the file lacks. The true masses of links are 7 % off the file's (one
standard deviation). A negative load is a body of the file that the robot does not have. Units are SI and radians.
"""

from __future__ import annotations

import json
import os
import xml.etree.ElementTree as ET

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import pinocchio  # noqa: E402

import arm_models  # noqa: E402
from common import arguments, read_truth, write_truth  # noqa: E402

LOADS_KG = [None, 0.3, 1.0, 2.0, 4.0, -1.0]
RATE_HZ, SECS = 200, 30.0


def motion(model, rng: np.random.Generator, rate_hz: int = RATE_HZ, secs: float = SECS, off_secs: np.ndarray | float = 0.0) -> list[np.ndarray]:
    """Times, positions, rates and accelerations, a row a sample: sums of sines within 80 % of the ranges and half of the rates. Rows are `off_secs` off even ones."""
    time_secs = np.arange(0.0, secs, 1.0 / rate_hz) + off_secs
    lower, upper = np.maximum(model.lowerPositionLimit, -2.5), np.minimum(model.upperPositionLimit, 2.5)
    omega = 2.0 * np.pi * np.array([0.06, 0.13, 0.25, 0.43])[:, None] * rng.uniform(0.75, 1.3, (4, model.nv))
    size, phase = rng.uniform(0.4, 1.0, omega.shape) / np.sqrt(omega), rng.uniform(0.0, 2.0 * np.pi, omega.shape)
    angle = omega[None] * time_secs[:, None, None] + phase[None]
    rows = [(size * np.sin(angle)).sum(1), (size * omega * np.cos(angle)).sum(1), (-size * omega**2 * np.sin(angle)).sum(1)]
    rates = np.where(model.velocityLimit > 0.0, np.minimum(model.velocityLimit, 3.0), 1.5)
    scale = np.minimum(0.4 * (upper - lower) / np.abs(rows[0]).max(0), 0.5 * rates / np.abs(rows[1]).max(0))
    rows = [row * scale for row in rows]
    rows[0] = rows[0] + 0.5 * (lower + upper)
    return [time_secs] + rows


def reduced(path: str, joints: list[str]):
    """The model of a file with angles that turn on, held by limits of half a turn, and other joints locked."""
    tree = ET.parse(path)
    for joint in tree.getroot().findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            limit = ET.SubElement(joint, "limit", effort="100", velocity="2") if limit is None else limit
            limit.set("lower", "-3.1")
            limit.set("upper", "3.1")
    model = pinocchio.buildModelFromXML(ET.tostring(tree.getroot()).decode())
    locked = [i for i in range(1, model.njoints) if model.names[i] not in joints]
    return pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model)) if locked else model


def other_masses(model, share_off: float, rng: np.random.Generator) -> None:
    """Links whose masses are off by a normal share, with their inertias."""
    for i in range(1, model.njoints):
        share, old = max(1.0 + share_off * rng.standard_normal(), 0.5), model.inertias[i]
        model.inertias[i] = pinocchio.Inertia(old.mass * share, old.lever, old.inertia * share)


def write_header(folder: str, names: list[str], tip: str, rate_hz: int) -> None:
    with open(os.path.join(folder, "log.toml"), "w", encoding="utf-8") as file:
        listed = ", ".join(f'"{joint}"' for joint in names)
        file.write(f'version = 1\nrobot = "arm.urdf"\njoints = [{listed}]\ntip_link = "{tip}"\nperiod_secs = {1 / rate_hz}\n')


def make(folder: str, name: str, load_kg: float | None, rng: np.random.Generator) -> dict:
    arm = arm_models.load_arm(name)
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, "arm.urdf")
    for joint in arm.moving:
        joint.friction = joint.damping = 0.0
    arm_models.write_urdf(arm, path)
    names = [joint.name for joint in arm.moving]
    model = reduced(path, names)
    centre = rng.uniform(-0.05, 0.05, 3)
    if load_kg and load_kg < 0.0:  # a hand that only the file has
        tip = arm.links[arm.tip]
        hand = (-load_kg, centre, np.eye(3) * 0.4 * -load_kg * 0.05**2)
        tip.mass, tip.com, tip.inertia = arm_models.merge([(tip.mass, tip.com, tip.inertia), hand])
        arm_models.write_urdf(arm, path)
    other_masses(model, 0.07, rng)
    if load_kg and load_kg > 0.0:
        frame = model.frames[model.getFrameId(arm.tip, pinocchio.FrameType.BODY)]
        load = pinocchio.Inertia(load_kg, centre, np.eye(3) * 0.4 * abs(load_kg) * 0.05**2)
        model.inertias[frame.parentJoint] = model.inertias[frame.parentJoint] + frame.placement.act(load)
    time_secs, q, v, a = motion(model, rng)
    data = model.createData()
    torque = np.array([pinocchio.rnea(model, data, *row).copy() for row in zip(q, v, a)])
    usual = np.maximum(np.sqrt((torque**2).mean(0)), 0.05)
    usual_rate = np.sqrt((v**2).mean(0))
    coulomb = usual * rng.uniform(0.05, 0.25, len(usual))
    viscous = coulomb * rng.uniform(0.3, 1.2, len(usual)) / usual_rate
    motor = rng.uniform(0.1, 1.0, len(usual)) * np.array([np.diag(pinocchio.crba(model, data, row)) for row in q[::50]]).mean(0)
    torque = torque + coulomb * np.sign(v) + viscous * v + motor * a
    noise = 0.01 * np.sqrt((torque**2).mean(0))
    torque = torque + noise * rng.standard_normal(torque.shape)
    position = q + 2e-5 * rng.standard_normal(q.shape)
    columns = ["time_secs"] + [f"joint_{i}_rad" for i in range(len(names))] + [f"joint_torque_{i}_nm" for i in range(len(names))]
    np.savetxt(os.path.join(folder, "samples.csv"), np.hstack([time_secs[:, None], position, torque]), delimiter=",",
               header=",".join(columns), comments="", fmt="%.7g")
    write_header(folder, names, arm.tip, RATE_HZ)
    return {"arm": name, "load_kg": load_kg, "centre_m": centre.tolist(), "coulomb_nm": coulomb.tolist(),
            "viscous_nmsprad": viscous.tolist(), "motor_kgm2": motor.tolist()}


def score(logs: str, answers: str) -> None:
    truth = read_truth(logs)
    counts: dict = {}
    friction = [0, 0, 0]
    for name, entry in sorted(truth.items()):
        with open(os.path.join(answers, name, "report.json"), encoding="utf-8") as file:
            report = json.load(file)
        row = counts.setdefault(entry["load_kg"], [0, 0, 0, 0])
        row[0] += 1
        for effect in report["effects"]:
            for joint in effect["joints"]:
                values = {value["name"]: value for value in joint["parameters"]}
                if joint["form"] == "joint_friction":
                    low, high = values["coulomb"]["interval90"]
                    friction[1] += 1
                    friction[2] += low <= entry["coulomb_nm"][joint["joint"]] <= high
                if "coulomb" in values:
                    friction[0] += 1
                if effect["name"] == "payload":
                    row[1] += 1
                    if entry["load_kg"]:
                        low, high = values["mass"]["interval90"]
                        row[2] += low <= entry["load_kg"] <= high
                        row[3] += abs(values["mass"]["value"] / entry["load_kg"] - 1.0) <= 0.1
    print("| load, kg | logs | named | interval holds it | within 10 % |\n|---|---|---|---|---|")
    for load in sorted(counts, key=lambda load: (load is not None, load or 0.0)):
        row = counts[load]
        holds = " | ".join(str(number) for number in row[2:]) if load else "– | –"
        print(f"| {'none' if load is None else load} | {row[0]} | {row[1]} | {holds} |")
    joints = sum(len(entry["coulomb_nm"]) for entry in truth.values())
    print(f"\nFriction is named in {friction[0]} of {joints} joints; of plain friction {friction[2]} of {friction[1]} Coulomb intervals hold.")


def main() -> None:
    options = arguments(__doc__, score)
    logs, seed = options.out, options.seed
    truth = {}
    for i, name in enumerate(arm_models.CATALOGUE):
        for k, load in enumerate(LOADS_KG):
            log = f"{name}-{'none' if load is None else load}"
            truth[log] = make(os.path.join(logs, log), name, load, np.random.default_rng([seed, i, k]))
    write_truth(logs, truth)


if __name__ == "__main__":
    main()
