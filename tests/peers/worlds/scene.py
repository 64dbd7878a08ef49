"""Draws a scene from a seed: the object, its table, the rig that watches it. Nothing here knows an engine. SI units, radians."""

import math
from dataclasses import dataclass, field

import numpy as np

GRAVITY = 9.81
SHAPES = {"box": 0.5, "upright": 0.2, "lying": 0.12, "sphere": 0.18}  # upright and lying: cylinders


def log_uniform(rng, low, high):
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def sign(rng):
    return 1.0 if rng.random() < 0.5 else -1.0


@dataclass
class Scene:
    """The true world, and what `log.toml` says of it."""

    kind: str  # of SHAPES
    size_m: list  # as in log.toml
    mass_kg: float
    friction: float
    tool_friction: float
    tool_radius_m: float
    centre_m: list  # of the workspace, on the table
    stated: dict  # mass_kg, friction, tool_friction: (mean, stddev or None)

    @property
    def shape(self):
        return "cylinder" if self.kind in ("upright", "lying") else self.kind

    @property
    def rolls(self):
        return self.kind in ("lying", "sphere")

    @property
    def length_m(self):
        """The largest full length of the footprint: what ways and offsets are measured in."""
        return max(2 * v for v in self.footprint)

    @property
    def footprint(self):
        """Half lengths of the rectangle, or the radius of the disc, that it covers."""
        if self.kind == "box":
            return [self.size_m[0] / 2, self.size_m[1] / 2]
        if self.kind == "lying":
            return [self.size_m[0], self.size_m[1] / 2]
        return [self.size_m[0]]

    @property
    def half_height_m(self):
        return {"box": lambda s: s[2] / 2, "upright": lambda s: s[1] / 2}.get(self.kind, lambda s: s[0])(self.size_m)

    @property
    def half_sizes_m(self):
        """Of the box around it, in its own axes."""
        if self.kind == "box":
            return [v / 2 for v in self.size_m]
        if self.kind == "sphere":
            return [self.size_m[0]] * 3
        return [self.size_m[0], self.size_m[0], self.size_m[1] / 2]

    @property
    def weight_n(self):
        return self.mass_kg * GRAVITY

    @property
    def speed_mps(self):
        """√(g L): speeds are drawn as multiples of it."""
        return math.sqrt(GRAVITY * self.length_m)

    def orientation(self, yaw):
        """x, y, z, w of the object at rest. A lying cylinder has its axis along y at yaw 0."""
        c, s = math.cos(yaw / 2), math.sin(yaw / 2)
        if self.kind != "lying":
            return [0.0, 0.0, s, c]
        # Turn about z after −90° about x.
        h = math.sqrt(0.5)
        return [-c * h, -s * h, s * h, c * h]


@dataclass
class Rig:
    """What is measured, how often, how well, and what of that is said."""

    designed: bool
    tosses: bool  # no tool
    sensors: set = field(default_factory=set)  # command, tool, force, torque, orientation, velocity
    period_s: float = 0.01
    straight: bool = True  # the tool goes straight from tick to tick of its controller; else smoothly
    jitter: float = 0.0  # standard deviation, periods
    dropped: float = 0.0  # share of rows
    lost_poses: float = 0.0  # share of rows without the object
    own_rows: bool = False  # object and force on rows of their own
    object_period_s: float = 0.0
    force_period_s: float = 0.0
    force_mean: bool = True  # over the time since the last reading; else as it is at the reading
    skew_s: float = 0.0  # by which object readings are late
    noise: dict = field(default_factory=dict)
    noise_stated: set = field(default_factory=set)
    episodes: int = 24
    long_rests: bool = False


def solid_inertia(shape, size, mass):
    if shape == "box":
        x, y, z = (v * v for v in size)
        return np.diag([y + z, x + z, x + y]) * mass / 12
    if shape == "cylinder":
        r, h = size
        across = mass * (3 * r * r + h * h) / 12
        return np.diag([across, across, mass * r * r / 2])
    return np.eye(3) * 0.4 * mass * size[0] ** 2


def volume_m3(shape, size):
    if shape == "box":
        return size[0] * size[1] * size[2]
    return math.pi * size[0] ** 2 * size[1] if shape == "cylinder" else 4 / 3 * math.pi * size[0] ** 3


@dataclass
class Bodies:
    """Between what bodies are drawn."""

    length_m: tuple = (0.02, 0.5)
    friction: tuple = (0.15, 0.7)
    width: float = 0.45  # least, as a share of the length
    height: float = 0.3  # least, as a share of what does not tip over
    density_kgm3: tuple = (60.0, 3000.0)  # no lighter than foam and no heavier than stone
    mass_kg: tuple = (0.003, 20.0)
    digits: int = 4


def draw_body(rng, kind, bodies=Bodies()):
    """Size, mass and friction that go together."""
    while True:
        length = log_uniform(rng, *bodies.length_m)
        friction = float(rng.uniform(*bodies.friction))
        if kind == "box":
            other = length * rng.uniform(bodies.width, 1.0)
            # Lower than what would tip over when it is pushed.
            high = min(length, 0.8 * other / friction)
            size = [length, other, rng.uniform(bodies.height, 0.9) * high]
        elif kind == "upright":
            radius = length / 2
            size = [radius, rng.uniform(bodies.height, 0.9) * min(2 * length, 0.8 * length / friction)]
        elif kind == "lying":
            size = [length / 2, length * rng.uniform(0.6, 2.0)]
        else:
            size = [length / 2]
        size = [round(float(v), bodies.digits) for v in size]
        shape = "cylinder" if kind in ("upright", "lying") else kind
        mass = volume_m3(shape, size) * log_uniform(rng, *bodies.density_kgm3)
        if bodies.mass_kg[0] <= mass <= bodies.mass_kg[1] and min(size) > 0.005:
            return size, float(mass), friction


def draw_kind(rng, shapes, unsuitable):
    """One of the kinds that the engine can hold."""
    share = np.array([0.0 if kind in unsuitable else p for kind, p in shapes.items()])
    return str(rng.choice(list(shapes), p=share / share.sum()))


def stated(rng, value, exact):
    """What log.toml says of a number: it is wrong by the standard deviation that it states, cut at two of them."""
    if exact:
        return float(f"{value:.5g}"), None
    share = 0.1
    error = float(np.clip(rng.normal(0.0, share), -2 * share, 2 * share))
    mean = value / (1.0 + error)
    return float(f"{mean:.4g}"), float(f"{share * mean:.3g}")


def draw_scene(rng, unsuitable=()):
    """A scene whose object is of none of the kinds that the engine cannot hold."""
    kind = draw_kind(rng, SHAPES, unsuitable)
    size, mass, friction = draw_body(rng, kind)
    tool_friction = float(round(rng.uniform(0.05, 0.4), 3))
    centre = [0.0, 0.0] if rng.random() < 0.5 else [float(rng.uniform(0.3, 0.7)), float(rng.uniform(-0.3, 0.3))]
    scene = Scene(kind, size, mass, friction, tool_friction, 0.0, centre, {})
    high = 2 * scene.half_height_m
    scene.tool_radius_m = round(float(max(0.002, min(rng.uniform(0.12, 0.35) * scene.length_m, 0.45 * high, 0.05))), 4)
    exact = rng.random() < 0.15
    scene.stated = {"mass_kg": stated(rng, mass, exact), "friction": stated(rng, friction, exact),
                    "tool_friction": stated(rng, tool_friction, rng.random() < 0.6)}
    if exact:
        scene.mass_kg, scene.friction = scene.stated["mass_kg"][0], scene.stated["friction"][0]
    return scene


def draw_sensors(rng, tosses):
    if tosses:
        return {"orientation"} | ({"velocity"} if rng.random() < 0.5 else set())
    sensors = {"command", "tool", "force", "torque", "orientation"}
    lacks = rng.choice(["nothing", "force", "command", "tool", "orientation"], p=[0.5, 0.18, 0.1, 0.12, 0.1])
    sensors -= {str(lacks)} | ({"torque"} if lacks == "force" or rng.random() < 0.5 else set())
    return sensors | ({"velocity"} if rng.random() < 0.15 else set())


def draw_noise(rng, scene):
    """Over two decades each; forces scale with the weight, places with the size."""
    length, weight = scene.length_m, scene.weight_n
    force = weight * log_uniform(rng, 0.0008, 0.06)
    noise = {
        "object_position_m": min(max(length * log_uniform(rng, 0.0003, 0.02), 2e-5), 0.004),
        "object_orientation_rad": log_uniform(rng, 0.0004, 0.03),
        "object_velocity_mps": scene.speed_mps * log_uniform(rng, 0.001, 0.03),
        "object_spin_rps": scene.speed_mps / length * log_uniform(rng, 0.001, 0.03),
        "tool_position_m": max(length * log_uniform(rng, 0.0001, 0.004), 5e-6),
        "wrist_force_n": force,
        "wrist_torque_nm": force * max(scene.tool_radius_m, 0.01) * float(rng.uniform(0.3, 1.0)),
    }
    return {key: float(f"{value:.3g}") for key, value in noise.items()}


def draw_rig(rng, scene):
    tosses = bool(rng.random() < 0.15)
    rig = Rig(designed=bool(rng.random() < 0.5), tosses=tosses, sensors=draw_sensors(rng, tosses))
    rate = log_uniform(rng, *([(30, 120)] * 8 + [(15, 30), (120, 500)])[rng.integers(10)])
    rig.period_s = round(1.0 / rate, 4)
    rig.straight = bool(rate < 40.0 or rng.random() < 0.6)
    if rng.random() < 0.5:
        rig.jitter = float(rng.uniform(0.01, 0.15))
    if rng.random() < 0.4:
        rig.dropped = float(rng.uniform(0.005, 0.1))
    if rng.random() < 0.3:
        rig.lost_poses = float(rng.uniform(0.01, 0.3))
    rig.own_rows = bool(not tosses and rng.random() < 0.3)
    rig.object_period_s = 1.0 / float(rng.uniform(15, 90)) if rig.own_rows else rig.period_s
    rig.force_period_s = 1.0 / log_uniform(rng, 50, 250) if rig.own_rows else rig.period_s
    rig.force_mean = bool(rng.random() < 0.5)
    if not tosses and rng.random() < 0.5:
        rig.skew_s = round(float(rng.uniform(-0.04, 0.04)), 4)
    rig.noise = draw_noise(rng, scene)
    said = rng.random()
    keys = list(rig.noise)
    rig.noise_stated = set(keys) if said < 0.6 else set() if said < 0.8 else {k for k in keys if rng.random() < 0.5}
    few = rng.random()
    # Six: of five, two are held out, and `diagnose` wants four to fit.
    rig.episodes = int(max(6, rng.integers(5, 16)) if few < 0.12 else rng.integers(41, 61) if few > 0.93 else rng.triangular(16, 18, 41))
    rig.long_rests = bool(rng.random() < 0.2)
    return rig
