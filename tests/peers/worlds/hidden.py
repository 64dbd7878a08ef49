"""What is hidden in a world: draws of the catalogue's effects (names and keys as in `diagnose --list-effects`), and some that no catalogue has.

Ranges are those of the catalogue for its box of 0.5 kg and 8 cm, carried to other objects: forces in weights, lengths in lengths of the
object, speeds in √(g L). `in_range` in the truth says whether the values still lie in the catalogue's absolute ranges.
"""

import math

import numpy as np

from scene import sign

PLANE, SPACE = 2, 3


def vector(rng, low, high, *names):
    """A vector of drawn length and direction."""
    v = rng.normal(size=len(names))
    v *= rng.uniform(low, high) / np.linalg.norm(v)
    return dict(zip(names, map(float, v)))


def away(rng, low, high):
    """1 ± a draw."""
    return float(1.0 + sign(rng) * rng.uniform(low, high))


def spot(rng, scene):
    """A place in the workspace that pushes cross."""
    at = np.array(scene.centre_m) + rng.uniform(-1.0, 1.0, 2) * scene.length_m
    return float(at[0]), float(at[1])


def patch(rng, s, k):
    x, y = spot(rng, s)
    excess = float(rng.uniform(0.5, 1.0)) * k if rng.random() < 0.7 else float(max(-0.9, -rng.uniform(0.35, 0.6) * k))
    return {"excess": excess, "x_m": x, "y_m": y, "radius_m": float(rng.uniform(0.8, 2.0) * s.length_m)}


def tether(rng, s, k):
    x, y = spot(rng, s)
    return {"stiffness_npm": float(rng.uniform(0.05, 0.3) * k * s.weight_n / s.length_m), "anchor_x_m": x, "anchor_y_m": y}


def obstacle(rng, s, _):
    x, y = spot(rng, s)
    r = float(rng.uniform(0.2, 0.5) * s.length_m)
    return {"shape": "cylinder", "movable": False, "x_m": x, "y_m": y, "yaw_rad": 0.0, "size_0_m": r, "size_1_m": 1.2 * s.length_m}


def level(rng, s, k):
    # Of what log.toml says; the true value is this one.
    factor = 1.0 + rng.uniform(0.35, 0.8) * k if rng.random() < 0.6 else 1.0 / (1.0 + rng.uniform(0.45, 0.9) * k)
    return {"coefficient": float(np.clip(s.stated["friction"][0] * factor, 0.05, 1.2))}


# Of a scene and a factor k that makes an effect stronger where it was too faint to be seen.
DRAWS = {
    "viscous_damping": lambda r, s, k: {"coefficient_nspm": float(r.uniform(0.06, 0.4) * k * s.weight_n / s.speed_mps)},
    "quadratic_drag": lambda r, s, k: {"coefficient_ns2pm2": float(r.uniform(0.15, 0.8) * k * s.weight_n / s.speed_mps ** 2)},
    "friction_level": level,
    "stribeck_friction": lambda r, s, k: {"excess": float(r.uniform(0.3, 1.0) * k), "velocity_mps": float(r.uniform(0.02, 0.11) * s.speed_mps)},
    "static_friction": lambda r, s, k: {"ratio": float(1.0 + r.uniform(0.2, 0.6) * k)},
    "anisotropic_friction": lambda r, s, k: {"amplitude": float(min(0.6, r.uniform(0.15, 0.4) * k)), "axis_rad": float(r.uniform(0, math.pi))},
    "friction_patch": patch,
    "pressure_distribution": lambda r, s, k: {"radius_share": float(r.uniform(0.15, 0.6))},
    "rolling_resistance": lambda r, s, k: {"lever_m": float(r.uniform(0.008, 0.06) * k * s.size_m[0])},
    "table_tilt": lambda r, s, k: vector(r, 0.01 * k, 0.05 * k, "slope_x_rad", "slope_y_rad"),
    "constant_force": lambda r, s, k: vector(r, 0.02 * s.weight_n * k, 0.1 * s.weight_n * k, "force_x_n", "force_y_n"),
    "tether": tether,
    "com_offset": lambda r, s, k: vector(r, 0.1 * k, min(0.25 * k, 0.35), "share_x", "share_y") | {"share_z": 0.0},
    "mass_leak": lambda r, s, k: {"rate_ps": float(r.uniform(0.008, 0.02) * k)},
    "restitution": lambda r, s, k: {"coefficient": float(r.uniform(0.3, 0.75))},
    "contact_compliance": lambda r, s, k: {"frequency_hz": float(r.uniform(15, 40)), "damping_ratio": float(r.uniform(0.5, 1.5))},
    "arm_compliance": lambda r, s, k: {"stiffness_npm": float(s.friction * s.weight_n / (r.uniform(0.03, 0.12) * k * s.length_m))},
    "adhesion": lambda r, s, k: {"pull_off_n": float(r.uniform(0.4, 1.5) * k * s.friction * s.weight_n)},
    "hidden_obstacle": obstacle,
    "wrist_payload": lambda r, s, k: {"mass_kg": float(r.uniform(0.05, 0.5) * k * s.mass_kg)}
    | vector(r, 0.02, 0.06, "com_x_m", "com_y_m", "com_z_m"),
    "force_bias": lambda r, s, k: vector(r, 0.03 * s.weight_n * k, 0.3 * s.weight_n * k, "bias_x_n", "bias_y_n", "bias_z_n"),
    "force_drift": lambda r, s, k: vector(r, 5e-4 * s.weight_n * k, 3e-3 * s.weight_n * k, "drift_x_nps", "drift_y_nps", "drift_z_nps"),
    "force_gain": lambda r, s, k: {"gain": away(r, 0.08, 0.25)},
    "force_low_pass": lambda r, s, k: {"time_constant_secs": float(r.uniform(0.02, 0.08))},
    "force_saturation": lambda r, s, k: {"limit_n": float(r.uniform(0.45, 0.85) * s.friction * s.weight_n)},
    "pose_offset": lambda r, s, k: vector(r, 0.03 * k * s.length_m, 0.2 * k * s.length_m, "offset_x_m", "offset_y_m", "offset_z_m"),
    "pose_delay": lambda r, s, k: {"delay_secs": float(r.uniform(0.015, 0.1))},
    "pose_scale": lambda r, s, k: {"scale": away(r, 0.02, 0.06)},
    "pose_rotation": lambda r, s, k: {"yaw_rad": float(sign(r) * r.uniform(0.02, 0.087))},
    "time_base": lambda r, s, k: {"rate": away(r, 0.02, 0.06)},
    "actuator_gain": lambda r, s, k: {"gain": away(r, 0.04, 0.2)},
    "actuation_delay": lambda r, s, k: {"delay_secs": float(r.uniform(0.015, 0.1))},
}

# Absolute ranges of the catalogue: what `in_range` compares with (the first parameter, or the length of the vector).
RANGES = {
    "viscous_damping": (0.1, 2), "quadratic_drag": (0.1, 4), "friction_level": (0.1, 0.8), "stribeck_friction": (0.2, 1),
    "static_friction": (1.05, 1.6), "anisotropic_friction": (0.1, 0.4), "friction_patch": (-0.6, 1), "pressure_distribution": (0, 0.7),
    "rolling_resistance": (1e-4, 5e-3), "table_tilt": (0, 0.0524), "constant_force": (0.02, 0.5), "tether": (0.5, 20),
    "com_offset": (0, 0.3), "mass_leak": (0.001, 0.02), "restitution": (0, 0.8), "contact_compliance": (20, 200),
    "arm_compliance": (500, 50000), "adhesion": (0.1, 3), "wrist_payload": (0.1, 5), "force_bias": (0.1, 2), "force_drift": (1.7e-4, 1.7e-3),
    "force_gain": (0.75, 1.25), "force_low_pass": (0.005, 0.08), "force_saturation": (1, 50), "pose_offset": (0.001, 0.02),
    "pose_delay": (0.005, 0.1), "pose_scale": (0.94, 1.06), "pose_rotation": (-0.0873, 0.0873), "time_base": (0.94, 1.06),
    "actuator_gain": (0.8, 1.2), "actuation_delay": (0.005, 0.1), "hidden_obstacle": (-1e3, 1e3),
}
VECTORS = {"table_tilt": 2, "constant_force": 2, "com_offset": 2, "force_bias": 3, "force_drift": 3, "pose_offset": 3}

OUTSIDE = {
    "periodic_force": lambda r, s, k: vector(r, 0.05 * s.weight_n * k, 0.25 * s.weight_n * k, "force_x_n", "force_y_n")
    | {"period_secs": float(r.uniform(0.25, 1.2)), "phase_rad": float(r.uniform(0, 2 * math.pi))},
    "magnet": lambda r, s, k: dict(zip(("x_m", "y_m"), spot(r, s))) | {"strength_n": float(r.uniform(0.1, 0.3) * k * s.weight_n)},
    "gust": lambda r, s, k: vector(r, 0.3 * s.weight_n * k, 0.8 * s.weight_n * k, "force_x_n", "force_y_n")
    | {"begin_secs": float(r.uniform(0.2, 0.8)), "length_secs": float(r.uniform(0.1, 0.3))},
    "glue": lambda r, s, k: {"limit_n": float(r.uniform(0.6, 1.5) * k * s.weight_n), "begin_secs": float(r.uniform(0.3, 0.8)), "length_secs": 0.3},
    "sticky_spot": lambda r, s, k: dict(zip(("x_m", "y_m"), spot(r, s)))
    | {"radius_m": float(r.uniform(0.8, 1.5) * s.length_m), "viscosity_nspm": float(r.uniform(0.5, 2.0) * k * s.weight_n / s.speed_mps)},
    "sideways_force": lambda r, s, k: {"coefficient_nspm": float(sign(r) * r.uniform(0.2, 0.6) * k * s.weight_n / s.speed_mps)},
    "tool_radius": lambda r, s, k: {"share": float(1.0 + 0.25 * k)},
    "frozen_camera": lambda r, s, k: {"begin_secs": float(r.uniform(0.2, 0.7)), "length_secs": float(r.uniform(0.2, 0.4) * k)},
}

NEEDS_FORCE = {"wrist_payload", "force_bias", "force_drift", "force_gain", "force_low_pass", "force_saturation"}
NEEDS_COMMAND = {"actuator_gain", "actuation_delay", "arm_compliance"}
NEEDS_TOOL = NEEDS_FORCE | NEEDS_COMMAND | {"adhesion", "tool_radius", "static_friction", "mass_leak"}
NEEDS_TOSS = {"restitution"}
NEEDS_SPHERE = {"rolling_resistance"}
NEEDS_FLAT = {"pressure_distribution", "com_offset", "stribeck_friction", "static_friction", "anisotropic_friction", "friction_patch"}


def possible(name, scene, rig, unsupported=()):
    """Whether such a world and rig could show it at all."""
    if name in unsupported or (name in NEEDS_TOOL and rig.tosses) or (name in NEEDS_TOSS and not rig.tosses):
        return False
    if name in NEEDS_FORCE and "force" not in rig.sensors or name in NEEDS_COMMAND and "command" not in rig.sensors:
        return False
    if name in NEEDS_SPHERE and scene.kind != "sphere" or name in NEEDS_FLAT and scene.kind not in ("box", "upright"):
        return False
    # Where the sole bears hardly matters to what tumbles, but chance then does the rest.
    return not (name == "pressure_distribution" and ("orientation" not in rig.sensors or rig.tosses))


def in_range(name, p):
    low, high = RANGES[name]
    values = [v for v in p.values() if not isinstance(v, (str, bool))]
    size = math.hypot(*values[:VECTORS[name]]) if name in VECTORS else values[0]
    return bool(low <= size <= high)
