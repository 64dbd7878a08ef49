"""The scene that both engines simulate: an arm with the physics that the nominal model may lack.

A `Scene` only states the physics.  `engine_mujoco` and `engine_drake` integrate it, each in its own way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from arm_models import Body


@dataclass
class Friction:
    """Friction of one joint.

    Without bristles the friction opposes the velocity with up to `level` N m (Coulomb, at rest any torque up to it),
    plus `viscous` N m s/rad.  With `bristle_rad` > 0 the Coulomb part is a Dahl/LuGre bristle with that deflection.
    """

    coulomb: float = 0.0
    viscous: float = 0.0
    peak: float = 0.0  # Stribeck: more Coulomb friction at low speed, N m
    stribeck_rps: float = 1.0
    load: float = 0.0  # share of the |torque transmitted to the link| when the motor drives the link
    load_back: float = 0.0  # the same when the link drives the motor
    change: float = 0.0  # relative change of coulomb and viscous over the log
    change_secs: float = 1.0  # time constant of the change
    log_secs: float = 1.0
    bristle_rad: float = 0.0
    bristle_damping: float = 0.0  # N m s/rad, acts on the rate of the deflection

    @property
    def varies(self) -> bool:
        return bool(self.peak or self.load or self.load_back or self.change)

    def scale(self, log_secs: float) -> float:
        """Factor of the drift at a time since the start of the log."""
        if not self.change:
            return 1.0
        return 1.0 + self.change * (1.0 - math.exp(-log_secs / self.change_secs)) / (
            1.0 - math.exp(-self.log_secs / self.change_secs))

    def level(self, v: float, transmitted: float, log_secs: float) -> tuple[float, float]:
        """Coulomb level [N m] and viscous coefficient [N m s/rad] at a velocity and transmitted torque."""
        scale = self.scale(log_secs)
        level = self.coulomb * scale
        if self.peak:
            level += self.peak * math.exp(-((v / self.stribeck_rps) ** 2))
        if self.load or self.load_back:
            level += (self.load if transmitted * v >= 0.0 else self.load_back) * abs(transmitted)
        return level, self.viscous * scale


@dataclass
class Elastic:
    """Spring between motor and link of one joint; `gap_rad` is the whole dead band of a backlash."""

    stiffness: float
    damping: float
    rotor_inertia: float
    gap_rad: float = 0.0

    def torque(self, deflection: float, rate: float) -> float:
        """Torque on the link, in the direction of the joint, at a deflection (link minus motor)."""
        half = 0.5 * self.gap_rad
        if half and abs(deflection) <= half:
            return 0.0
        inside = deflection - math.copysign(half, deflection)
        torque = -self.stiffness * inside - self.damping * rate
        return torque if not half or torque * inside < 0.0 else 0.0  # a gap cannot pull


@dataclass
class Cable:
    """Spring with slack from a point of the last body to a point in the room (base axes)."""

    point: np.ndarray
    anchor: np.ndarray
    stiffness: float
    slack_m: float
    damping: float

    def force(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray | None:
        """Force on the arm [N], or None while the cable is slack."""
        reach = position - self.anchor
        length = float(np.linalg.norm(reach))
        if length <= self.slack_m:
            return None
        direction = reach / length
        tension = self.stiffness * (length - self.slack_m) + self.damping * float(velocity @ direction)
        return -direction * max(tension, 0.0)


@dataclass
class Table:
    """The base slides on a spring along `direction` (unit vector), shaken by a machine and by the arm itself."""

    direction: np.ndarray
    mass: float
    stiffness: float
    damping: float
    shake_n: float = 0.0
    shake_rps: float = 0.0

    def force(self, log_secs: float) -> float:
        """Force of the machine along the direction, N."""
        return self.shake_n * math.sin(self.shake_rps * log_secs)


@dataclass
class Scene:
    """An arm with everything that acts on it.  Lists have one entry per joint."""

    bodies: list[Body]
    tip_rotation: np.ndarray
    tip_position: np.ndarray
    gravity: np.ndarray  # in base axes, m/s^2
    friction: list[Friction]
    armature: np.ndarray  # reflected inertia, kg m^2
    elastic: dict[int, Elastic] = field(default_factory=dict)
    ripple: dict[int, tuple[float, int, float]] = field(default_factory=dict)  # amplitude, cycles per turn, phase
    clip: dict[int, float] = field(default_factory=dict)  # N m
    dying: dict[int, tuple[np.ndarray, float]] = field(default_factory=dict)  # intervals (log time) and remaining share
    cable: Cable | None = None
    table: Table | None = None

    def motor_torque(self, command: np.ndarray, q: np.ndarray, log_secs: float) -> np.ndarray:
        """Torque that the motors really give [N m] for the torque that the drives report."""
        if not (self.ripple or self.clip or self.dying):
            return command
        torque = command.copy()
        for joint, (intervals, share) in self.dying.items():
            if ((intervals[:, 0] <= log_secs) & (log_secs < intervals[:, 1])).any():
                torque[joint] *= share
        for joint, limit in self.clip.items():
            torque[joint] = min(max(torque[joint], -limit), limit)
        for joint, (amplitude, cycles, phase) in self.ripple.items():
            torque[joint] += amplitude * math.sin(cycles * q[joint] + phase)
        return torque


class Bristles:
    """State of the bristle friction (Dahl with a little bristle damping) of the joints that have it."""

    def __init__(self, scene: Scene):
        self.laws = {i: f for i, f in enumerate(scene.friction) if f.bristle_rad > 0.0 and f.coulomb > 0.0}
        self.z = {i: 0.0 for i in self.laws}

    def add_torque(self, torque: np.ndarray, v: np.ndarray, step_secs: float) -> np.ndarray:
        """Advance the bristles by a step at velocities `v`, subtract their friction from `torque` (a copy)."""
        torque = torque.copy()
        for i, law in self.laws.items():
            scale, speed = law.bristle_rad, float(v[i])
            old = self.z[i]
            if speed:
                fade = math.exp(-abs(speed) * step_secs / scale)
                self.z[i] = old * fade + math.copysign(scale, speed) * (1.0 - fade)
            rate = (self.z[i] - old) / step_secs
            torque[i] -= law.coulomb / scale * self.z[i] + law.bristle_damping * rate
        return torque
