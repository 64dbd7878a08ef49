"""One episode in one engine, with what is hidden in it. Loads on the object, friction that depends on the state, and a tool that gives way are
the same code for every engine; an engine only gets forces, a coefficient and places of the tool."""

import math
from dataclasses import dataclass

import numpy as np

import engines
from scene import GRAVITY, solid_inertia

FRICTIONS = ("stribeck_friction", "static_friction", "anisotropic_friction", "friction_patch")
LOADS = ("viscous_damping", "quadratic_drag", "constant_force", "tether", "rolling_resistance", "adhesion", "periodic_force", "magnet", "gust",
         "glue", "sticky_spot", "sideways_force")
STICKS_MPS = 0.0005
ADHESION_RANGE_M = 0.001
JAM_WEIGHTS, JAM_S = 25.0, 0.03  # a rig stops itself where the force stays above that


def matrix(q):
    x, y, z, w = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@dataclass
class Trace:
    """What truly happened, a row a physics step; the wrench is the mean of the step that ends there."""

    time_s: np.ndarray
    command: np.ndarray
    tool: np.ndarray
    pose: np.ndarray
    velocity: np.ndarray
    wrench: np.ndarray


def make_body(scene, effects, added_kg):
    """The object with its added weight, and what the effects change of it natively."""
    inertia, com, mass = solid_inertia(scene.shape, scene.size_m, scene.mass_kg), np.zeros(3), scene.mass_kg
    if "com_offset" in effects:
        com = np.array([effects["com_offset"][f"share_{a}"] for a in "xyz"]) * 2 * np.array(scene.half_sizes_m)
    total = mass + added_kg
    inertia = inertia + (com @ com * np.eye(3) - np.outer(com, com)) * mass * added_kg / total
    com = com * mass / total
    gravity = np.array([0.0, 0.0, -GRAVITY])
    if "table_tilt" in effects:
        x, y = (GRAVITY * math.sin(effects["table_tilt"][f"slope_{a}_rad"]) for a in "xy")
        gravity = np.array([x, y, -math.sqrt(GRAVITY ** 2 - x * x - y * y)])
    friction = effects["friction_level"]["coefficient"] if "friction_level" in effects else scene.friction
    radius = scene.tool_radius_m * (effects["tool_radius"]["share"] if "tool_radius" in effects else 1.0)
    body = engines.Body(scene.shape, scene.size_m, mass, total, com, inertia, friction, scene.tool_friction, radius, gravity)
    if "restitution" in effects:
        body.restitution = effects["restitution"]["coefficient"]
    if "contact_compliance" in effects:
        body.compliance = tuple(effects["contact_compliance"].values())
    if "hidden_obstacle" in effects:
        o = effects["hidden_obstacle"]
        body.obstacle = {"x_m": o["x_m"], "y_m": o["y_m"], "radius_m": o["size_0_m"], "height_m": o["size_1_m"]}
    if "pressure_distribution" in effects:
        share, r = effects["pressure_distribution"]["radius_share"], body.foot_radius_m
        body.feet_m = [(share * x, share * y, -body.half_m[2]) for x, y in rim(scene, r)]
    return body


def rim(scene, inset=0.0):
    """Corners of the sole, or points of its rim."""
    if scene.kind == "box":
        a, b = (v / 2 - inset for v in scene.size_m[:2])
        return [(x, y) for x in (a, -a) for y in (b, -b)]
    r = scene.size_m[0] - inset
    return [(r * math.cos(k * math.pi / 4), r * math.sin(k * math.pi / 4)) for k in range(8)]


class Hidden:
    """Loads and friction of an episode, by its state."""

    def __init__(self, scene, effects, body, engine):
        self.scene, self.body, self.engine = scene, body, engine
        self.loads = [(name, effects[name]) for name in LOADS if name in effects]
        self.frictions = [(name, effects[name]) for name in FRICTIONS if name in effects]
        self.leak = effects.get("mass_leak")
        self.sole = np.array([(x, y, -scene.half_height_m) for x, y in rim(scene)]) if scene.kind in ("box", "upright") else None
        self.held = None
        self.pull = np.zeros(3)

    @property
    def idle(self):
        return not (self.loads or self.frictions or self.leak)

    def __call__(self, step, t, pose, velocity, tool):
        """Force and torque on the object at its centre of mass."""
        force, torque, self.pull = np.zeros(3), np.zeros(3), np.zeros(3)
        for name, p in self.loads:
            f, tau = getattr(self, name)(p, t, pose, velocity, tool)
            force += f
            if tau is not None:
                torque += tau
        if self.frictions:
            torque += self.friction(pose, velocity)
        if self.leak and step % 10 == 0:
            self.engine.set_mass(max(1.0 - self.leak["rate_ps"] * t, 0.05))
        return force, torque

    def com_velocity(self, pose, velocity):
        if not self.body.com_m.any():
            return velocity[:3]
        return velocity[:3] + cross(velocity[3:], matrix(pose[3:]) @ self.body.com_m)

    def viscous_damping(self, p, t, pose, velocity, tool):
        return -p["coefficient_nspm"] * self.com_velocity(pose, velocity), None

    def quadratic_drag(self, p, t, pose, velocity, tool):
        v = self.com_velocity(pose, velocity)
        return -p["coefficient_ns2pm2"] * math.sqrt(v @ v) * v, None

    def constant_force(self, p, t, pose, velocity, tool):
        return np.array([p["force_x_n"], p["force_y_n"], 0.0]), None

    def tether(self, p, t, pose, velocity, tool):
        k = p["stiffness_npm"]
        return np.array([-k * (pose[0] - p["anchor_x_m"]), -k * (pose[1] - p["anchor_y_m"]), 0.0]), None

    def rolling_resistance(self, p, t, pose, velocity, tool):
        r, m = self.scene.size_m[0], self.body.mass_kg
        speed = math.hypot(velocity[3], velocity[4])
        if pose[2] > 1.05 * r or speed < 1e-9:
            return np.zeros(3), None
        size = min(p["lever_m"] * m * GRAVITY, 1.4 * m * r * r * speed / self.engine.step_s)
        return np.zeros(3), np.array([-size * velocity[3] / speed, -size * velocity[4] / speed, 0.0])

    def adhesion(self, p, t, pose, velocity, tool):
        turn = matrix(pose[3:])
        local = turn.T @ (tool - pose[:3])
        near = self.nearest(local)
        off = local - near
        distance = math.sqrt(off @ off)
        apart = distance - self.body.tool_radius_m
        pull = p["pull_off_n"] * min(1.0, max(0.0, 1.0 - apart / ADHESION_RANGE_M))
        if pull == 0.0 or distance < 1e-9:
            return np.zeros(3), None
        force = turn @ (off * (pull / distance))
        self.pull = -force
        return force, cross(turn @ (near - self.body.com_m), force)

    def nearest(self, at):
        half = self.scene.half_sizes_m
        if self.scene.shape == "box":
            return np.clip(at, -np.array(half), half)
        if self.scene.shape == "sphere":
            return at * min(1.0, half[0] / max(math.sqrt(at @ at), 1e-12))
        out = math.hypot(at[0], at[1])
        share = min(1.0, half[0] / max(out, 1e-12))
        return np.array([at[0] * share, at[1] * share, min(max(at[2], -half[2]), half[2])])

    def periodic_force(self, p, t, pose, velocity, tool):
        now = math.sin(2 * math.pi * t / p["period_secs"] + p["phase_rad"])
        return np.array([p["force_x_n"] * now, p["force_y_n"] * now, 0.0]), None

    def magnet(self, p, t, pose, velocity, tool):
        to = np.array([p["x_m"] - pose[0], p["y_m"] - pose[1], 0.0])
        far = (to @ to) / self.scene.length_m ** 2
        return to * (p["strength_n"] / (self.scene.length_m * (0.1 + far ** 1.5))), None

    def gust(self, p, t, pose, velocity, tool):
        blows = p["begin_secs"] <= t < p["begin_secs"] + p["length_secs"]
        return np.array([p["force_x_n"], p["force_y_n"], 0.0]) * float(blows), None

    def glue(self, p, t, pose, velocity, tool):
        if not p["begin_secs"] <= t < p["begin_secs"] + p["length_secs"]:
            self.held = None
            return np.zeros(3), None
        if self.held is None:
            self.held = pose[:2].copy()
        m, rate = self.body.mass_kg, 100.0
        f = -m * rate ** 2 * (pose[:2] - self.held) - 2 * m * rate * velocity[:2]
        size = math.hypot(*f)
        f *= min(1.0, p["limit_n"] / max(size, 1e-12))
        return np.array([f[0], f[1], 0.0]), None

    def sticky_spot(self, p, t, pose, velocity, tool):
        inside = math.hypot(pose[0] - p["x_m"], pose[1] - p["y_m"]) < p["radius_m"]
        return np.array([-velocity[0], -velocity[1], 0.0]) * (p["viscosity_nspm"] * float(inside)), None

    def sideways_force(self, p, t, pose, velocity, tool):
        return np.array([-velocity[1], velocity[0], 0.0]) * p["coefficient_nspm"], None

    def friction(self, pose, velocity):
        """Sets the coefficient to the mean over the sole's points; what they differ by goes into a torque about the vertical."""
        turn = matrix(pose[3:])
        arms = self.sole @ turn.T
        at = pose[:2] + arms[:, :2]
        w = velocity[5]
        slip = velocity[:2] + w * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
        speed = np.hypot(slip[:, 0], slip[:, 1])
        factor = np.ones(len(arms))
        for name, p in self.frictions:
            factor *= factor_of(name, p, at, slip, speed)
        mean = float(factor.mean())
        mu = self.body.friction
        self.engine.set_friction(max(mu * mean, 1e-4))
        if pose[2] > 1.2 * self.scene.half_height_m:
            return np.zeros(3)
        # Uneven friction: −(μᵢ − μ̄) Nᵢ along the slip, eased below a few STICKS_MPS so that it does not chatter.
        f = -(mu * (factor - mean) * self.body.mass_kg * GRAVITY / len(arms) / (speed + 4 * STICKS_MPS))[:, None] * slip
        return np.array([0.0, 0.0, float((arms[:, 0] * f[:, 1] - arms[:, 1] * f[:, 0]).sum())])


def factor_of(name, p, at, slip, speed):
    """Friction of points as a multiple of μ: the catalogue's equations."""
    if name == "anisotropic_friction":
        direction = np.arctan2(slip[:, 1], slip[:, 0])
        return np.where(speed < 1e-6, 1.0, 1.0 + p["amplitude"] * np.cos(2.0 * (direction - p["axis_rad"])))
    if name == "stribeck_friction":
        return 1.0 + p["excess"] * np.exp(-(speed / p["velocity_mps"]) ** 2)
    if name == "static_friction":
        return np.where(speed < STICKS_MPS, p["ratio"], 1.0)
    outside = np.hypot(at[:, 0] - p["x_m"], at[:, 1] - p["y_m"]) - p["radius_m"]
    return 1.0 + p["excess"] / (1.0 + np.exp(np.clip(4.0 * outside / 0.002, -60.0, 60.0)))


class Arm:
    """A tool on a critically damped spring behind its command, with twice the object's mass."""

    def __init__(self, p, body, at):
        self.k, self.m = p["stiffness_npm"], 2.0 * body.mass_kg
        self.d = 2.0 * math.sqrt(self.k * self.m)
        self.off, self.speed = np.zeros(3), np.zeros(3)

    def next(self, wrench, h):
        # Implicit in the spring.
        self.speed = (self.speed * self.m + h * (wrench[:3] - self.k * self.off)) / (self.m + h * self.d + h * h * self.k)
        self.off = self.off + h * self.speed
        return self.off


class World:
    """A scene with its hidden effects in one engine; an engine is kept for each added weight."""

    def __init__(self, scene, effects, engine, variant):
        self.scene, self.effects, self.engine, self.variant = scene, effects, engine, variant
        self.made = {}

    def built(self, added_kg):
        if added_kg not in self.made:
            body = make_body(self.scene, self.effects, added_kg)
            self.made[added_kg] = (body, engines.make(self.engine, body, self.variant))
        return self.made[added_kg]

    def tool_times(self, times):
        """Times on the command's course at true times."""
        rate = self.effects["time_base"]["rate"] if "time_base" in self.effects else 1.0
        return times * rate - (self.effects["actuation_delay"]["delay_secs"] if "actuation_delay" in self.effects else 0.0)

    def settled(self, engine, episode, far):
        """The pose with the height at which it rests in this engine."""
        engine.place(episode.pose, [0.0] * 6, far)
        pose = np.array(episode.pose, float)
        if engine.step_s > 0.0:
            for _ in range(math.ceil(0.15 / engine.step_s)):
                engine.step(None, None, far)
            height = engine.state()[0][2]
            if abs(height - pose[2]) < 0.2 * self.scene.half_height_m:
                pose[2] = height
        return pose

    def run(self, episode):
        body, engine = self.built(episode.added_kg)
        h = engine.step_s
        rate = self.effects["time_base"]["rate"] if "time_base" in self.effects else 1.0
        times = np.arange(math.ceil(episode.seconds / rate / h) + 2) * h
        far = np.array([episode.pose[0], episode.pose[1] + 100 * self.scene.length_m, 10 * self.scene.length_m])
        if episode.course is None:
            tool = command = np.repeat(far[None], len(times), axis=0)
        else:
            command = episode.places(times * rate)
            tool = episode.places(self.tool_times(times))
            if "actuator_gain" in self.effects:
                tool = tool[0] + self.effects["actuator_gain"]["gain"] * (tool - tool[0])
        if self.effects.get("mass_leak"):
            engine.set_mass(1.0)
        engine.set_friction(body.friction)
        pose = self.settled(engine, episode, far) if episode.rests else np.array(episode.pose, float)
        engine.place(pose, episode.velocity, tool[0])
        return self.steps(episode, body, engine, times, command, tool)

    def steps(self, episode, body, engine, times, command, tool):
        hidden = Hidden(self.scene, self.effects, body, engine)
        arm = Arm(self.effects["arm_compliance"], body, tool[0]) if "arm_compliance" in self.effects else None
        pose, velocity = engine.state()
        n, h, idle = len(times), engine.step_s, hidden.idle
        poses, velocities, wrenches = np.empty((n, 7)), np.empty((n, 6)), np.zeros((n, 6))
        poses[0], velocities[0], went = pose, velocity, tool.copy()
        force = torque = None
        pressed, kept = 0.0, math.exp(-h / JAM_S)
        reach, most = 15.0 * self.scene.length_m, JAM_WEIGHTS * body.mass_kg * GRAVITY
        x, y = episode.pose[:2]
        for k in range(1, n):
            if not idle:
                force, torque = hidden(k - 1, times[k - 1], pose, velocity, went[k - 1])
            if arm:
                went[k] = tool[k] + arm.next(wrenches[k - 1], h)
            wrench = engine.step(force, torque, went[k])
            if not idle:
                wrench[:3] += hidden.pull
            pose, velocity = engine.state()
            poses[k], velocities[k], wrenches[k] = pose, velocity, wrench
            pressed = kept * pressed + (1 - kept) * math.sqrt(wrench[:3] @ wrench[:3])
            if not (pressed < most and math.hypot(pose[0] - x, pose[1] - y) < reach and pose[2] > 0.0):
                n = k
                break
        return Trace(times[:n], command[:n], went[:n], poses[:n], velocities[:n], wrenches[:n])
