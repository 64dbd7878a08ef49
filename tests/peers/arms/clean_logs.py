"""Logs of arms without any noise, as simulators write them, by Pinocchio's inverse dynamics along the motions of `load_logs.py`.

    python clean_logs.py --out DIR --seed 6             logs of eight arms with what each hides, and truth.json
    python clean_logs.py --score DIR ANSWERS            what `diagnose --out ANSWERS/NAME` says of each, beside the truth

`--readings` says what loggers and encoders did to them: `exact` (nothing), `milliseconds` (stamps are rounded), `jitter` (stamps of steady rows are up to a fifth of a
period off), `uneven` (so are the rows, and stamps are right), `encoder` (positions in 4,096 or 16,384 counts a turn, no velocities).

Hidden: nothing; masses that are 4 % off (one standard deviation), which is nothing either; friction in one joint, or in all with such masses; a torque
constant that is 20 % off in one joint, with such masses; a torque that the catalogue lacks. 100 or 500 Hz, 20 s, with velocities or without.
"""

from __future__ import annotations

import json
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import pinocchio  # noqa: E402

import arm_models  # noqa: E402
import load_logs  # noqa: E402
from common import arguments, read_truth, write_truth  # noqa: E402

KINDS = ["none", "masses", "friction", "friction_all", "gain", "outside"]
READINGS = ["exact", "milliseconds", "jitter", "uneven", "encoder"]


def spoil(readings: str, rate_hz: int, time_secs: np.ndarray, q: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and positions as they are logged."""
    if readings == "milliseconds":
        return np.round(time_secs, 3), q
    if readings == "jitter":
        return time_secs + rng.uniform(-0.2, 0.2, len(time_secs)) / rate_hz, q
    if readings == "encoder":
        count = 2.0 * np.pi / rng.choice([4096, 16384])
        return time_secs, np.round(q / count) * count
    return time_secs, q


def make(folder: str, name: str, kind: str, rate_hz: int, velocities: bool, readings: str, rng: np.random.Generator) -> dict:
    arm = arm_models.load_arm(name)
    os.makedirs(folder, exist_ok=True)
    for joint in arm.moving:
        joint.friction = joint.damping = 0.0
    path = os.path.join(folder, "arm.urdf")
    arm_models.write_urdf(arm, path)
    names = [joint.name for joint in arm.moving]
    model = load_logs.reduced(path, names)
    if kind in ("masses", "friction_all", "gain"):
        load_logs.other_masses(model, 0.04, rng)
    off = rng.uniform(-0.2, 0.2, int(20.0 * rate_hz)) / rate_hz if readings == "uneven" else 0.0
    time_secs, q, v, a = load_logs.motion(model, rng, rate_hz, 20.0, off)
    data = model.createData()
    torque = np.array([pinocchio.rnea(model, data, *row).copy() for row in zip(q, v, a)])
    usual = np.maximum(np.sqrt((torque**2).mean(0)), 0.05)
    joint = int(rng.integers(len(names)))
    joints: list[int] = []
    if kind.startswith("friction"):
        joints = list(range(len(names))) if kind == "friction_all" else [joint]
        for j in joints:
            torque[:, j] += usual[j] * (0.15 * np.sign(v[:, j]) + 0.1 * v[:, j] / np.sqrt((v[:, j] ** 2).mean()))
    elif kind == "gain":
        joints = [joint]
        torque[:, joint] *= 1.2
    elif kind == "outside":
        others = [(joint + 1) % len(names), (joint + 2) % len(names)]
        torque[:, joint] += 0.2 * usual[joint] * np.sin(3.0 * q[:, others[0]]) * np.sign(v[:, others[1]])
    time_secs, q = spoil(readings, rate_hz, time_secs, q, rng)
    columns = [("joint_{}_rad", q)] + ([("joint_{}_rps", v)] if velocities else []) + [("joint_torque_{}_nm", torque)]
    header = ["time_secs"] + [column.format(i) for column, values in columns for i in range(values.shape[1])]
    rows = np.hstack([time_secs[:, None]] + [values for _, values in columns])
    np.savetxt(os.path.join(folder, "samples.csv"), rows, delimiter=",", header=",".join(header), comments="", fmt="%.17g")
    load_logs.write_header(folder, names, arm.tip, rate_hz)
    return {"arm": name, "kind": kind, "joints": joints}


def right(entry: dict, report: dict) -> bool:
    named = [(effect["name"], {joint["joint"] for joint in effect["joints"]}) for effect in report["effects"]]
    if entry["kind"] in ("none", "masses"):
        return report["verdict"] == "none"
    if entry["kind"] == "outside":
        return report["verdict"] == "unknown"
    name = "torque_gain" if entry["kind"] == "gain" else "joint_friction"
    return named == [(name, set(entry["joints"]))]


def score(logs: str, answers: str) -> None:
    counts = {kind: [0, 0] for kind in KINDS}
    for name, entry in sorted(read_truth(logs).items()):
        path = os.path.join(answers, name, "report.json")
        row = counts[entry["kind"]]
        row[0] += 1
        if not os.path.exists(path):
            print(f"{name}: no answer")
            continue
        with open(path, encoding="utf-8") as file:
            report = json.load(file)
        row[1] += right(entry, report)
        if not right(entry, report):
            said = [(effect["name"], round(effect["confidence"], 2)) for effect in report["effects"]]
            print(f"{name} hides {entry['kind']} {entry['joints']}: {report['verdict']} {said}")
    print("\n| hidden | logs | right |\n|---|---|---|")
    for kind, (logs_of, right_of) in counts.items():
        print(f"| {kind} | {logs_of} | {right_of} |")


def main() -> None:
    options = arguments(__doc__, score, readings=READINGS)
    truth = {}
    for place, name in enumerate(arm_models.CATALOGUE):
        for number, kind in enumerate(KINDS):
            rate_hz, velocities = [100, 500][(place + number) // 2 % 2], (number // 2 + place) % 2 == 1
            if options.readings == "milliseconds":
                # They are right at 100 and 500 Hz.
                rate_hz = [240, 300][(place + number) // 2 % 2]
            velocities = velocities and options.readings != "encoder"
            log, rng = f"{name}-{kind}", np.random.default_rng([options.seed, place, number])
            truth[log] = make(os.path.join(options.out, log), name, kind, rate_hz, velocities, options.readings, rng)
    write_truth(options.out, truth)


if __name__ == "__main__":
    main()
