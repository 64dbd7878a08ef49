#!/usr/bin/env python3
"""Measured logs of a pushed object in MuJoCo, with a hidden effect that the nominal model lacks: peer data for `diagnose`.

    pip install mujoco numpy
    python tests/peers/mujoco_logs.py --out DIR --all                       # a set of every effect, ten of none
    python tests/peers/mujoco_logs.py --out DIR --sets table_tilt:1,none:2  # --actions passive, --seed 2, --thin 2, --episodes 16
    python tests/peers/mujoco_logs.py --check                               # closed forms, one JSON object; exit status 1 beyond a limit

DIR/logs/NAME is what a solver may read (docs/src/reference/measured-log.md), DIR/truth/NAME.json what it has to find: effect and parameters as in
crates/physics-model/src/effects, "none", or "unknown" with a "kind" that no catalogue has. Names are numbers in an order that the seed shuffles;
the seed decides everything. A set that exists is made anew.

How MuJoCo is set up, and why:

- Tool: a free body of 1e4 kg that gets place and velocity of its command at the start of every tick. A mocap body would do worse: contacts see it
  at rest. The mean wrench of a tick is the momentum that it has gained by the tick's end; it moves by less than 1e-7 m of its own.
- Object: it bears on small spheres in its corners (box: 8 of 0.1 mm) or rims (cylinder: 8 each), each a contact pair of its own with condim 3. What
  resists turning on the spot is then the friction of these points and no torsional coefficient, as for any box on a plane; and friction
  can depend on place and slip of the single point, which the catalogue's anisotropic friction, patches, Stribeck and static friction do.
- Contacts, as in mujoco_scenes.py: a damped spring along the normal with impedance 0.001, and friction with solreffriction and impratio of its own,
  nearly ideal. MuJoCo's convex model lifts sliding bodies; impedances near 1 let them hop. A rate counts for one contact that bears the whole mass:
  four corners together are 2 (up and down) to 3 (rocking) times as fast, so that a point has 300 rad/s, a contact alone 800.
- Elliptic cone, Newton, implicitfast, steps of 0.25 ms, without which these springs are not stable.
"""

import argparse
import json
import math
import pathlib
import shutil
import sys
import time

try:
    import mujoco
    import numpy as np
except ImportError:
    sys.stderr.write("missing: pip install mujoco numpy\n")
    sys.exit(3)

GRAVITY = 9.81
TICK_S = 0.01
STEP_S = 0.00025
TOOL_RADIUS_M = 0.02
TOOL_FRICTION = 0.1
TOOL_KG, TOOL_KGM2 = 1e4, 1e2
STOP_RATE, IMPEDANCE, IMPRATIO = 1500.0, 1e-3, 3e4
# Rate (rad/s) and damping ratio of a contact's spring: of one of many support points, and of one alone.
SUPPORT, ALONE = (300.0, 1.0), (800.0, 1.5)
SUPPORT_RADIUS_M = 0.0001
SOLE_GAP_M = 0.0003  # of a sole that stands on points nearer to the centre
MASS_KG = {"mean": 0.5, "stddev": 0.075}
FRICTION = {"mean": 0.35, "stddev": 0.0525}
SHAPES = {"box": [0.08, 0.06, 0.05], "cylinder": [0.035, 0.05], "sphere": [0.03]}
NOISE = {"object_position_m": 0.0005, "object_orientation_rad": 0.003, "tool_position_m": 0.0001, "wrist_force_n": 0.05,
         "wrist_torque_nm": 0.002}
ADDED_KG = 0.3
JAM_N = 60.0  # of a tool that squeezes the object against what cannot move
DIRECTIONS, SPEEDS_MPS = 8, (0.03, 0.08, 0.16, 0.3)
COLUMNS = (["episode", "time_secs"] + [f"{who}_{axis}_m" for who in ("command", "tool") for axis in "xyz"]
           + [f"wrist_f{axis}_n" for axis in "xyz"] + [f"wrist_t{axis}_nm" for axis in "xyz"]
           + [f"object_{axis}_m" for axis in "xyz"] + [f"object_q{axis}" for axis in "xyzw"] + ["added_mass_kg"])


# ---------------------------------------------------------------------------------------------------------------------
# Effects: a name, a draw of parameters by their names in the catalogue, and what of the simulation they change.


def sign(rng):
    return 1.0 if rng.random() < 0.5 else -1.0


def around(rng, low, high):
    """1 ± a draw."""
    return 1.0 + sign(rng) * rng.uniform(low, high)


def plane(rng, low, high, *names):
    """A vector of drawn length and direction in the plane, or in space for three names."""
    v = rng.normal(size=len(names))
    v *= rng.uniform(low, high) / np.linalg.norm(v)
    return dict(zip(names, map(float, v)))


DRAWS = {
    "viscous_damping": lambda r: {"coefficient_nspm": r.uniform(0.4, 1.2)},
    "quadratic_drag": lambda r: {"coefficient_ns2pm2": r.uniform(1.5, 3.5)},
    "friction_level": lambda r: {"coefficient": 1.6 * FRICTION["mean"]},
    "stribeck_friction": lambda r: {"excess": r.uniform(0.4, 0.9), "velocity_mps": r.uniform(0.03, 0.08)},
    "static_friction": lambda r: {"ratio": r.uniform(1.3, 1.6)},
    "anisotropic_friction": lambda r: {"amplitude": r.uniform(0.18, 0.35), "axis_rad": r.uniform(0.0, math.pi)},
    "friction_patch": lambda r: {"excess": r.uniform(0.5, 0.9), "x_m": r.uniform(-0.06, 0.06), "y_m": r.uniform(-0.06, 0.06),
                                 "radius_m": r.uniform(0.05, 0.09)},
    "pressure_distribution": lambda r: {"radius_share": r.uniform(0.3, 0.6)},
    "table_tilt": lambda r: plane(r, math.radians(0.5), math.radians(1.5), "slope_x_rad", "slope_y_rad"),
    "constant_force": lambda r: plane(r, 0.12, 0.4, "force_x_n", "force_y_n"),
    "tether": lambda r: {"stiffness_npm": r.uniform(2.0, 6.0), "anchor_x_m": r.uniform(-0.08, 0.08), "anchor_y_m": r.uniform(-0.08, 0.08)},
    "com_offset": lambda r: plane(r, 0.1, 0.2, "share_x", "share_y") | {"share_z": 0.0},
    "rolling_resistance": lambda r: {"lever_m": r.uniform(0.0005, 0.002)},
    "mass_leak": lambda r: {"rate_ps": r.uniform(0.008, 0.016)},
    "hidden_obstacle": None,  # drawn with the actions: it has to be in their way
    "wrist_payload": lambda r: {"mass_kg": r.uniform(0.1, 0.5)} | plane(r, 0.02, 0.05, "com_x_m", "com_y_m", "com_z_m"),
    "force_bias": lambda r: plane(r, 0.3, 1.0, "bias_x_n", "bias_y_n", "bias_z_n"),
    "force_drift": lambda r: plane(r, 0.0012, 0.0017, "drift_x_nps", "drift_y_nps", "drift_z_nps"),
    "force_gain": lambda r: {"gain": around(r, 0.1, 0.2)},
    "force_low_pass": lambda r: {"time_constant_secs": r.uniform(0.02, 0.06)},
    "force_saturation": lambda r: {"limit_n": r.uniform(1.1, 1.4)},
    "pose_offset": lambda r: plane(r, 0.003, 0.01, "offset_x_m", "offset_y_m", "offset_z_m"),
    "pose_delay": lambda r: {"delay_secs": r.uniform(0.02, 0.06)},
    "pose_scale": lambda r: {"scale": around(r, 0.02, 0.05)},
    "pose_rotation": lambda r: {"yaw_rad": sign(r) * r.uniform(math.radians(1.5), math.radians(4.0))},
    "time_base": lambda r: {"rate": around(r, 0.02, 0.05)},
    "actuator_gain": lambda r: {"gain": around(r, 0.05, 0.12)},
    "actuation_delay": lambda r: {"delay_secs": r.uniform(0.02, 0.06)},
}
# Outside the catalogue.
UNKNOWN = {
    "magnet": lambda r: {"x_m": r.uniform(-0.06, 0.06), "y_m": r.uniform(-0.06, 0.06), "strength_nm3": r.uniform(6e-5, 1.2e-4)},
    "gust": lambda r: {"period_secs": 0.7, "phase_rad": r.uniform(0.0, 2 * math.pi)} | plane(r, 0.4, 0.8, "force_x_n", "force_y_n"),
    "tool_radius": lambda r: {"radius_m": 0.025},
}
BY_POINT = ("anisotropic_friction", "stribeck_friction", "static_friction", "friction_patch")
BY_FORCE = ("quadratic_drag", "tether", "rolling_resistance", "magnet", "gust")


def slip_factor(name, p, at, slip):
    """Friction of support points at `at` (m) that slip by `slip` (m/s), as a multiple of μ: the catalogue's equations."""
    speed = np.hypot(slip[:, 0], slip[:, 1])
    if name == "anisotropic_friction":
        direction = np.arctan2(slip[:, 1], slip[:, 0])
        return np.where(speed < 1e-6, 1.0, 1.0 + p["amplitude"] * np.cos(2.0 * (direction - p["axis_rad"])))
    if name == "stribeck_friction":
        return 1.0 + p["excess"] * np.exp(-(speed / p["velocity_mps"]) ** 2)
    if name == "static_friction":
        return np.where(speed < 0.0005, p["ratio"], 1.0)
    outside = np.hypot(at[:, 0] - p["x_m"], at[:, 1] - p["y_m"]) - p["radius_m"]
    return 1.0 + p["excess"] / (1.0 + np.exp(np.clip(4.0 * outside / 0.002, -60.0, 60.0)))


# ---------------------------------------------------------------------------------------------------------------------
# The world.


class World:
    """One episode: object (qpos 0–6) and tool (qpos 7–13)."""

    def __init__(self, scene, effect="none", p=None, added_kg=0.0, step_s=STEP_S):
        self.scene, self.effect, self.p, self.step_s = scene, effect, p or {}, step_s
        self.added_kg = added_kg
        self.radius_m = self.p["radius_m"] if effect == "tool_radius" else TOOL_RADIUS_M
        self.m = mujoco.MjModel.from_xml_string(self.xml())
        self.d = mujoco.MjData(self.m)
        self.time_s = 0.0
        if effect == "table_tilt":
            x, y = (GRAVITY * math.sin(self.p[f"slope_{axis}_rad"]) for axis in "xy")
            self.m.opt.gravity[:] = [x, y, -math.sqrt(GRAVITY ** 2 - x * x - y * y)]
        if effect == "viscous_damping":
            self.m.dof_damping[:3] = self.p["coefficient_nspm"]
        if effect == "constant_force":
            self.d.xfrc_applied[1, :2] = self.p["force_x_n"], self.p["force_y_n"]
        self.own = (float(self.m.body_mass[1]), self.m.body_inertia[1].copy())
        self.obstacle = self.m.geom("obstacle").id if effect == "hidden_obstacle" else None
        self.hit = False
        # Pairs of support points come first.
        self.points = np.array([g for g in range(self.m.ngeom) if self.m.geom(g).name.startswith("point")])

    def supports(self):
        """Where the object touches the table, object frame."""
        shape, size = self.scene["shape"], self.scene["size_m"]
        share = self.p["radius_share"] if self.effect == "pressure_distribution" else 1.0
        r = SUPPORT_RADIUS_M
        if shape == "box":
            a, b, h = (v / 2 - r for v in size)
            ring = [(x, y) for x in (a, -a) for y in (b, -b)]
        else:
            h, rim = size[1] / 2 - r, size[0] - r
            ring = [(rim * math.cos(k * math.pi / 4), rim * math.sin(k * math.pi / 4)) for k in range(8)]
        lower = [(share * x, share * y, -h) for x, y in ring]
        if share != 1.0:
            lower += [(x, y, -h + SOLE_GAP_M) for x, y in ring]
        return lower + [(x, y, h) for x, y in ring]

    def xml(self):
        shape, size, mass = self.scene["shape"], self.scene["size_m"], self.scene["mass_kg"]
        off = 'contype="0" conaffinity="0"'
        half = [v / 2 for v in size] if shape == "box" else [size[0], size[1] / 2] if shape == "cylinder" else size
        if shape == "box":
            x, y, z = size
            inertia = [mass * (y * y + z * z) / 12, mass * (x * x + z * z) / 12, mass * (x * x + y * y) / 12]
        elif shape == "cylinder":
            r, h = size
            across = mass * (3 * r * r + h * h) / 12
            inertia = [across, across, mass * r * r / 2]
        else:
            inertia = [0.4 * mass * size[0] ** 2] * 3
        com = [0.0] * 3
        if self.effect == "com_offset":
            full = [2 * half[0], 2 * half[min(1, len(half) - 1)] if shape == "box" else 2 * half[0], 2 * half[-1]]
            com = [self.p[f"share_{axis}"] * length for axis, length in zip("xyz", full)]
        # The added mass is a point in the centre of the shape.
        total = mass + self.added_kg
        moment = np.diag(inertia)
        if self.added_kg:
            c = np.array(com)
            moment = moment + (c @ c * np.eye(3) - np.outer(c, c)) * mass * self.added_kg / total
            com = [v * mass / total for v in com]
        full = [moment[0, 0], moment[1, 1], moment[2, 2], moment[0, 1], moment[0, 2], moment[1, 2]]
        words = lambda values: " ".join(repr(float(v)) for v in values)

        def pair(a, b, mu, spring=ALONE):
            rate, damping = spring
            return (f'<pair geom1="{a}" geom2="{b}" friction="{mu!r} {mu!r} 0 0 0" condim="3" solref="{-rate ** 2!r} {-2 * damping * rate!r}" '
                    f'solreffriction="{-rate ** 2!r} {-STOP_RATE * IMPEDANCE!r}" solimp="{IMPEDANCE} {IMPEDANCE} 0.001 0.5 2"/>')

        mu = self.p["coefficient"] if self.effect == "friction_level" else self.scene["friction"]
        points, pairs = "", ""
        if shape == "sphere":
            pairs += pair("table", "object", mu)
        else:
            for i, at in enumerate(self.supports()):
                points += f'<geom name="point{i}" type="sphere" size="{SUPPORT_RADIUS_M}" pos="{words(at)}" {off}/>'
                pairs += pair("table", f"point{i}", mu, SUPPORT)
        pairs += pair("tool", "object", TOOL_FRICTION)
        obstacle = ""
        if self.effect == "hidden_obstacle":
            p = self.p
            obstacle = (f'<geom name="obstacle" type="cylinder" size="{p["size_0_m"]} {p["size_1_m"] / 2}" '
                        f'pos="{p["x_m"]} {p["y_m"]} {p["size_1_m"] / 2}" {off}/>')
            # The smaller of the coefficients of object and obstacle (0.5).
            pairs += pair("object", "obstacle", min(mu, 0.5)) + pair("tool", "obstacle", TOOL_FRICTION)
        return f"""<mujoco><compiler angle="radian"/>
<option timestep="{self.step_s!r}" gravity="0 0 {-GRAVITY}" cone="elliptic" impratio="{IMPRATIO}" solver="Newton" iterations="100"
 tolerance="1e-13" integrator="implicitfast" jacobian="dense"><flag island="disable"/></option>
<worldbody><geom name="table" type="plane" size="0 0 1" {off}/>{obstacle}
<body name="object" simple="false"><freejoint/><inertial pos="{words(com)}" mass="{total!r}" fullinertia="{words(full)}"/>
<geom name="object" type="{shape}" size="{words(half)}" {off}/>{points}</body>
<body name="tool" gravcomp="1"><freejoint/><inertial pos="0 0 0" mass="{TOOL_KG}" diaginertia="{TOOL_KGM2} {TOOL_KGM2} {TOOL_KGM2}"/>
<geom name="tool" type="sphere" size="{self.radius_m}" {off}/></body></worldbody><contact>{pairs}</contact></mujoco>"""

    def place(self, object_m, yaw, tool_m, linear=(0, 0, 0), angular=(0, 0, 0)):
        self.d.qpos[:] = [*object_m, math.cos(yaw / 2), 0, 0, math.sin(yaw / 2), *tool_m, 1, 0, 0, 0]
        self.d.qvel[:] = [*linear, *angular, *[0.0] * 6]
        self.tool_m = np.array(tool_m, float)
        mujoco.mj_forward(self.m, self.d)

    def tick(self, tool_m, period_s):
        """The tool goes straight to `tool_m`; the mean wrench on it."""
        m, d = self.m, self.d
        steps = max(1, round(period_s / self.step_s))
        m.opt.timestep = period_s / steps
        v = (tool_m - self.tool_m) / period_s
        d.qpos[7:14] = [*self.tool_m, 1, 0, 0, 0]
        d.qvel[6:12] = [*v, 0, 0, 0]
        if self.effect == "mass_leak":
            share = max(1.0 - self.p["rate_ps"] * self.time_s, 0.05)
            m.body_mass[1] = self.own[0] - self.scene["mass_kg"] * (1.0 - share)
            m.body_inertia[1] = self.own[1] * share
        if self.effect in BY_POINT or self.effect in BY_FORCE:
            for _ in range(steps):
                self.by_state()
                mujoco.mj_step(m, d)
        else:
            mujoco.mj_step(m, d, nstep=steps)
        self.time_s += period_s
        if self.obstacle is not None:
            self.hit |= bool((d.contact.geom == self.obstacle).any())
        self.tool_m = np.array(tool_m, float)
        return np.concatenate([(d.qvel[6:9] - v) * TOOL_KG, d.qvel[9:12] * TOOL_KGM2]) / period_s

    def by_state(self):
        """What depends on the state within a tick, as of the last step."""
        m, d, p = self.m, self.d, self.p
        if self.effect in BY_POINT:
            # Those of the sole: the first half.
            at = d.geom_xpos[self.points[:len(self.points) // 2], :2]
            _, _, turn = d.xmat[1].reshape(3, 3) @ d.qvel[3:6]
            arm = at - d.xpos[1, :2]
            slip = d.qvel[:2] + turn * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
            mu = np.maximum(self.scene["friction"] * slip_factor(self.effect, p, at, slip), 1e-5)
            m.pair_friction[:len(mu), :2] = mu[:, None]
            return
        at, v, load = d.qpos[:3], d.qvel[:3], d.xfrc_applied[1]
        load[:] = 0.0
        if self.effect == "quadratic_drag":
            load[:3] = -p["coefficient_ns2pm2"] * math.sqrt(v @ v) * v
        elif self.effect == "tether":
            load[:2] = -p["stiffness_npm"] * (at[:2] - [p["anchor_x_m"], p["anchor_y_m"]])
        elif self.effect == "rolling_resistance":
            if at[2] < self.scene["size_m"][0] + 0.002:
                w = d.xmat[1].reshape(3, 3) @ d.qvel[3:6]
                speed = math.hypot(w[0], w[1])
                total = self.own[0]
                stop = 1.4 * total * self.scene["size_m"][0] ** 2 * speed / m.opt.timestep
                if speed > 1e-9:
                    load[3:5] = -min(p["lever_m"] * total * GRAVITY, stop) * w[:2] / speed
        elif self.effect == "magnet":
            to = np.array([p["x_m"], p["y_m"], 0.0]) - at
            load[:3] = p["strength_nm3"] * to / (to @ to) ** 2
        elif self.effect == "gust":
            now = math.sin(2 * math.pi * (self.time_s + d.time - self.began_s) / p["period_secs"] + p["phase_rad"])
            load[:2] = p["force_x_n"] * now, p["force_y_n"] * now

    began_s = 0.0


# ---------------------------------------------------------------------------------------------------------------------
# Actions.


class Course:
    """Commands of the tool centre, one a tick."""

    def __init__(self, at, tick_s):
        self.at, self.tick_s, self.places = np.array(at, float), tick_s, [np.array(at, float)]
        self.left = 0.0  # of a tick that the last move has not used up
        self.moves = []

    def wait(self, seconds):
        self.moves.append((self.at.copy(), np.zeros(3), 0.0, 0.0, 0.0, seconds))
        return self

    def move(self, by, speed, start_s=0.1, stop_s=0.1):
        """A straight way with ramps of the speed at both ends, slower where it is too short for them."""
        by = np.array(by, float)
        length = float(np.linalg.norm(by))
        speed = min(speed, length / (start_s / 2 + stop_s / 2))
        cruise = (length - speed * (start_s + stop_s) / 2) / speed
        self.moves.append((self.at.copy(), by / length, speed, start_s, stop_s, start_s + cruise + stop_s))
        self.at = self.at + by
        return self

    def commands(self):
        """Rounded to the micrometre, so that the tool follows just what the log says."""
        out, k, begin = [], 0, 0.0
        for at, u, v, start, stop, seconds in self.moves:
            while k * self.tick_s < begin + seconds - 1e-9:
                t, rest = k * self.tick_s - begin, begin + seconds - k * self.tick_s
                if v == 0.0:
                    way = 0.0
                elif t < start:
                    way = v * t * t / (2 * start)
                else:
                    way = v * (t - start / 2) - (v * (stop - rest) ** 2 / (2 * stop) if rest < stop else 0.0)
                out.append(at + way * u)
                k += 1
            begin += seconds
        out.append(self.at)
        return np.round(np.array(out), 6)


def gap(scene, yaw, rel):
    """Horizontal distance of a point from the object's side, both at its half height."""
    if scene["shape"] != "box":
        return math.hypot(*rel) - scene["size_m"][0]
    c, s = math.cos(yaw), math.sin(yaw)
    q = [abs(c * rel[0] + s * rel[1]) - scene["size_m"][0] / 2, abs(-s * rel[0] + c * rel[1]) - scene["size_m"][1] / 2]
    return math.hypot(max(q[0], 0.0), max(q[1], 0.0)) + min(max(q), 0.0)


def half_height(scene):
    return {"box": lambda s: s[2] / 2, "cylinder": lambda s: s[1] / 2, "sphere": lambda s: s[0]}[scene["shape"]](scene["size_m"])


def behind(scene, place, yaw, direction, aside):
    """Where the tool touches the object when it comes along `direction`, `aside` of the half width beside its middle."""
    u = np.array([math.cos(direction), math.sin(direction)])
    n = np.array([-u[1], u[0]])
    if scene["shape"] == "box":
        c, s = math.cos(yaw), math.sin(yaw)
        width = abs(n[0] * c + n[1] * s) * scene["size_m"][0] / 2 + abs(-n[0] * s + n[1] * c) * scene["size_m"][1] / 2
    else:
        width = scene["size_m"][0]
    t = -0.2
    while True:
        step = gap(scene, yaw, t * u + aside * width * n) - TOOL_RADIUS_M
        if step < 1e-7:
            break
        t += step
    return np.array([*(place + t * u + aside * width * n), half_height(scene)]), np.array([*u, 0.0])


def push(scene, rng, tick_s, direction, speed, aside, through_m=0.08, added_kg=0.0):
    place, yaw = rng.uniform(-0.1, 0.1, 2), rng.uniform(-math.pi, math.pi)
    touch, u = behind(scene, place, yaw, direction, aside)
    course = Course(touch - 0.03 * u, tick_s).wait(0.2).move((0.03 + through_m) * u, speed, stop_s=0.04).wait(0.15)
    course.move(-0.03 * u, 0.1).wait(0.3)
    return {"object_m": [*place, half_height(scene)], "yaw": yaw, "commands": course.commands(), "added_kg": added_kg,
            "path": direction}


def designed(scene, rng, tick_s):
    """The episodes of the designed actions, the most telling first."""
    out, number = [], 0
    turns = rng.permutation(DIRECTIONS)
    for k in range(DIRECTIONS):
        for i in range(len(SPEEDS_MPS)):
            # Every speed meets every direction, and neighbours in the list differ in both.
            direction = 2 * math.pi * turns[(k + 2 * i) % DIRECTIONS] / DIRECTIONS
            aside = 0.0 if number % 2 == 0 else 0.35 * (1 if number % 4 == 1 else -1)
            # Once a round, at another speed each time.
            added = ADDED_KG if (i + k) % 4 == (3 * k + 1) % 4 else 0.0
            out.append(push(scene, rng, tick_s, direction, SPEEDS_MPS[(i + k) % 4], aside, added_kg=added))
            number += 1
    extra = []
    for i in range(2):
        direction = rng.uniform(-math.pi, math.pi)
        place, yaw = rng.uniform(-0.1, 0.1, 2), rng.uniform(-math.pi, math.pi)
        touch, u = behind(scene, place, yaw, direction, 0.0)
        course = Course(touch - 0.03 * u + [0, 0, 0.1], tick_s).wait(0.2)
        for axis in np.eye(3):
            for way, speed in ((0.05, 0.15), (-0.1, 0.15 + 0.1 * i), (0.05, 0.1)):
                course.move(way * axis, speed).wait(0.05)
        course.move([0, 0, -0.1], 0.1).wait(0.1).move(0.05 * u, 0.08).wait(0.15).move(-0.03 * u, 0.1).wait(0.3)
        extra.append({"object_m": [*place, half_height(scene)], "yaw": yaw, "commands": course.commands(), "added_kg": 0.0})
    for lift in (0.03, 0.08):
        place, yaw = rng.uniform(-0.1, 0.1, 2), rng.uniform(-math.pi, math.pi)
        course = Course([*(place + [0.0, 0.3]), 0.1], tick_s).wait(0.6)
        extra.append({"object_m": [*place, half_height(scene) + lift], "yaw": yaw, "commands": course.commands(), "added_kg": 0.0})
    for _ in range(2):
        direction = rng.uniform(-math.pi, math.pi)
        place, yaw = rng.uniform(-0.05, 0.05, 2), rng.uniform(-math.pi, math.pi)
        touch, u = behind(scene, place, yaw, direction, 0.0)
        course = Course(touch - 0.03 * u, tick_s).wait(0.2).move(0.07 * u, 0.08, stop_s=0.04).wait(0.15).move(-0.03 * u, 0.1)
        course.wait(25.0).move(0.07 * u, 0.08, stop_s=0.04).wait(0.15).move(-0.03 * u, 0.1).wait(0.3)
        extra.append({"object_m": [*place, half_height(scene)], "yaw": yaw, "commands": course.commands(), "added_kg": 0.0})
    return out, extra


def passive(scene, rng, tick_s):
    return [push(scene, rng, tick_s, rng.uniform(-math.pi, math.pi), rng.uniform(0.04, 0.2), rng.uniform(-0.5, 0.5),
                 rng.uniform(0.04, 0.1)) for _ in range(40)], []


def chosen(pushes, extra, count):
    """A small set: free motion and a drop, none of the long ones, the others pushes from the front of the list."""
    if count is None or count >= len(pushes) + len(extra):
        return pushes + extra
    extra = extra[1:4:2]
    return pushes[:count - len(extra)] + extra


def among_obstacle(rng, scene, episodes, tick_s):
    """A fixed cylinder, and the episodes moved so that every fourth push meets it: beside the object's way, as no real rig would survive a jam."""
    radius = round(float(rng.uniform(0.02, 0.03)), 4)
    at = np.round(rng.uniform(-0.05, 0.05, 2), 4)
    p = {"shape": "cylinder", "movable": False, "x_m": float(at[0]), "y_m": float(at[1]), "yaw_rad": 0.0, "size_0_m": radius,
         "size_1_m": 0.08, "size_2_m": 0.1, "mass_kg": 1.0}
    results, pushes = [], 0
    for e in episodes:
        pushes += "path" in e
        wanted = "path" in e and pushes % 4 == 1
        for _ in range(200):
            place = np.array(e["object_m"][:2])
            target = rng.uniform(-0.15, 0.15, 2)
            if wanted:
                u = np.array([math.cos(e["path"]), math.sin(e["path"])])
                side = sign(rng) * rng.uniform(0.5, 0.9) * (0.035 + radius)
                target = at - rng.uniform(0.07, 0.11) * u - side * np.array([-u[1], u[0]])
            shift = np.round(target - place, 4)
            e["object_m"][:2] = place + shift
            e["commands"][:, :2] = np.round(e["commands"][:, :2] + shift, 6)
            if np.hypot(*(e["commands"][:, :2] - at).T).min() < radius + TOOL_RADIUS_M + 0.003 \
                    or gap(scene, e["yaw"], at - (place + shift)) < radius + 0.003:
                continue
            result = simulate(e, scene, "hidden_obstacle", p, tick_s)
            if np.abs(result[1][:, :3]).max() < JAM_N and (e["hit"] or not wanted):
                break
        else:
            raise RuntimeError("no place for a push beside the obstacle")
        results.append(result)
    return p, results


# ---------------------------------------------------------------------------------------------------------------------
# Readings.


def delayed(values, ticks):
    """Values of a tick each as of `ticks` before; the first held before."""
    at = np.clip(np.arange(len(values)) - ticks, 0.0, None)
    lower = np.floor(at).astype(int)
    upper = np.minimum(lower + 1, len(values) - 1)
    share = (at - lower)[:, None]
    return values[lower] * (1 - share) + values[upper] * share


def product(a, b):
    """Quaternions x, y, z, w, row by row."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a.T, b.T
    return np.stack([aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
                     aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz], axis=1)


def simulate(episode, scene, effect, p, tick_s, step_s=STEP_S):
    """Tool places, wrenches (first row none) and object poses (x, y, z, qx, qy, qz, qw) as they are, a row a tick."""
    commands = episode["commands"]
    sent = commands
    if effect == "actuator_gain":
        sent = commands[0] + p["gain"] * (commands - commands[0])
    if effect == "actuation_delay":
        sent = delayed(commands, p["delay_secs"] / tick_s)
    period = tick_s / p["rate"] if effect == "time_base" else tick_s
    world = World(scene, effect, p, episode["added_kg"], step_s)
    world.place(episode["object_m"], episode["yaw"], sent[0])
    poses, wrenches = [world.d.qpos[:7].copy()], []
    for place in sent[1:]:
        world.began_s = world.d.time
        wrenches.append(world.tick(place, period))
        poses.append(world.d.qpos[:7].copy())
    poses = np.array(poses)[:, [0, 1, 2, 4, 5, 6, 3]]
    if not np.isfinite(poses).all() or world.d.warning.number.sum() > 0:
        raise RuntimeError("the simulation diverged")
    episode["hit"] = world.hit
    return sent, np.array(wrenches), poses


def read(tool, wrenches, poses, effect, p, tick_s):
    """What sensors without noise make of it."""
    wrenches, poses = wrenches.copy(), poses.copy()
    if effect == "wrist_payload":
        speed = np.vstack([np.zeros(3), np.diff(tool, axis=0) / tick_s])
        force = (np.array([0, 0, -GRAVITY]) - np.diff(speed, axis=0) / tick_s) * p["mass_kg"]
        wrenches += np.hstack([force, np.cross([p["com_x_m"], p["com_y_m"], p["com_z_m"]], force)])
    elif effect == "force_bias":
        wrenches[:, :3] += [p["bias_x_n"], p["bias_y_n"], p["bias_z_n"]]
    elif effect == "force_drift":
        seconds = tick_s * np.arange(1, len(wrenches) + 1)
        wrenches[:, :3] += np.outer(seconds, [p["drift_x_nps"], p["drift_y_nps"], p["drift_z_nps"]])
    elif effect == "force_gain":
        wrenches *= p["gain"]
    elif effect == "force_low_pass":
        kept = math.exp(-tick_s / p["time_constant_secs"])
        for k in range(1, len(wrenches)):
            wrenches[k] = kept * wrenches[k - 1] + (1 - kept) * wrenches[k]
    elif effect == "force_saturation":
        wrenches[:, :3] = np.clip(wrenches[:, :3], -p["limit_n"], p["limit_n"])
    elif effect == "pose_delay":
        flips = np.cumprod(np.where((poses[1:, 3:] * poses[:-1, 3:]).sum(axis=1) < 0, -1.0, 1.0))
        poses[1:, 3:] *= flips[:, None]
        poses = delayed(poses, p["delay_secs"] / tick_s)
    elif effect == "pose_offset":
        poses[:, :3] += [p["offset_x_m"], p["offset_y_m"], p["offset_z_m"]]
    elif effect == "pose_scale":
        poses[:, :3] *= p["scale"]
    elif effect == "pose_rotation":
        c, s = math.cos(p["yaw_rad"]), math.sin(p["yaw_rad"])
        poses[:, :2] = poses[:, :2] @ np.array([[c, s], [-s, c]])
        turn = np.array([[0, 0, math.sin(p["yaw_rad"] / 2), math.cos(p["yaw_rad"] / 2)]])
        poses[:, 3:] = product(np.repeat(turn, len(poses), axis=0), poses[:, 3:])
    return wrenches, poses


def add_noise(rng, tool, wrenches, poses):
    tool = tool + rng.normal(0, NOISE["tool_position_m"], tool.shape)
    wrenches = wrenches + rng.normal(0, 1, wrenches.shape) * ([NOISE["wrist_force_n"]] * 3 + [NOISE["wrist_torque_nm"]] * 3)
    position = poses[:, :3] + rng.normal(0, NOISE["object_position_m"], (len(poses), 3))
    turn = rng.normal(0, NOISE["object_orientation_rad"], (len(poses), 3)) / 2
    q = product(np.hstack([turn, np.ones((len(poses), 1))]), poses[:, 3:])
    q /= np.linalg.norm(q, axis=1)[:, None]
    return tool, wrenches, np.hstack([position, np.where(q[:, 3:] < 0, -q, q)])


# ---------------------------------------------------------------------------------------------------------------------
# Files.


def short(value, digits):
    """Without what the noise hides anyway, and without zeros at the end."""
    text = f"{value:.{digits}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text


def header(scene, tick_s):
    pair = lambda v: f'{{ mean = {v["mean"]}, stddev = {v["stddev"]} }}'
    noise = "\n".join(f"{key} = {value}" for key, value in NOISE.items())
    return f"""# Simulated by MuJoCo {mujoco.__version__}: tests/peers/mujoco_logs.py
version = 1
robot = "none"
period_secs = {tick_s}
tool_radius_m = {TOOL_RADIUS_M}
tool_friction = {TOOL_FRICTION}
gravity_mps2 = {GRAVITY}

[table]
height_m = 0.0
friction = {pair(FRICTION)}

[object]
shape = "{scene["shape"]}"
size_m = {scene["size_m"]}
mass_kg = {pair(MASS_KG)}
com_m = [0.0, 0.0, 0.0]

[noise]
{noise}

[split]
holdout_fraction = 0.3
"""


def rows(number, episode, tick_s, tool, wrenches, poses):
    for k, (command, at, pose) in enumerate(zip(episode["commands"], tool, poses)):
        wrench = [""] * 6 if k == 0 else [short(v, 3) for v in wrenches[k - 1][:3]] + [short(v, 4) for v in wrenches[k - 1][3:]]
        yield ",".join([str(number), short(k * tick_s, 4), *(short(v, 6) for v in command), *(short(v, 5) for v in at), *wrench,
                        *(short(v, 4) for v in pose), short(episode["added_kg"], 3)])


def make_set(out, name, effect, seed, options, log=print):
    """Draws, simulates and writes one set."""
    began = time.perf_counter()
    index = int(name.split("-")[1])
    rng = np.random.default_rng([seed, index])
    tick_s = TICK_S * options.thin
    # A cylinder with its centre of mass aside topples, and lying it would roll on eight points.
    shape = "sphere" if effect == "rolling_resistance" else "cylinder" if rng.random() < 0.25 and effect not in ("pressure_distribution", "com_offset") else "box"
    errors = {"mass": float(rng.uniform(0.9, 1.1)), "friction": float(rng.uniform(0.9, 1.1))}
    if effect == "friction_level":
        errors["friction"] = 1.6
    scene = {"shape": shape, "size_m": SHAPES[shape], "mass_kg": MASS_KG["mean"] * errors["mass"],
             "friction": FRICTION["mean"] * errors["friction"]}
    draw = DRAWS.get(effect, UNKNOWN.get(effect))
    p = {key: float(value) for key, value in draw(rng).items()} if draw else {}
    pushes, extra = (designed if options.actions == "designed" else passive)(scene, rng, tick_s)
    episodes = chosen(pushes, extra, options.episodes)
    if effect == "hidden_obstacle":
        p, results = among_obstacle(rng, scene, episodes, tick_s)
    else:
        results = [simulate(e, scene, effect, p, tick_s) for e in episodes]
    peak = max(float(np.abs(w[:, :3]).max()) for _, w, _ in results)
    lines = [",".join(COLUMNS)]
    for number, (episode, (tool, wrenches, poses)) in enumerate(zip(episodes, results)):
        readings = read(tool, wrenches, poses, effect, p, tick_s)
        lines += rows(number, episode, tick_s, *add_noise(rng, tool, *readings))
    log_dir = out / "logs" / name
    shutil.rmtree(log_dir, ignore_errors=True)
    log_dir.mkdir(parents=True)
    (out / "truth").mkdir(exist_ok=True)
    (log_dir / "log.toml").write_text(header(scene, tick_s))
    (log_dir / "samples.csv").write_text("\n".join(lines) + "\n")
    known = effect == "none" or effect in DRAWS
    truth = {"name": name, "effect": effect if known else "unknown"} | ({} if known else {"kind": effect}) | {
        "parameters": p, "true_over_nominal": errors, "object": {"shape": shape, "mass_kg": scene["mass_kg"], "friction": scene["friction"]},
        "actions": options.actions, "episodes": len(episodes), "seed": seed, "episodes_with_obstacle": [i for i, e in enumerate(episodes) if e["hit"]], "peak_force_n": round(peak, 2),
        "engine": {"name": "mujoco", "version": mujoco.__version__, "timestep_s": STEP_S, "integrator": "implicitfast", "cone": "elliptic",
                   "solver": "Newton", "tolerance": 1e-13, "impratio": IMPRATIO, "impedance": IMPEDANCE,
                   "support_rate_rps_and_damping": SUPPORT, "contact_rate_rps_and_damping": ALONE, "friction_stop_rate_ps": STOP_RATE, "condim": 3}}
    (out / "truth" / f"{name}.json").write_text(json.dumps(truth, indent=1, ensure_ascii=False) + "\n")
    log(f"{name}: {len(lines) - 1} rows, {time.perf_counter() - began:.1f} s", flush=True)


# ---------------------------------------------------------------------------------------------------------------------
# Checks against closed forms.


BOX = {"shape": "box", "size_m": SHAPES["box"], "mass_kg": 0.5, "friction": 0.35}
FAR = (0.0, 1.0, 0.1)


def launched(scene, seconds, linear=0.0, spin=0.0, direction=0.0, effect="none", p=None, height=0.0):
    """A free run without the tool: poses a tick and the velocity at the end."""
    world = World(scene, effect, p)
    u = np.array([math.cos(direction), math.sin(direction), 0.0])
    world.place([0, 0, half_height(scene) + height], 0.0, FAR, linear * u, [0, 0, spin])
    poses = [world.d.qpos[:7].copy()]
    for _ in range(round(seconds / TICK_S)):
        world.began_s = world.d.time
        world.tick(np.array(FAR), TICK_S)
        poses.append(world.d.qpos[:7].copy())
    return np.array(poses), world.d.qvel.copy()


def checks():
    """Name, measured, expected, limit of the difference, unit."""
    g, mu, mass = GRAVITY, BOX["friction"], BOX["mass_kg"]
    for speed in (0.03, 0.3):
        course = Course([-0.085, 0, 0.025], TICK_S).move([0.125, 0, 0], speed)
        episode = {"object_m": [0, 0, 0.025], "yaw": 0.0, "commands": course.commands(), "added_kg": 0.0}
        _, wrenches, poses = simulate(episode, BOX, "none", {}, TICK_S)
        steady = slice(len(wrenches) // 2, len(wrenches) - 12)
        yield f"push_force_{speed}", -wrenches[steady, 0].mean(), mu * mass * g, 0.02 * mu * mass * g, "N"
        yield f"push_force_ripple_{speed}", wrenches[steady, 0].std(), 0.0, 0.03, "N"
        yield f"push_turn_{speed}", 2 * math.asin(poses[-1][5]), 0.0, 0.002, "rad"
        first = int(np.argmax(-wrenches[:, 0] > 0.5)) + 2
        yield f"impact_speed_{speed}", (poses[first, 0] - poses[first - 1, 0]) / TICK_S, speed, 0.02 * speed, "m/s"
        yield f"push_height_{speed}", poses[:, 2].max(), 0.025, 0.0001, "m"
    for speed in (0.16, 0.3, 1.0):
        slide = speed ** 2 / (2 * mu * g)
        poses, _ = launched(BOX, 1.0, linear=speed)
        yield f"slide_{speed}", poses[-1][0], slide, 0.03 * slide, "m"
    poses, v = launched(BOX, 1.0)
    yield "rest_height", poses[-1][2], 0.025, 0.0001, "m"
    poses, _ = launched(BOX, 25.0)
    yield "creep_25s", math.hypot(*poses[-1][:2]), 0.0, 0.0001, "m"
    poses, _ = launched(BOX, 25.0, effect="table_tilt", p={"slope_x_rad": math.radians(1.5), "slope_y_rad": 0.0})
    yield "creep_25s_tilted", math.hypot(*poses[-1][:2]), 0.0, 0.0002, "m"
    for height in (0.03, 0.08):
        poses, v = launched(BOX, 0.6, height=height)
        down = int(np.argmax(poses[:, 2] < 0.0251))
        yield f"rebound_{height}", float(poses[down:, 2].max()) - 0.025, 0.0, 0.0005, "m"
    inertia, corner = (0.08 ** 2 + 0.06 ** 2) / 12, math.hypot(0.04, 0.03)
    poses, _ = launched(BOX, 0.5, spin=8.0)
    turned = 8.0 ** 2 * inertia / (2 * mu * g * corner)
    yield "spin", 2 * math.asin(poses[-1][6]), turned, 0.03 * turned, "rad"
    ball = {"shape": "sphere", "size_m": SHAPES["sphere"], "mass_kg": 0.5, "friction": 0.35}
    _, v = launched(ball, 0.4, linear=0.3)
    yield "sphere_rolls", v[0], 0.3 * 5 / 7, 0.003, "m/s"
    # From rolling at 5/7 of 0.3 m/s on.
    poses, v = launched(ball, 1.0, linear=0.3, effect="rolling_resistance", p={"lever_m": 0.001})
    slowing = np.diff(poses[20:80, 0], 2).mean() / TICK_S ** 2
    yield "rolling_resistance", slowing, -5 / 7 * 0.001 * g / 0.03, 0.01, "m/s²"
    for direction in (0.0, math.pi / 2):
        factor = 1.0 + 0.3 * math.cos(2 * direction)
        poses, _ = launched(BOX, 1.0, linear=0.3, direction=direction, effect="anisotropic_friction", p={"amplitude": 0.3, "axis_rad": 0.0})
        slide = 0.09 / (2 * mu * factor * g)
        yield f"anisotropic_slide_{direction:.2f}", float(np.hypot(*poses[-1][:2])), slide, 0.03 * slide, "m"
    smooth = BOX | {"friction": 1e-5}
    _, v = launched(smooth, 0.5, linear=0.3, effect="viscous_damping", p={"coefficient_nspm": 1.0})
    yield "viscous_speed", v[0], 0.3 * math.exp(-0.5 / mass), 0.001, "m/s"
    _, v = launched(smooth, 0.5, linear=0.3, effect="quadratic_drag", p={"coefficient_ns2pm2": 3.0})
    yield "drag_speed", v[0], 0.3 / (1 + 3.0 * 0.3 * 0.5 / mass), 0.001, "m/s"
    _, v = launched(smooth, 0.5, effect="table_tilt", p={"slope_x_rad": 0.02, "slope_y_rad": 0.0})
    yield "tilt_speed", v[0], g * math.sin(0.02) * 0.5, 0.001, "m/s"
    poses, _ = launched(smooth, math.pi * math.sqrt(mass / 5.0), effect="tether", p={"stiffness_npm": 5.0, "anchor_x_m": 0.1, "anchor_y_m": 0.0})
    yield "tether_half_period", poses[-1][0], 0.2, 0.002, "m"
    course = Course([-0.061, 0, 0.025], TICK_S).wait(5.0).move([0.1, 0, 0], 0.05)
    episode = {"object_m": [0, 0, 0.025], "yaw": 0.0, "commands": course.commands(), "added_kg": ADDED_KG}
    _, wrenches, _ = simulate(episode, BOX, "mass_leak", {"rate_ps": 0.02}, TICK_S)
    left = mass * (1.0 - 0.02 * 6.0) + ADDED_KG
    yield "leaking_push_force", -wrenches[590:610, 0].mean(), mu * left * g, 0.02 * mu * left * g, "N"
    # Half the time step, pushes of all kinds: where the object ends.
    rng = np.random.default_rng(5)
    ends = []
    for _ in range(10):
        episode = push(BOX, rng, TICK_S, rng.uniform(-math.pi, math.pi), rng.uniform(0.04, 0.3), rng.uniform(-0.4, 0.4))
        a, b = (simulate(episode, BOX, "none", {}, TICK_S, step)[2][-1] for step in (STEP_S, STEP_S / 2))
        ends.append(math.hypot(*(a - b)[:2]))
    yield "half_step_end_worst", max(ends), 0.0, 0.0005, "m"


def check():
    out, fine = {}, True
    for name, value, expected, limit, unit in checks():
        inside = abs(value - expected) <= limit
        fine &= inside
        out[name] = {"measured": float(f"{value:.5g}"), "expected": float(f"{expected:.5g}"), "limit": float(f"{limit:.2g}"), "unit": unit, "ok": bool(inside)}
    print(json.dumps(out, indent=1, ensure_ascii=False))
    return 0 if fine else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--sets", help="EFFECT:COUNT,…; effects are those of the catalogue here, none, magnet, gust, tool_radius")
    parser.add_argument("--all", action="store_true", help="one of each, ten of none")
    parser.add_argument("--actions", choices=("designed", "passive"), default="designed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--thin", type=float, default=1, help="ticks of 10 ms in a tick of the log; 0.01: 10 kHz")
    parser.add_argument("--episodes", type=int, help="fewer than the 38 (passive: 40)")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    if options.check:
        return check()
    if options.out is None or not (options.sets or options.all):
        parser.error("--out and --sets or --all are needed")
    effects = []
    if options.all:
        effects = [*DRAWS, *UNKNOWN] + ["none"] * 10
    for part in options.sets.split(",") if options.sets else []:
        effect, _, count = part.partition(":")
        if effect != "none" and effect not in DRAWS and effect not in UNKNOWN:
            parser.error(f"unknown effect `{effect}`; expected none, {', '.join([*DRAWS, *UNKNOWN])}")
        effects += [effect] * int(count or 1)
    order = np.random.default_rng(options.seed).permutation(len(effects))
    for index, which in enumerate(order):
        make_set(options.out, f"set-{index:03d}", effects[which], options.seed, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
