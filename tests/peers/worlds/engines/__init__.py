"""Physics engines behind one small interface.

An engine is made of a `Body` and a variant, and has

    step_s                                  its time step, s
    unsupported, unsuitable                 effects that it cannot do natively; kinds of objects that it holds badly
    place(pose, velocity, tool_m)           object (x y z, qx qy qz qw; of its centre) and tool
    step(force, torque, tool_m) -> wrench   one time step: loads at the object's centre of mass; the tool goes straight to tool_m;
                                            what the world exerts on the tool at its centre, mean of the step
    state() -> pose, velocity               of the centre of the shape, base axes
    set_friction(mu)                        of the pair object–table
    set_mass(share)                         of the object's own mass and inertia; an added weight stays

Tools are free bodies, 1e4 times as heavy as the object, that get place and velocity of their course at every step: bodies that are moved by
hand are at rest for the contacts of most engines. The wrench is the momentum that the tool gains.
"""

import importlib
from dataclasses import dataclass, field

import numpy as np

TOOL_RATIO = 1e4
ENGINES = {"mujoco": ("default", "soft", "hard", "pyramidal"), "bullet": ("default", "fine", "unscaled"),
           "drake": ("point", "hydroelastic", "tamsi"), "dart": ("default", "bullet", "fine", "pyramidal")}
# What a variant has of itself, against ideal friction on the corners (check_engines.py): no wrong name for it.
NATURAL = {("drake", "hydroelastic"): ("pressure_distribution",), ("mujoco", "soft"): ("contact_compliance", "pressure_distribution"),
           ("mujoco", "pyramidal"): ("anisotropic_friction", "pressure_distribution"), ("dart", "pyramidal"): ("anisotropic_friction",)}


@dataclass
class Body:
    """What an engine has to build. Lengths m, inertia kg·m² about the centre of mass, in the axes of the shape."""

    shape: str
    size_m: list
    own_kg: float  # without the added weight
    mass_kg: float
    com_m: np.ndarray
    inertia: np.ndarray
    friction: float
    tool_friction: float
    tool_radius_m: float
    gravity: np.ndarray
    restitution: float = 0.0
    feet_m: list = field(default_factory=list)  # points that it stands on, object frame; the sole hangs a little higher
    obstacle: dict = None  # fixed cylinder: x_m, y_m, radius_m, height_m
    compliance: tuple = None  # frequency_hz, damping_ratio

    @property
    def half_m(self):
        s = self.size_m
        return {"box": lambda: [v / 2 for v in s], "cylinder": lambda: [s[0], s[0], s[1] / 2]}.get(self.shape, lambda: [s[0]] * 3)()

    @property
    def foot_radius_m(self):
        return min(0.001, 0.02 * min(self.half_m))

    def shares(self, share):
        """Mass and inertia once that share of its own mass is left."""
        left = self.mass_kg - self.own_kg * (1.0 - share)
        return left, self.inertia * (left / self.mass_kg)


def make(name, body, variant):
    if variant not in ENGINES[name]:
        raise ValueError(f"{name} has the variants {', '.join(ENGINES[name])}, not `{variant}`")
    return importlib.import_module(f"engines.{name}_engine").Engine(body, variant)


def version(name):
    return importlib.import_module(f"engines.{name}_engine").VERSION


def unsupported(name):
    """Effects that the engine cannot do natively."""
    return importlib.import_module(f"engines.{name}_engine").Engine.unsupported


def unsuitable(name):
    """Kinds of objects that the engine's contacts do not hold."""
    return importlib.import_module(f"engines.{name}_engine").Engine.unsuitable
