"""Checks of the generator.  Not needed to make logs.

    python check_arm_logs.py exact [--engine E]     equations of motion at the engines' own accelerations, per arm
    python check_arm_logs.py closure [EFFECT] [--engine E]   per effect: misfit without and with the effect as truth.json states it
    python check_arm_logs.py engines                the same scenarios in both engines
    python check_arm_logs.py folder DIR             files of a finished folder: finite, right columns, readable URDFs

The inverse dynamics are those of Pinocchio on a URDF of the true arm, which shares no code with the generator.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import tempfile
import tomllib

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import pinocchio  # noqa: E402

import arm_logs  # noqa: E402
import arm_models  # noqa: E402
import effects  # noqa: E402
from motions import TICK_SECS  # noqa: E402


class Pinocchio:
    """Inverse dynamics of a URDF file."""

    def __init__(self, path: str, gravity=(0.0, 0.0, -arm_logs.GRAVITY)):
        self.model = pinocchio.buildModelFromUrdf(path)
        self.model.gravity.linear[:] = gravity
        self.data = self.model.createData()

    def inverse(self, q, v, a) -> np.ndarray:
        coordinates = []
        for i, value in enumerate(q):  # a continuous joint has two coordinates
            coordinates += [np.cos(value), np.sin(value)] if self.model.joints[i + 1].nq == 2 else [value]
        return pinocchio.rnea(self.model, self.data, np.array(coordinates), np.asarray(v), np.asarray(a)).copy()

    def rows(self, q, v, a) -> np.ndarray:
        return np.array([self.inverse(*row) for row in zip(q, v, a)])


def true_model(log, payload=None, gravity=(0.0, 0.0, -arm_logs.GRAVITY)) -> Pinocchio:
    """Pinocchio's model of the true arm, with a payload (mass, com in the tip link, inertia) if given."""
    arm = arm_models.load_arm(log.setup["arm"])
    if payload:
        mass, com, inertia = payload
        tip = arm.links[arm.tip]
        tip.mass, tip.com, tip.inertia = arm_models.merge([(tip.mass, tip.com, tip.inertia),
                                                           (mass, np.array(com), inertia * np.eye(3))])
    with tempfile.NamedTemporaryFile(suffix=".urdf") as file:
        arm_models.write_urdf(arm, file.name)
        return Pinocchio(file.name, gravity)


def exact(engine) -> None:
    """ID(q, v, a) - (motor torque - friction) with the engine's accelerations, and with differenced readings."""
    print("arm     friction  exact: worst |error| N m   differenced: rms error / noise, worst joint")
    for k, name in enumerate(arm_models.CATALOGUE):
        for index in (100 + k, next(i for i in range(200 + k, 400)
                                    if arm_logs.draw_setup(7, i, "none", name)["known_friction"])):
            log = arm_logs.simulate_log(engine, 7, index, "none", name)
            model, worst = true_model(log), 0.0
            for track in log.tracks:
                rows = slice(0, None, 20)
                torque = model.rows(track.q[rows], track.v[rows], track.exact_a[rows])
                worst = max(worst, np.abs(torque - track.exact_torque[rows] + track.exact_friction[rows]).max())
            ratio = residual(log, model)
            print(f"{name:7s} {str(log.setup['known_friction']):8s} {worst:12.3g} {np.sqrt(ratio.max()):24.3g}", flush=True)


def residual(log, model: Pinocchio, parameters: dict | None = None) -> np.ndarray:
    """Mean square of the torque misfit over the noise variance, per joint.

    With `parameters` (those of truth.json) the effect is undone first, by formulas of its definition.
    """
    p, name, n = parameters, log.drawn.name, len(log.size.rms)
    joints = log.drawn.joints
    coulomb = np.array([f.coulomb for f in log.base.friction])
    viscous = np.array([f.viscous for f in log.base.friction])
    total, count, start = np.zeros(n), np.zeros(n), 0.0
    noise = np.array(log.torque_noise)
    for track in log.tracks:
        inner = slice(60, -60, 4)
        q, v, torque = track.measured_q.copy(), track.measured_v.copy(), track.measured_torque.copy()
        if log.setup["servo"]:
            stiffness, damping = np.array(log.servo[0]), np.array(log.servo[1])
            command = track.command
            if p and name == "servo_gain":
                stiffness[joints[0]] *= p["stiffness_factor"]
            if p and name == "command_delay":
                late = int(round(p["delay_secs"] / TICK_SECS))
                command = np.concatenate([np.repeat(command[:1], late, axis=0), command])[: len(command)]
            torque = stiffness * (command - q) - damping * v
        if p and name == "encoder_offset":
            q[:, joints[0]] -= p["offset_rad"]
        if p and name == "encoder_eccentricity":
            seen, true = q[:, joints[0]].copy(), q[:, joints[0]].copy()
            for _ in range(30):
                true = seen - p["amplitude_rad"] * np.sin(true + p["phase_rad"])
            q[:, joints[0]] = true
            v[:, joints[0]] /= 1.0 + p["amplitude_rad"] * np.cos(true + p["phase_rad"])
        a = np.gradient(v, TICK_SECS, axis=0)
        if p and name == "torque_gain":
            torque[:, joints[0]] /= p["gain"]
        if p and name == "torque_offset":
            torque[:, joints[0]] -= p["offset_nm"]
        if p and name == "torque_drift":
            torque[:, joints[0]] -= p["drift_over_log_nm"] * track.secs / log.log_secs
        if p and name == "torque_delay":
            index = np.arange(len(torque), dtype=float)
            torque = np.stack([np.interp(index + p["delay_secs"] / TICK_SECS, index, c) for c in torque.T], axis=1)
        q, v, a, torque, secs = q[inner], v[inner], a[inner], torque[inner], track.secs[inner]
        if p and name == "gravity_compensation":
            torque = torque + p["share"] * model.rows(q, 0 * q, 0 * q)
        if p and name == "torque_saturation":
            torque = np.clip(torque, *(s * np.where(np.arange(n) == joints[0], p["limit_nm"], np.inf) for s in (-1, 1)))
        if p and name == "torque_ripple":
            torque[:, joints[0]] += p["amplitude_nm"] * np.sin(p["cycles"] * q[:, joints[0]] + p["phase_rad"])
        if p and name == "outside:dying_motor":
            for low, high in p["intervals_secs"]:
                torque[(secs >= low) & (secs < high), joints[0]] *= p["remaining_share"]
        if p and name in ("joint_elasticity", "backlash"):  # the link is where the simulation says it is
            moved = track.measured_q + track.deflection
            rate = np.gradient(moved, TICK_SECS, axis=0)
            needed = model.rows(moved[inner], rate[inner], np.gradient(rate, TICK_SECS, axis=0)[inner])
            needed[:, joints[0]] += p["rotor_inertia_kgm2"] * a[:, joints[0]]
        else:
            needed = model.rows(q, v, a)
        if p and name == "reflected_inertia":
            needed[:, joints[0]] += p["inertia_kgm2"] * a[:, joints[0]]
        friction = viscous * v + coulomb * np.sign(v)
        rest = coulomb > 0.0
        if p and name in effects.FRICTION and name != "presliding":
            for k, i in enumerate(joints):
                rest[i] = True
                level = p["coulomb_nm"][k]
                speed, load = v[:, i], needed[:, i]
                if name == "stribeck_friction":
                    level = level + p["peak_nm"][k] * np.exp(-((speed / p["stribeck_rps"][k]) ** 2))
                if name == "load_friction":
                    level = level + p["load_share"][k] * np.abs(load)
                if name == "directional_friction":
                    level = level + np.where(load * speed > 0, p["driving_share"][k], p["driven_share"][k]) * np.abs(load)
                scale = 1.0
                if name == "drifting_friction":
                    tau = p["time_constant_secs"][k]
                    scale = 1.0 + p["relative_change"][k] * (1 - np.exp(-secs / tau)) / (1 - np.exp(-log.log_secs / tau))
                friction[:, i] = scale * (level * np.sign(speed) + p["viscous_nmsprad"][k] * speed)
        if p and name == "presliding":
            for k, i in enumerate(joints):
                z, limit = 0.0, p["bristle_rad"][k]
                zs = np.zeros(len(track.measured_v))
                for row, speed in enumerate(track.measured_v[:, i]):
                    fade = np.exp(-abs(speed) * TICK_SECS / limit)
                    z = z * fade + np.sign(speed) * limit * (1.0 - fade)
                    zs[row] = z
                friction[:, i] = p["coulomb_nm"][k] * zs[inner] / limit + (
                    p["bristle_damping_nmsprad"][k] * np.gradient(zs, TICK_SECS)[inner] + p["viscous_nmsprad"][k] * v[:, i])
        used = ~rest | (np.abs(v) > 0.01)
        total += np.where(used, (torque - needed - friction) ** 2, 0.0).sum(axis=0)
        count += used.sum(axis=0)
    return total / np.maximum(count, 1.0) / noise**2


def closure(engine, only: str | None) -> None:
    """Per effect: misfit over noise without the effect, and with it as stated in the truth; worst joint of each."""
    print("effect                  arm    joints      without      with   tracking rms rad  attempts")
    for number, name in enumerate(effects.INSIDE + ["outside:dying_motor"]):
        if only and only != name:
            continue
        for index in range(300 + 2 * number, 302 + 2 * number):
            log = arm_logs.simulate_log(engine, 7, index, name, None)
            p = log.drawn.parameters
            model, other = true_model(log), true_model(log)
            if name == "payload":
                other = true_model(log, (p["mass_kg"], p["com_in_tip_m"], p["inertia_kgm2"]))
            if name == "base_tilt":
                other = true_model(log, None, p["gravity_in_base_mps2"])
            error = np.sqrt(np.mean(np.concatenate([(t.measured_q - t.command) ** 2 for t in log.tracks])))
            print(f"{name:23s} {log.setup['arm']:6s} {log.drawn.joints!s:12s} {residual(log, model).max():9.3g} "
                  f"{residual(log, other, p).max():9.3g}  {error:8.4f} {log.attempts} "
                  f"{'servo' if log.setup['servo'] else ''}", flush=True)


def engines() -> None:
    """The same scenarios in both engines: largest differences of positions, rms difference of torques over noise."""
    for number, name in enumerate(["none", "none"] + effects.INSIDE + effects.OUTSIDE):
        a, b = (arm_logs.simulate_log(arm_logs.engine_of(e), 9, number, name, None) for e in ("mujoco", "drake"))
        q = max(np.abs(x.q - y.q).max() for x, y in zip(a.tracks, b.tracks))
        u = np.concatenate([x.measured_torque - y.measured_torque for x, y in zip(a.tracks, b.tracks)])
        if a.attempts != b.attempts:
            print(f"{name}: different attempts")
            continue
        print(f"{name:24s} {a.setup['arm']:6s} {a.setup['controller']:16s} |dq| max {q:9.3g} rad, torque rms difference / "
              f"noise {(np.sqrt((u**2).mean(axis=0)) / a.torque_noise).max():9.3g}", flush=True)


def folder(path: str) -> None:
    """Read every log of a folder back."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    with open(os.path.join(path, "truth.json"), encoding="utf-8") as file:
        truth = json.load(file)
    worst, rng = 0.0, np.random.default_rng(0)
    for name, entry in truth.items():
        where = os.path.join(path, name)
        with open(os.path.join(where, "log.toml"), "rb") as file:
            log = tomllib.load(file)
        with open(os.path.join(where, "samples.csv"), encoding="ascii") as file:
            header = next(csv.reader(file))
        table = np.loadtxt(os.path.join(where, "samples.csv"), delimiter=",", skiprows=1)
        n = len(log["joints"])
        assert table.shape[1] == len(header) and np.isfinite(table).all(), name
        assert ("joint_torque_0_nm" in header) != ("servo" in log), name
        for episode in np.unique(table[:, 0]):
            secs = table[table[:, 0] == episode, 1]
            assert secs[0] == 0.0 and np.allclose(np.diff(secs), log["period_secs"], atol=1e-6), name
        model = Pinocchio(os.path.join(where, "robot.urdf"))
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(os.path.join(where, "robot.urdf"))
        base = arm_models.load_arm(entry["arm"]).base
        if base != "world":
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base))
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -log["gravity_mps2"]])
        plant.Finalize()
        assert list(model.model.names)[1:] == log["joints"], name
        context, (q, v, a) = plant.CreateDefaultContext(), rng.normal(size=(3, n))
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        # the damping of the URDF is part of Drake's plant, not of Pinocchio's inverse dynamics
        torque = plant.CalcMassMatrix(context) @ a + plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        worst = max(worst, np.abs(torque - model.inverse(q, v, a)).max())
        assert plant.GetFrameByName(log["tip_link"]) is not None
    print(f"{len(truth)} logs read; nominal URDFs: Drake's parser and Pinocchio's agree to {worst:.2g} N m")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=["exact", "closure", "engines", "folder"])
    parser.add_argument("path", nargs="?", help="folder, or the only effect to check")
    parser.add_argument("--engine", choices=["mujoco", "drake"], default="mujoco")
    options = parser.parse_args()
    if options.what == "engines":
        engines()
    elif options.what == "folder":
        folder(options.path)
    elif options.what == "exact":
        exact(arm_logs.engine_of(options.engine))
    else:
        closure(arm_logs.engine_of(options.engine), options.path)
