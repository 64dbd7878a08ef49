"""The effects: each changes a scene, the sensing or the servo, and states its true parameters."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field

import numpy as np

from arm_models import Arm, merge
from common import log_uniform
from engine_mujoco import RigidModel
from scene import Cable, Elastic, Friction, Scene, Table
from simulate import Sensing

FRICTION = ["joint_friction", "stribeck_friction", "load_friction", "directional_friction", "drifting_friction",
            "presliding"]
TORQUE_COLUMN = ["torque_gain", "torque_offset", "torque_drift", "torque_delay", "gravity_compensation"]
SERVO = ["servo_gain", "command_delay"]
INSIDE = FRICTION + ["reflected_inertia", "torque_ripple", "torque_saturation", "encoder_offset",
                     "encoder_eccentricity", "joint_elasticity", "backlash", "payload",
                     "base_tilt"] + TORQUE_COLUMN + SERVO
OUTSIDE = ["outside:cable", "outside:wobbling_table", "outside:dying_motor"]


@dataclass
class Sizes:
    """How large things are on the reference motion of a log, per joint (computed with the true rigid model)."""

    q: np.ndarray  # reference rows, every 10 ms
    v: np.ndarray
    a: np.ndarray
    torque: np.ndarray
    noise: np.ndarray  # standard deviation of the torque noise, N m
    log_secs: float
    inertia: np.ndarray = None  # mean diagonal of the mass matrix
    effective: np.ndarray = None  # smallest inertia with the other joints free
    effective_mean: np.ndarray = None
    rms: np.ndarray = None  # of the torque
    v_rms: np.ndarray = None
    a_rms: np.ndarray = None


@dataclass
class Drawn:
    """An effect as drawn.  `joints` is empty where the effect belongs to the whole arm."""

    name: str
    joints: list[int]
    parameters: dict
    scene: Scene
    sensing: Sensing
    servo_factor: np.ndarray  # true stiffness over the stated one
    in_urdf: dict[int, tuple[float, float]] = field(default_factory=dict)  # friction of affected joints: Coulomb, viscous
    missing: set[int] = field(default_factory=set)  # joints whose friction the URDF lacks
    whole_arm: bool = False  # the misfit shows on all joints


def sizes_of(model: RigidModel, q, v, a, log_secs: float) -> Sizes:
    torque = model.inverse_rows(q, v, a)
    masses = np.array([model.mass_matrix(row) for row in q[::20]])
    size = Sizes(q, v, a, torque, None, log_secs)
    size.inertia = np.array([np.diag(m) for m in masses]).mean(axis=0)
    effective = np.array([1.0 / np.diag(np.linalg.inv(m)) for m in masses])
    size.effective, size.effective_mean = effective.min(axis=0), effective.mean(axis=0)
    size.rms, size.v_rms, size.a_rms = (np.sqrt((x**2).mean(axis=0)) for x in (torque, v, a))
    return size


def draw_friction(size: Sizes, i: int, rng: np.random.Generator, low=0.02, high=0.15) -> tuple[float, float]:
    """Coulomb friction as a share of the rms torque, and viscous friction of like size at the rms velocity."""
    coulomb = log_uniform(rng, low, high) * max(size.rms[i], 0.05)
    return coulomb, coulomb * log_uniform(rng, 0.5, 1.5) / max(size.v_rms[i], 0.05)


def _pick(magnitude: np.ndarray, size: Sizes, rng: np.random.Generator) -> int:
    """One joint of those where a change of torque of this magnitude [N m] exceeds twice the noise."""
    candidates = np.flatnonzero(magnitude > 2.0 * size.noise)
    draw = rng.random()
    return int(candidates[int(draw * len(candidates))]) if len(candidates) else int(np.argmax(magnitude / size.noise))


def _pick_several(magnitude: np.ndarray, size: Sizes, rng: np.random.Generator) -> list[int]:
    """One joint (60 %), or two up to all that matter."""
    candidates = np.flatnonzero(magnitude > 2.0 * size.noise)
    if len(candidates) < 2 or rng.random() < 0.6:
        return [_pick(magnitude, size, rng)]
    return sorted(int(i) for i in rng.permutation(candidates)[: rng.integers(2, len(candidates) + 1)])


def draw_effect(name: str, arm: Arm, base: Scene, size: Sizes, rng: np.random.Generator, attempt: int = 0) -> Drawn:
    """Draw the parameters of an effect and put it into a copy of the scene.  Later attempts saturate less."""
    n = len(base.bodies)
    scene = copy.deepcopy(base)
    drawn = Drawn(name, [], {}, scene, Sensing(n), np.ones(n))
    p = drawn.parameters
    rms = size.rms
    if name in FRICTION:
        _draw_friction_effect(drawn, size, rng)
    elif name == "reflected_inertia":
        i = _pick(0.3 * size.inertia * size.a_rms, size, rng)
        p["inertia_kgm2"] = log_uniform(rng, 0.1, 1.0) * size.inertia[i]
        scene.armature[i] = p["inertia_kgm2"]
        drawn.joints = [i]
    elif name == "torque_ripple":
        i = _pick(0.03 * rms, size, rng)
        p |= dict(amplitude_nm=log_uniform(rng, 0.02, 0.1) * rms[i], cycles=int(round(log_uniform(rng, 1, 100))),
                  phase_rad=rng.uniform(-np.pi, np.pi))
        scene.ripple[i] = (p["amplitude_nm"], p["cycles"], p["phase_rad"])
        drawn.joints = [i]
    elif name == "torque_gain":
        i = _pick(0.2 * rms, size, rng)
        p["gain"] = rng.uniform(1.15, 1.5) if rng.random() < 0.5 else rng.uniform(0.6, 0.87)
        drawn.sensing.torque_gain[i] = p["gain"]
        drawn.joints = [i]
    elif name in ("torque_offset", "torque_drift"):
        i = _pick(0.06 * rms, size, rng)
        value = log_uniform(rng, 0.03, 0.2) * rms[i] * rng.choice([-1.0, 1.0])
        p["offset_nm" if name == "torque_offset" else "drift_over_log_nm"] = value
        getattr(drawn.sensing, name)[i] = value
        drawn.joints = [i]
    elif name == "torque_delay":
        p["delay_secs"] = drawn.sensing.torque_delay_secs = log_uniform(rng, 0.004, 0.040)
        drawn.whole_arm = True
    elif name == "gravity_compensation":
        p["share"] = drawn.sensing.gravity_share = rng.uniform(0.2, 1.0)
        drawn.whole_arm = True
    elif name == "torque_saturation":
        i = _pick(0.1 * rms, size, rng)
        quantile = 1.0 - rng.uniform(0.01, 0.15) * 0.6**attempt
        p["limit_nm"] = float(np.quantile(np.abs(size.torque[:, i]), quantile))
        scene.clip[i] = p["limit_nm"]
        drawn.joints = [i]
    elif name == "encoder_offset":
        amount = log_uniform(rng, 0.01, 0.1)
        i = _pick_sensitive(base, size, lambda q: amount + 0.0 * q, rng)
        p["offset_rad"] = amount * float(rng.choice([-1.0, 1.0]))
        drawn.sensing.encoder_offset[i] = p["offset_rad"]
        drawn.joints, drawn.whole_arm = [i], True
    elif name == "encoder_eccentricity":
        p |= dict(amplitude_rad=log_uniform(rng, 0.005, 0.05), phase_rad=rng.uniform(-np.pi, np.pi))
        i = _pick_sensitive(base, size, lambda q: p["amplitude_rad"] * np.sin(q + p["phase_rad"]), rng)
        drawn.sensing.eccentricity[i] = (p["amplitude_rad"], p["phase_rad"])
        drawn.joints, drawn.whole_arm = [i], True
    elif name in ("joint_elasticity", "backlash"):
        _draw_elastic(drawn, size, rng)
    elif name == "payload":
        _draw_payload(drawn, arm, rng)
    elif name == "base_tilt":
        angle, azimuth = np.radians(log_uniform(rng, 1.0, 5.0)), rng.uniform(-np.pi, np.pi)
        p |= dict(tilt_rad=angle, direction_rad=azimuth)
        g = np.linalg.norm(base.gravity)
        scene.gravity = g * np.array([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), -np.cos(angle)])
        p["gravity_in_base_mps2"] = scene.gravity.tolist()
        drawn.whole_arm = True
    elif name == "servo_gain":
        i = _pick(0.2 * rms, size, rng)
        p["stiffness_factor"] = rng.uniform(1.3, 2.0) if rng.random() < 0.5 else rng.uniform(0.5, 0.77)
        drawn.servo_factor[i] = p["stiffness_factor"]
        drawn.joints = [i]
    elif name == "command_delay":
        p["delay_secs"] = drawn.sensing.command_delay_secs = round(log_uniform(rng, 0.008, 0.060), 3)
        drawn.whole_arm = True
    elif name in OUTSIDE:
        _draw_outside(drawn, base, size, rng)
    elif name != "none":
        raise ValueError(f"no effect named {name}")
    return drawn


def _draw_friction_effect(drawn: Drawn, size: Sizes, rng: np.random.Generator) -> None:
    name, p = drawn.name, drawn.parameters
    joints = drawn.joints = _pick_several(0.06 * size.rms, size, rng)
    laws = []
    for i in joints:
        coulomb, viscous = draw_friction(size, i, rng)
        law = Friction(coulomb, viscous)
        if name == "stribeck_friction":
            law.peak, law.stribeck_rps = rng.uniform(0.5, 1.5) * coulomb, log_uniform(rng, 0.02, 0.2)
        elif name in ("load_friction", "directional_friction"):
            coulomb, viscous = draw_friction(size, i, rng, 0.005, 0.03)
            law = Friction(coulomb, viscous)
            if name == "load_friction":
                law.load = law.load_back = log_uniform(rng, 0.03, 0.2)
            else:
                law.load = log_uniform(rng, 0.05, 0.2)
                law.load_back = law.load * (rng.uniform(0.0, 0.5) if rng.random() < 0.7 else rng.uniform(1.6, 2.5))
        elif name == "drifting_friction":
            law.change = rng.uniform(0.3, 0.8) * (-1.0 if rng.random() < 0.75 else 1.0)
            law.change_secs, law.log_secs = size.log_secs * log_uniform(rng, 0.2, 1.5), size.log_secs
            drawn.in_urdf[i] = (coulomb, viscous)
        elif name == "presliding":
            law.bristle_rad = log_uniform(rng, 2e-4, 2e-2)
            # stiffest bristle that the steps of 0.25 ms resolve
            law.bristle_rad = max(law.bristle_rad, coulomb * (0.00025 / 0.3) ** 2 / size.effective[i])
            law.bristle_damping = 0.2 * np.sqrt(coulomb / law.bristle_rad * size.effective[i])
        drawn.scene.friction[i] = law
        if name != "drifting_friction":
            drawn.missing.add(i)
        laws.append(law)
    p |= {"coulomb_nm": [x.coulomb for x in laws], "viscous_nmsprad": [x.viscous for x in laws]}
    extra = {"stribeck_friction": {"peak_nm": "peak", "stribeck_rps": "stribeck_rps"},
             "load_friction": {"load_share": "load"},
             "directional_friction": {"driving_share": "load", "driven_share": "load_back"},
             "drifting_friction": {"relative_change": "change", "time_constant_secs": "change_secs"},
             "presliding": {"bristle_rad": "bristle_rad", "bristle_damping_nmsprad": "bristle_damping"}}
    for key, attribute in extra.get(name, {}).items():
        p[key] = [float(getattr(x, attribute)) for x in laws]


def _pick_sensitive(base: Scene, size: Sizes, error, rng: np.random.Generator) -> int:
    """A joint whose encoder error changes the inverse dynamics of any joint visibly."""
    model = RigidModel(base)
    rows = slice(None, None, 10)
    change = np.zeros(len(base.bodies))
    for i in range(len(change)):
        q = size.q[rows].copy()
        q[:, i] += error(q[:, i])
        difference = model.inverse_rows(q, size.v[rows], size.a[rows]) - size.torque[rows]
        change[i] = (np.sqrt((difference**2).mean(axis=0)) / size.noise).max()
    return _pick(change * size.noise, size, rng)


def _draw_elastic(drawn: Drawn, size: Sizes, rng: np.random.Generator) -> None:
    name, p = drawn.name, drawn.parameters
    # lighter links would need shorter steps; and a spring that yields visibly must not resonate below 3 Hz
    floor = size.inertia * (2.0 * np.pi * 3.0) ** 2
    loaded = (size.rms / 0.03 > floor) if name == "joint_elasticity" else True
    matters = np.where((size.effective > 1e-3) & loaded, size.rms, 0.0)
    i = _pick(0.1 * matters, size, rng)
    rotor = rng.uniform(0.05, 0.15) * size.inertia[i]
    light = size.effective[i] * rotor / (size.effective[i] + rotor)
    if name == "joint_elasticity":
        stiffness = max(size.rms[i] / log_uniform(rng, 0.003, 0.030), floor[i])
        damping = 2.0 * rng.uniform(0.02, 0.1) * np.sqrt(stiffness * size.effective[i])
        gap = 0.0
    else:
        stiffness = min(max(size.rms[i], 0.05) / 0.0007, light * (0.35 / 0.00025) ** 2)  # teeth, limited by the step
        gap = log_uniform(rng, 0.002, 0.020)
        damping = 2.0 * 0.3 * np.sqrt(stiffness * light)
        p["gap_rad"] = gap
    stiffness = min(stiffness, light * (0.5 / 0.00025) ** 2)
    p |= dict(stiffness_nmprad=stiffness, damping_nmsprad=damping, rotor_inertia_kgm2=rotor)
    drawn.scene.elastic[i] = Elastic(stiffness, damping, rotor, gap)
    drawn.joints = [i]


def _draw_payload(drawn: Drawn, arm: Arm, rng: np.random.Generator) -> None:
    scene, p = drawn.scene, drawn.parameters
    mass = log_uniform(rng, 0.2, 1.5) * arm.payload_scale
    com = rng.normal(size=3)
    com *= rng.uniform(0.0, 0.1) / np.linalg.norm(com)
    p |= dict(mass_kg=mass, com_in_tip_m=com.tolist(), inertia_kgm2=0.4 * mass * 0.04**2)
    body = scene.bodies[-1]
    place = scene.tip_position + scene.tip_rotation @ com
    body.mass, body.com, body.inertia = merge([(body.mass, body.com, body.inertia),
                                               (mass, place, p["inertia_kgm2"] * np.eye(3))])
    drawn.whole_arm = True


def _draw_outside(drawn: Drawn, base: Scene, size: Sizes, rng: np.random.Generator) -> None:
    scene, p = drawn.scene, drawn.parameters
    if drawn.name == "outside:cable":
        model = RigidModel(base)
        tips = np.array([model.tip(q) for q in size.q[::5]])
        direction = rng.normal(size=3)
        anchor = tips.mean(axis=0) + direction / np.linalg.norm(direction) * rng.uniform(0.5, 1.2)
        lengths = np.linalg.norm(tips - anchor, axis=1)
        slack = float(np.quantile(lengths, rng.uniform(0.2, 0.7)))
        reach = max(float(np.linalg.norm(tips, axis=1).max()), 0.1)
        pull = log_uniform(rng, 0.1, 0.6) * size.rms.max() / reach  # N, at the farthest point
        stiffness = pull / max(lengths.max() - slack, 0.01)
        scene.cable = Cable(scene.tip_position.copy(), anchor, stiffness, slack, 0.02 * stiffness)
        p |= dict(anchor_m=anchor.tolist(), slack_m=slack, stiffness_npm=stiffness, pull_n=pull)
        drawn.whole_arm = True
    elif drawn.name == "outside:wobbling_table":
        azimuth, moving = rng.uniform(-np.pi, np.pi), sum(b.mass for b in scene.bodies)
        mass, hertz = log_uniform(rng, 0.3, 2.0) * moving, rng.uniform(3.0, 8.0)
        omega, ratio = 2.0 * np.pi * hertz, rng.uniform(0.01, 0.05)
        stiffness, damping = (mass + moving) * omega**2, 2.0 * ratio * (mass + moving) * omega
        # a machine near the resonance, for a base acceleration of 0.1-0.6 m/s^2
        shake = omega * rng.uniform(0.85, 1.15)
        force = log_uniform(rng, 0.1, 0.6) / shake**2 * np.hypot(stiffness - (mass + moving) * shake**2, damping * shake)
        scene.table = Table(np.array([np.cos(azimuth), np.sin(azimuth), 0.0]), mass, stiffness, damping, force, shake)
        p |= dict(shake_n=force, shake_hz=shake / (2.0 * np.pi))
        p |= dict(direction_rad=azimuth, table_mass_kg=mass, frequency_hz=hertz, damping_ratio=ratio)
        drawn.whole_arm = True
    else:
        i = _pick(0.2 * size.rms, size, rng)
        share, intervals, t = rng.uniform(0.3, 0.7), [], rng.uniform(0.5, 3.0)
        while t < size.log_secs:
            length = rng.uniform(0.1, 0.5)
            intervals.append((t, t + length))
            t += length + rng.exponential(2.0) + 0.2
        scene.dying[i] = (np.array(intervals), share)
        p |= dict(remaining_share=share, intervals_secs=[[round(a, 3), round(b, 3)] for a, b in intervals])
        drawn.joints = [i]
