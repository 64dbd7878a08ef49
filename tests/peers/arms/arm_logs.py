"""Make simulated joint logs of robot arms, with a known effect that the nominal URDF lacks (or none).

    python arm_logs.py --engine mujoco --out DIR --seed 1 --logs 40 [--first K] [--effect NAME] [--arm NAME]

Each log is a folder DIR/NNNN with log.toml, samples.csv and robot.urdf; the truth goes to DIR/truth.json.  A log depends
on the seed and its index alone, so both engines simulate the same scenarios.  Logs that truth.json has are skipped.
All units are SI and radians.
"""

from __future__ import annotations

import argparse
import copy
import os
import time
from types import SimpleNamespace

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402

import arm_models  # noqa: E402
import effects  # noqa: E402
from common import log_uniform, read_truth, write_truth  # noqa: E402
from engine_mujoco import MujocoEngine, RigidModel  # noqa: E402
from motions import draw_motion  # noqa: E402
from scene import Friction, Scene  # noqa: E402
from simulate import Control, misfit, run_log  # noqa: E402

GRAVITY = 9.81
STREAMS = {"setup": 0, "nominal": 1, "motion": 2, "effect": 3, "readings": 4, "rig": 5}


def stream(seed: int, index: int, name: str, attempt: int = 0) -> np.random.Generator:
    """A generator of its own for each part of a log, so that an override of one part leaves the others alone."""
    return np.random.default_rng([seed, index, STREAMS[name], attempt])


def draw_setup(seed: int, index: int, effect: str | None, arm_name: str | None) -> dict:
    """What kind of log it is: arm, effect, motion, controller, columns, noise."""
    rng = stream(seed, index, "setup")
    names = list(arm_models.CATALOGUE)
    arm_drawn, kind = names[rng.integers(len(names))], rng.random()
    inside, outside = effects.INSIDE[rng.integers(len(effects.INSIDE))], effects.OUTSIDE[rng.integers(3)]
    drawn = "none" if kind < 0.4 else outside if kind < 0.5 else inside
    s = {
        "arm": arm_name or arm_drawn,
        "effect": effect or drawn,
        "motion": ["excitation", "pick_place"][rng.integers(2)],
        "controller": ["computed_torque", "gravity"][rng.integers(2)],
        "rate_hz": int([100, 250, 500, 1000][rng.integers(4)]),
        "known_friction": bool(rng.random() < 0.5),
        "servo": bool(rng.random() < 0.2),
        "velocity_columns": bool(rng.random() < 2 / 3),
        "command_columns": bool(rng.random() < 2 / 3),
        "noise_stated": bool(rng.random() < 0.5),
        "position_noise_rad": log_uniform(rng, 1e-5, 3e-4),
        "velocity_noise_rps": log_uniform(rng, 1e-3, 1e-2),
        "torque_noise_share": log_uniform(rng, 0.003, 0.02),
        "encoder_step_rad": float(2.0 * np.pi / 2.0 ** rng.integers(15, 21)) * float(rng.random() < 0.25),
        "frequency_share": rng.uniform(0.7, 1.3),
        "damping_ratio": rng.uniform(0.7, 1.0),
    }
    if s["effect"] in effects.SERVO:
        s["servo"] = True
    if s["effect"] in effects.TORQUE_COLUMN:
        s["servo"] = False
    if s["servo"]:
        s["command_columns"], s["controller"] = True, "servo"
    return s


def base_scene(arm: arm_models.Arm) -> Scene:
    """The arm as a rigid frictionless chain with its true masses."""
    bodies, rotation, position = arm_models.chain(arm)
    return Scene(bodies, rotation, position, np.array([0.0, 0.0, -GRAVITY]), [Friction() for _ in bodies],
                 np.zeros(len(bodies)))


def gains(setup: dict, arm: arm_models.Arm, size: effects.Sizes) -> tuple[np.ndarray, np.ndarray]:
    """PD gains: 10 mrad of sag at half the rms torque, where inertia and the sampling at 1 kHz permit that."""
    effort = np.array([j.effort for j in arm.moving])
    mean, least = size.effective_mean, size.effective
    stiffness = np.clip((0.5 * size.rms + 0.002 * effort) / 0.01, 20.0**2 * mean, 200.0**2 * mean)
    stiffness = np.minimum(stiffness * setup["frequency_share"] ** 2, 250.0**2 * least)
    return stiffness, np.minimum(2.0 * setup["damping_ratio"] * np.sqrt(stiffness * mean), 700.0 * least)


def bare_setup(setup: dict, rng: np.random.Generator) -> None:
    """A rig of which only the maker's file is known: torques are read, and half of the arms carry a load that the file lacks."""
    setup |= {"effect": "payload" if rng.random() < 0.5 else "none", "servo": False, "known_friction": False}
    if setup["controller"] == "servo":
        setup["controller"] = "gravity"


def bare_arm(scene: Scene, size: effects.Sizes, rng: np.random.Generator) -> np.ndarray:
    """What makers' files leave out, in all joints: friction with the Stribeck effect in half, with load in half, and motors.
    Returns the factors by which torques are read too large."""
    for i in range(len(scene.bodies)):
        coulomb, viscous = effects.draw_friction(size, i, rng, 0.05, 0.3)
        law = Friction(coulomb, viscous)
        if rng.random() < 0.5:
            law.peak, law.stribeck_rps = rng.uniform(0.3, 1.0) * coulomb, log_uniform(rng, 0.02, 0.2)
        if rng.random() < 0.5:
            law.load = law.load_back = log_uniform(rng, 0.02, 0.1)
        scene.friction[i] = law
        scene.armature[i] = log_uniform(rng, 0.2, 1.5) * size.inertia[i]
    return 1.0 + rng.uniform(-0.05, 0.05, len(scene.bodies))


def simulate_log(engine_class, seed: int, index: int, effect: str | None, arm_name: str | None,
                 bare: bool = False) -> SimpleNamespace:
    """Draw and simulate one log; everything about it, without noise."""
    setup = draw_setup(seed, index, effect, arm_name)
    rig = stream(seed, index, "rig")
    if bare:
        bare_setup(setup, rig)
    arm = arm_models.load_arm(setup["arm"])
    nominal_rng = stream(seed, index, "nominal")
    nominal = arm_models.perturbed(arm, nominal_rng, 0.15, 0.015) if bare else arm_models.perturbed(arm, nominal_rng)
    base = base_scene(arm)
    n = len(base.bodies)
    motion = draw_motion(arm, setup["motion"], stream(seed, index, "motion"))
    log_secs = sum(len(e.q) - 1 for e in motion) * 0.001
    rows = [np.concatenate([getattr(e, k)[::10] for e in motion]) for k in "qva"]
    size = effects.sizes_of(RigidModel(base), *rows, log_secs)
    stiffness, damping = gains(setup, arm, size)
    torque_noise = np.maximum(setup["torque_noise_share"] * size.rms, 0.01)
    if setup["servo"]:  # noise of the torque that the PD law gives for noisy positions and velocities
        torque_noise = np.hypot(stiffness * setup["position_noise_rad"], damping * setup["velocity_noise_rps"])
    size.noise = torque_noise
    known = [effects.draw_friction(size, i, nominal_rng, 0.02, 0.08) for i in range(n)]
    known = [Friction(*pair) if setup["known_friction"] else Friction() for pair in known]
    state = rig.bit_generator.state

    for attempt in range(20):
        base.friction = copy.deepcopy(known)
        drawn = effects.draw_effect(setup["effect"], arm, base, size, stream(seed, index, "effect", attempt), attempt)
        for i in drawn.missing:
            base.friction[i] = Friction()
        for i, pair in drawn.in_urdf.items():
            base.friction[i] = Friction(*pair)
        if bare:
            rig.bit_generator.state = state
            for joint, gain in enumerate(bare_arm(drawn.scene, size, rig)):
                drawn.sensing.torque_gain[joint] = gain
        factor = np.ones(n)
        for i in drawn.scene.elastic:  # slower loops where a spring or a gap is in them
            factor[i] = min(1.0, 25.0 / np.sqrt(stiffness[i] / size.effective_mean[i]))
        control = Control(setup["controller"], stiffness * factor**2 * drawn.servo_factor, damping * factor,
                          RigidModel(base_scene(nominal)))
        try:
            tracks = run_log(engine_class, drawn.scene, control, drawn.sensing, motion)
            break
        except FloatingPointError:
            continue
    else:
        raise RuntimeError(f"log {index}: {setup['effect']} diverged in 20 draws")

    for i, elastic in drawn.scene.elastic.items():  # the log says what the motor's own inertia is
        base.armature[i] = elastic.rotor_inertia
    servo = (stiffness * factor**2, damping * factor) if setup["servo"] else (None, None)
    if setup["servo"]:
        torque_noise = np.hypot(servo[0] * setup["position_noise_rad"], servo[1] * setup["velocity_noise_rps"])
    for i, joint in enumerate(nominal.moving):
        error = 1.0 + nominal_rng.uniform(-0.1, 0.1, 2)
        joint.friction, joint.damping = base.friction[i].coulomb * error[0], base.friction[i].viscous * error[1]
    return SimpleNamespace(setup=setup, arm=arm, nominal=nominal, base=base, motion=motion, log_secs=log_secs, size=size,
                           torque_noise=torque_noise, drawn=drawn, tracks=tracks, servo=servo, attempts=attempt + 1)


def make_log(engine_class, folder: str, seed: int, index: int, effect: str | None, arm_name: str | None,
             bare: bool = False) -> dict:
    """Simulate and write one log, return its entry of truth.json."""
    log = simulate_log(engine_class, seed, index, effect, arm_name, bare)
    setup, drawn = log.setup, log.drawn
    ratio = misfit(log.tracks, log.base, *log.servo) / log.torque_noise**2
    shown = list(range(len(ratio))) if drawn.whole_arm or not drawn.joints else drawn.joints
    write_log(folder, setup, log.nominal, log.tracks, log.torque_noise, log.servo, log.base.armature,
              stream(seed, index, "readings"))
    error = np.concatenate([t.measured_q - t.command for t in log.tracks])
    short = lambda values: [float(f"{x:.4g}") for x in values]
    entry = {"effect": drawn.name, "joints": drawn.joints, "parameters": drawn.parameters, "engine": engine_class.name,
             "arm": setup["arm"], "motion": setup["motion"], "visible": float(np.mean(ratio[shown])),
             "visible_per_joint": short(ratio), "joint_torque_rms_nm": short(log.size.rms),
             "torque_noise_nm": short(log.torque_noise), "joint_inertia_kgm2": short(log.size.inertia),
             "true_coulomb_nm": short(f.coulomb for f in log.base.friction),
             "true_viscous_nmsprad": short(f.viscous for f in log.base.friction),
             "tracking_rms_rad": float(np.sqrt((error**2).mean())), "attempts": log.attempts,
             "episodes": len(log.motion), "seconds": log.log_secs}
    entry |= {k: setup[k] for k in ("controller", "rate_hz", "known_friction", "servo", "velocity_columns",
                                    "command_columns", "noise_stated", "position_noise_rad", "velocity_noise_rps",
                                    "encoder_step_rad")}
    if bare:
        laws = drawn.scene.friction
        entry |= {"rig": "bare", "coulomb_nm": short(f.coulomb for f in laws), "viscous_nmsprad": short(f.viscous for f in laws),
                  "peak_nm": short(f.peak for f in laws), "load_share": short(f.load for f in laws),
                  "reflected_inertia_kgm2": short(drawn.scene.armature),
                  "torque_gain": short(drawn.sensing.torque_gain[i] for i in range(len(laws)))}
    return entry


def write_log(folder: str, setup: dict, nominal: arm_models.Arm, tracks: list, torque_noise: np.ndarray,
              servo: tuple, armature: np.ndarray, rng: np.random.Generator) -> None:
    """Add noise to the clean readings, sample them at the log's rate and write the three files."""
    os.makedirs(folder, exist_ok=True)
    arm_models.write_urdf(nominal, os.path.join(folder, "robot.urdf"))
    n, stride = len(nominal.moving), 1000 // setup["rate_hz"]
    velocity, torque = setup["velocity_columns"], not setup["servo"]
    names = ["episode", "time_secs"] + [f"joint_{i}_rad" for i in range(n)]
    formats = ["%d", "%.4f"] + ["%.7f"] * n
    if velocity:
        names, formats = names + [f"joint_{i}_rps" for i in range(n)], formats + ["%.6f"] * n
    if torque:
        names, formats = names + [f"joint_torque_{i}_nm" for i in range(n)], formats + ["%.5f"] * n
    if setup["command_columns"]:
        names, formats = names + [f"command_joint_{i}_rad" for i in range(n)], formats + ["%.7f"] * n
    line = ",".join(formats) + "\n"
    with open(os.path.join(folder, "samples.csv"), "w", encoding="ascii") as file:
        file.write(",".join(names) + "\n")
        for number, track in enumerate(tracks):
            q = track.measured_q[::stride]
            q = q + rng.normal(size=q.shape) * setup["position_noise_rad"]
            if setup["encoder_step_rad"]:
                q = np.round(q / setup["encoder_step_rad"]) * setup["encoder_step_rad"]
            columns = [np.full((len(q), 1), number), np.arange(len(q))[:, None] / setup["rate_hz"], q]
            v, u = track.measured_v[::stride], track.measured_torque[::stride]
            v_noise, u_noise = rng.normal(size=(2,) + q.shape)
            if velocity:
                columns.append(v + v_noise * setup["velocity_noise_rps"])
            if torque:
                columns.append(u + u_noise * torque_noise)
            if setup["command_columns"]:
                columns.append(track.command[::stride])
            table = np.concatenate(columns, axis=1)
            if not np.isfinite(table).all():
                raise FloatingPointError("a reading is not finite")
            file.writelines(line % tuple(row) for row in table.tolist())

    def numbers(values) -> str:
        return "[" + ", ".join(f"{v:.6g}" if "." in f"{v:.6g}" or "e" in f"{v:.6g}" else f"{v:.1f}" for v in values) + "]"

    text = ["version = 1", 'robot = "robot.urdf"',
            "joints = [" + ", ".join(f'"{j.name}"' for j in nominal.moving) + "]",
            f'tip_link = "{nominal.tip}"', f"period_secs = {1.0 / setup['rate_hz']:g}", f"gravity_mps2 = {GRAVITY}"]
    if setup["noise_stated"]:
        position = np.hypot(setup["position_noise_rad"], setup["encoder_step_rad"] / np.sqrt(12.0))
        text += ["", "[noise]", f"joint_position_rad = {position:.4g}"]
        if velocity:
            text.append(f"joint_velocity_rps = {setup['velocity_noise_rps']:.4g}")
        if torque:
            text.append(f"joint_torque_nm = {numbers(torque_noise)}")
    if setup["servo"]:
        error = 1.0 + rng.uniform(-0.1, 0.1, (2, n))
        text += ["", "[servo]", f"stiffness_nmprad = {numbers(servo[0] * error[0])}",
                 f"damping_nmsprad = {numbers(servo[1] * error[1])}"]
    if armature.any():
        text += ["", "[gear]", f"reflected_inertia_kgm2 = {numbers(armature * (1.0 + rng.uniform(-0.1, 0.1, n)))}"]
    with open(os.path.join(folder, "log.toml"), "w", encoding="utf-8") as file:
        file.write("\n".join(text) + "\n")


def engine_of(name: str):
    if name == "mujoco":
        return MujocoEngine
    from engine_drake import DrakeEngine
    return DrakeEngine


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", choices=["mujoco", "drake"], default="mujoco")
    parser.add_argument("--out", required=True, help="folder for the logs and truth.json")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--logs", type=int, default=10, help="how many logs")
    parser.add_argument("--first", type=int, default=0, help="index of the first log")
    parser.add_argument("--effect", choices=["none"] + effects.INSIDE + effects.OUTSIDE, help="this effect in all logs")
    parser.add_argument("--rig", choices=["usual", "bare"], default="usual",
                        help="bare: real joints, of which the file says nothing, with a payload in half of the logs")
    parser.add_argument("--arm", choices=list(arm_models.CATALOGUE), help="this arm in all logs")
    options = parser.parse_args()
    engine_class = engine_of(options.engine)
    truth = read_truth(options.out)
    for index in range(options.first, options.first + options.logs):
        name = f"{index:04d}"
        folder = os.path.join(options.out, name)
        if name in truth and os.path.exists(os.path.join(folder, "samples.csv")):
            continue
        started = time.perf_counter()
        try:
            entry = make_log(engine_class, folder, options.seed, index, options.effect, options.arm,
                             options.rig == "bare")
        except RuntimeError as error:
            print(f"{name} left out: {error}", flush=True)
            continue
        truth[name] = copy.deepcopy(entry)
        write_truth(options.out, truth)
        print(f"{name} {entry['arm']:6s} {entry['effect']:22s} {entry['joints']!s:10s} {entry['motion']:10s} "
              f"{entry['controller']:15s} visible {entry['visible']:10.3g} error {entry['tracking_rms_rad']:.4f} rad "
              f"tries {entry['attempts']} {time.perf_counter() - started:.1f} s", flush=True)


if __name__ == "__main__":
    main()
