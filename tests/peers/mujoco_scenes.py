#!/usr/bin/env python3
"""Reference answers of MuJoCo for single tool moves: defines the scenes, simulates them finely, writes one CSV.

    python tests/peers/mujoco_scenes.py            # self-checks, then write the CSV
    python tests/peers/mujoco_scenes.py --check    # self-checks only
    python tests/peers/mujoco_scenes.py --no-check # write only

One scene is one action: a 2 cm straight tool move with the minimum-jerk share 10 t^3 - 15 t^4 + 6 t^5 over 1/3 s
(20 control steps of 1/60 s), started with everything at rest.

How the accurate answer is got from MuJoCo:
- The tool is three slide joints whose qpos, qvel and acceleration (as an applied force) are overwritten before every
  step with those of the time course. A mocap body would not do: contacts see it with zero velocity.
- The tool's mass is 1e5 kg, so contacts do not move it within a step (verified: below 1e-7 m); gravcomp takes gravity
  off it.
- Every contact is an explicit <pair>, because MuJoCo's own rule is the maximum of the two coefficients; here it is
  the minimum. condim is 3.
- MuJoCo's convex contact model couples friction to the normal direction: a contact that slides at speed v pushes the
  bodies apart as if the normal speed were mu v. A contact made as hard as the time step allows therefore hops: an
  object pushed at 0.1 m/s rattles on the table, and the end pose does not converge with the time step (half a step
  changed it by 0.2 mm and 0.3 degrees in the median scene, at any step from 0.33 to 0.04 ms). So the normal direction
  is a stiff damped spring (2000 rad/s, damping ratio 1.5: some micrometres of overlap at rest, no rebound), written as
  a direct solref with the impedance 0.001, and friction has a solreffriction and an impratio of 3e4 of its own, so that
  it is nearly ideal Coulomb friction (slipping below the bound ends at 3000 1/s) that the normal force hardly notices.
  More impratio is not better: where the tool sticks to a face, the vertical friction is statically indeterminate, and
  with 1e6 the share that the first touch left there stays for the whole action and changes the push by 3 to 9 %.
  The time step, 1/48000 s, resolves that spring. Elliptic cone, Newton.
- Before the move the scene settles for 50 ms with the tool at rest; then the planar position and the yaw are put back,
  and all speeds to zero. Spheres whose centre of mass is not below or above their centre would roll and do not occur.
"""

import argparse
import math
import os
import sys

try:
    import mujoco
    import numpy as np
except ImportError:
    sys.stderr.write("missing: pip install mujoco numpy\n")
    sys.exit(3)

SEED = 20260
GRAVITY = 9.81
TRAVEL_M = 0.02
CONTROL_STEPS = 20
CONTROL_DT_S = 1.0 / 60.0
DURATION_S = CONTROL_STEPS * CONTROL_DT_S
BALL_RADIUS_M = 0.025
HAND = (  # capsules in the tool's frame: from, to, radius
    ((-0.03, 0.03, 0.0), (-0.03, 0.09, -0.03), 0.012),
    ((0.03, 0.03, 0.0), (0.03, 0.09, -0.03), 0.012),
    ((0.0, -0.03, 0.0), (0.0, -0.09, -0.03), 0.012),
)
BALL = (((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), BALL_RADIUS_M),)
TABLE_FRICTION = 1.0
TOOL_FRICTION = 0.2
OBSTACLE_FRICTION = 0.5
TOOL_MASS_KG = 1e5
SUBSTEPS = 800  # per control step: h = 1/48000 s
SETTLE_S = 0.05
CONTACT_RATE = 2000.0  # natural frequency of a contact, rad/s
DAMPING = 1.5  # damping ratio of a contact
STOP_RATE = 3000.0  # rate at which friction ends slipping below the Coulomb bound, 1/s
IMPEDANCE = 1e-3
IMPRATIO = 3e4
HALF = math.sqrt(0.5)
DIRECTIONS = [(1, 0, 0), (HALF, HALF, 0), (0, 1, 0), (-HALF, HALF, 0), (-1, 0, 0), (-HALF, -HALF, 0), (0, -1, 0),
              (HALF, -HALF, 0), (0, 0, 1), (0, 0, -1)]
UP, DOWN = 8, 9
PEAK_LIMIT_N = 60.0

# Scenes whose first draw squeezes the object, misses what it is to touch or sits at a bifurcation: the draw taken.
REDRAW = {26: 6, 28: 1, 30: 6, 36: 1, 46: 2, 55: 6, 56: 6, 57: 2, 58: 20, 59: 2, 60: 1, 61: 1}


# ---------------------------------------------------------------------------------------------------------------------
# Geometry, for the definition of scenes only.


class Body:
    """An upright box, cylinder or sphere."""

    def __init__(self, shape, size, pos=(0.0, 0.0, 0.0), yaw=0.0, mass=1.0, com=(0.0, 0.0, 0.0), friction=0.5,
                 movable=True):
        self.shape, self.size, self.pos, self.yaw = shape, tuple(size), tuple(pos), yaw
        self.mass, self.com, self.friction, self.movable = mass, tuple(com), friction, movable

    def half_height(self):
        return {"box": self.size[2] / 2 if self.shape == "box" else 0, "cylinder": self.size[1] / 2,
                "sphere": self.size[0]}[self.shape]

    def inertia(self):
        m = self.mass
        if self.shape == "box":
            x, y, z = self.size
            return m * (y * y + z * z) / 12, m * (x * x + z * z) / 12, m * (x * x + y * y) / 12
        if self.shape == "cylinder":
            r, h, _ = self.size
            return m * (3 * r * r + h * h) / 12, m * (3 * r * r + h * h) / 12, m * r * r / 2
        return (0.4 * m * self.size[0] ** 2,) * 3

    def half_width(self, d):
        """Half the extent along the horizontal unit vector d."""
        if self.shape != "box":
            return self.size[0]
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return abs(d[0] * c + d[1] * s) * self.size[0] / 2 + abs(-d[0] * s + d[1] * c) * self.size[1] / 2

    def distance(self, p):
        """Signed distance of a point from the surface."""
        dx, dy, dz = (p[i] - self.pos[i] for i in range(3))
        if self.shape == "sphere":
            return math.sqrt(dx * dx + dy * dy + dz * dz) - self.size[0]
        if self.shape == "cylinder":
            q = (math.hypot(dx, dy) - self.size[0], abs(dz) - self.size[1] / 2)
        else:
            c, s = math.cos(self.yaw), math.sin(self.yaw)
            lx, ly = c * dx + s * dy, -s * dx + c * dy
            q = (abs(lx) - self.size[0] / 2, abs(ly) - self.size[1] / 2, abs(dz) - self.size[2] / 2)
        return math.sqrt(sum(max(v, 0.0) ** 2 for v in q)) + min(max(q), 0.0)

    def corners(self):
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return [(self.pos[0] + c * x - s * y, self.pos[1] + s * x + c * y)
                for x, y in ((a * self.size[0] / 2, b * self.size[1] / 2)
                             for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1)))]


def capsule_distance(center, capsule, body):
    """Signed distance between one capsule of the tool and a body: the distance is convex along the axis."""
    a, b, r = capsule

    def at(t):
        return body.distance([center[i] + a[i] + t * (b[i] - a[i]) for i in range(3)])

    if a == b:
        return at(0.0) - r
    lo, hi = 0.0, 1.0
    for _ in range(50):
        u, v = lo + (hi - lo) / 3, hi - (hi - lo) / 3
        if at(u) < at(v):
            hi = v
        else:
            lo = u
    return min(at(lo), at(0.0), at(1.0)) - r


def tool_distance(center, tool, bodies):
    return min(capsule_distance(center, c, b) for c in (BALL if tool == "ball" else HAND) for b in bodies)


def segment_distance(p, a, b):
    t = ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
    t = min(max(t, 0.0), 1.0)
    return math.hypot(p[0] - a[0] - t * (b[0] - a[0]), p[1] - a[1] - t * (b[1] - a[1]))


def body_distance(a, b):
    """Distance of two upright bodies on the table (seen from above, spheres by their centres); negative if they meet."""
    if a.shape == "box" and b.shape == "box":
        ca, cb = a.corners(), b.corners()
        if any(b.distance((p[0], p[1], b.pos[2])) < 0 for p in ca) or \
                any(a.distance((p[0], p[1], a.pos[2])) < 0 for p in cb):
            return -1.0
        return min([segment_distance(p, cb[i - 1], cb[i]) for p in ca for i in range(4)]
                   + [segment_distance(p, ca[i - 1], ca[i]) for p in cb for i in range(4)])
    if a.shape == "box":
        a, b = b, a
    if a.shape == "sphere" and b.shape == "sphere":
        return math.dist(a.pos, b.pos) - a.size[0] - b.size[0]
    return b.distance((a.pos[0], a.pos[1], b.pos[2] if b.shape != "sphere" else a.pos[2])) - a.size[0]


def approach(distance, start, u, gap):
    """Point start + t u, t from -0.4 m upwards, at which the distance first falls to the gap."""
    t, at = -0.4, lambda t: [start[i] + t * u[i] for i in range(3)]
    while True:  # the distance cannot fall faster than t grows
        step = distance(at(t)) - gap
        if step < 1e-9:
            return at(t)
        t += step
        if t > 0.4:
            raise ValueError("the tool's path misses")


# ---------------------------------------------------------------------------------------------------------------------
# Scenes.


class Scene:
    def __init__(self, name, obj, obstacle, tool, tool_pos, direction):
        self.name, self.object, self.obstacle = name, obj, obstacle
        self.tool, self.tool_pos, self.direction = tool, tuple(round(v, 6) for v in tool_pos), direction


class Draw:
    """Uniform numbers of one scene; only Generator.random is used, whose stream NumPy keeps stable."""

    def __init__(self, number, attempt):
        self.rng = np.random.default_rng([SEED, number, attempt])

    def __call__(self, lo, hi, digits=4):
        return round(lo + (hi - lo) * float(self.rng.random()), digits)

    def sign(self):
        return 1.0 if self.rng.random() < 0.5 else -1.0

    def pick(self, *values):
        return values[int(len(values) * self.rng.random())]


def draw_object(d, shape, flat=False, low_friction=None, yaw=None):
    mass, friction = d(0.1, 2.0, 3), d(0.1, 0.9, 3)
    if low_friction:
        friction = d(0.1, low_friction, 3)
    x, y = d(-0.25, 0.25), d(0.3, 0.6)
    yaw_drawn = d(-math.pi / 4, math.pi / 4)
    yaw = yaw_drawn if yaw is None else yaw
    if shape == "box":
        size = (d(0.05, 0.11), d(0.05, 0.11), d(0.04, 0.05) if flat else d(0.07, 0.11))
        limit = (0.35 * size[0], 0.35 * size[1], 0.25 * size[2])
    elif shape == "cylinder":
        size = (d(0.025, 0.055), d(0.07, 0.11), 0.0)
        limit = (0.4 * size[0], 0.4 * size[0], 0.25 * size[1])
    else:
        size = (d(0.035, 0.055), 0.0, 0.0)
        limit = (0.0, 0.0, 0.4 * size[0])
    com = [round(min(0.02, l) * d(-1.0, 1.0), 4) for l in limit]
    if shape == "sphere":
        com = [0.0, 0.0, -abs(com[2])]
        yaw = 0.0
    body = Body(shape, size, yaw=yaw, mass=mass, com=com, friction=friction)
    body.pos = (x, y, round(body.half_height(), 6))
    return body


def tool_height(d, tool, body, direction):
    if tool == "hand":
        return d(0.06, 0.07)
    top = 2 * body.half_height()
    return d(0.03, min(0.07, max(0.035, top - 0.01)))


def along(body, u, n, lateral, z):
    return (body.pos[0] + lateral * n[0], body.pos[1] + lateral * n[1], z)


def draw_obstacle(d, movable, shape=None):
    shape_drawn = d.pick("box", "box", "cylinder", "sphere")
    shape = shape or shape_drawn
    size = {"box": (d(0.04, 0.08), d(0.04, 0.08), d(0.07, 0.1)), "cylinder": (d(0.02, 0.04), d(0.07, 0.1), 0.0),
            "sphere": (d(0.03, 0.045), 0.0, 0.0)}[shape]
    yaw = d(-0.6, 0.6) if shape == "box" else 0.0
    body = Body(shape, size, yaw=yaw, mass=d(0.2, 2.0, 3), friction=OBSTACLE_FRICTION, movable=movable)
    body.pos = (0.0, 0.0, round(body.half_height(), 6))
    return body


def make(number, kind, tool, shape):
    attempt = REDRAW.get(number, 0)
    d = Draw(number, attempt)
    name = f"{kind}_{shape}_{tool}_{number:02d}"
    if kind in ("lift", "press", "over"):
        return make_vertical(d, name, kind, tool, shape)
    flat = kind == "flat"
    obj = draw_object(d, shape, flat=flat, yaw=0.0 if kind == "square" else None)
    # The hand pushes with its fingers along +y, with its thumb along -y and with a side along x, in turn.
    which = int(8 * d.rng.random())
    direction = (2, 2, 1, 3, 6, 0, 4)[number % 7] if tool == "hand" else which
    if kind == "square":
        direction = (0, 2, 4, 6)[number % 4]
    u = DIRECTIONS[direction]
    n = (-u[1], u[0], 0.0)
    z = tool_height(d, tool, obj, u)
    width = obj.half_width(n)
    share = {"square": 0.0, "free": d(-0.6, 0.6), "edge": d.sign() * d(0.7, 0.95), "glance": d.sign() * d(1.05, 1.25),
             "flat": d(-0.5, 0.5)}.get(kind, 0.0)
    gap = d(0.0, 0.008)
    if number % 4 == 0:
        gap = 0.0
    lateral = share * width
    if kind == "glance":  # past the side: only the flank of the ball touches
        lateral = math.copysign(width + BALL_RADIUS_M * d(0.25, 0.6), share)
        gap = d(0.0, 0.003)
    obstacle = None
    targets = [obj]
    if kind in ("graze", "hit"):
        side = d.sign()
        obstacle = draw_obstacle(d, False)
        overlap = d(0.001, 0.004) if kind == "graze" else d(0.006, 0.014)
        b = side * (width + obstacle.half_width(n) - overlap)
        place_obstacle(obstacle, obj, u, n, b, d(0.001, 0.006))
        lateral = -side * d(0.0, 0.35) * width
        gap = d(0.0, 0.002)
    elif kind == "through":
        obstacle = draw_obstacle(d, True)
        b = d(-0.7, 0.7) * (width + obstacle.half_width(n))
        place_obstacle(obstacle, obj, u, n, b, d(0.0005, 0.008))
        lateral = d(-0.4, 0.4) * width
        gap = d(0.0, 0.003)
    elif kind == "both":  # the tool hits an obstacle that stands before the object, and pushes the object through it
        obstacle = draw_obstacle(d, True)
        b = d(-0.5, 0.5) * (width + obstacle.half_width(n))
        place_obstacle(obstacle, obj, tuple(-v for v in u), n, b, d(0.001, 0.008))
        lateral = b + d(-0.4, 0.4) * obstacle.half_width(n)
        gap = d(0.0, 0.003)
    elif kind == "beside":  # the tool pushes the object and an obstacle beside it at once
        side = d.sign()
        obstacle = draw_obstacle(d, True)
        b = side * (width + obstacle.half_width(n) + d(0.003, 0.01))
        obstacle.pos = tuple(round(obj.pos[i] + b * n[i] + d(-0.01, 0.01) * u[i], 5) for i in range(2)) \
            + (obstacle.pos[2],)
        lateral = side * d(0.75, 0.95) * width
        gap = d(0.0, 0.004)
    if obstacle:
        targets.append(obstacle)
    # At least 2 micrometres, so that the rounding of positions makes no overlap.
    start = approach(lambda p: tool_distance(p, tool, targets), along(obj, u, n, lateral, z), u, max(gap, 2e-6))
    return Scene(name, obj, obstacle, tool, start, direction)


def place_obstacle(obstacle, obj, u, n, b, gap):
    """Puts the obstacle ahead of the object, b to the left of its path, the gap away from it."""
    a = 0.3
    while a > -0.3:  # from afar towards the object
        obstacle.pos = tuple(round(obj.pos[i] + b * n[i] + a * u[i], 5) for i in range(2)) + (obstacle.pos[2],)
        rest = body_distance(obj, obstacle) - gap
        if rest <= 1e-5:
            return
        a -= rest
    raise ValueError("the obstacle is out of the way")


def make_vertical(d, name, kind, tool, shape):
    obj = draw_object(d, shape, low_friction=0.3 if kind == "press" and shape != "sphere" else None)
    direction = {"lift": UP, "press": DOWN, "over": int(8 * d.rng.random())}[kind]
    u = DIRECTIONS[direction]
    top = 2 * obj.half_height()
    phi = d(-math.pi, math.pi)
    e = (math.cos(phi), math.sin(phi), 0.0)
    if kind == "over":  # 5 mm above the top
        z = top + 0.005 + (BALL_RADIUS_M if tool == "ball" else 0.042)
        start = [obj.pos[0] - 0.01 * u[0], obj.pos[1] - 0.01 * u[1], z]
    elif kind == "lift" and shape == "sphere":  # from below the equator: lifts and shoves
        start = approach(lambda p: tool_distance(p, tool, [obj]), (obj.pos[0], obj.pos[1], 0.03 if tool == "ball"
                                                                   else 0.06), [-v for v in e], 0.0005)
    elif kind == "lift":  # along a face, not touching it
        start = approach(lambda p: tool_distance(p, tool, [obj]), (obj.pos[0], obj.pos[1], 0.04 if tool == "ball"
                                                                   else 0.06), [-v for v in e], 0.0002)
    elif shape == "sphere":  # on the flank, past the friction cones: the sphere is squeezed out
        polar = d(0.9, 1.2)
        reach = (obj.size[0] + BALL_RADIUS_M) * math.sin(polar)
        start = approach(lambda p: tool_distance(p, tool, [obj]),
                         (obj.pos[0] + reach * e[0], obj.pos[1] + reach * e[1], 0.2), DIRECTIONS[DOWN], 0.0)
        start[2] += d(0.014, 0.017)
    else:  # on an upper edge, the ball's centre beyond it: the object is wedged aside
        local = d.pick(0.0, math.pi / 2, math.pi, -math.pi / 2)
        if shape == "cylinder":
            reach = obj.size[0]
        else:
            e = (math.cos(obj.yaw + local), math.sin(obj.yaw + local), 0.0)
            reach = obj.half_width(e)
        reach += BALL_RADIUS_M * d(0.6, 0.8)
        start = approach(lambda p: tool_distance(p, tool, [obj]),
                         (obj.pos[0] + reach * e[0], obj.pos[1] + reach * e[1], 0.2), DIRECTIONS[DOWN], 0.0)
        start[2] += d(0.014, 0.017)
    return Scene(name, obj, None, tool, start, direction)


PLAN = [  # kind, tool, shapes in turn
    ("square", "ball", ["box", "cylinder", "sphere", "box"]),
    ("free", "ball", ["box", "box", "box", "cylinder", "cylinder", "sphere", "sphere"]),
    ("edge", "ball", ["box", "box", "cylinder"]),
    ("glance", "ball", ["box", "cylinder", "box"]),
    ("flat", "ball", ["box", "box", "box"]),
    ("lift", "ball", ["box", "sphere"]),
    ("press", "ball", ["sphere", "box", "cylinder"]),
    ("over", "ball", ["box"]),
    ("graze", "ball", ["box", "cylinder", "box", "sphere", "box"]),
    ("hit", "ball", ["box", "cylinder", "box", "sphere", "box"]),
    ("through", "ball", ["box", "cylinder", "box", "sphere", "box", "cylinder"]),
    ("both", "ball", ["box", "cylinder", "sphere"]),
    ("beside", "ball", ["box", "cylinder", "box"]),
    ("free", "hand", ["box", "cylinder", "box", "sphere", "box", "cylinder", "box"]),
    ("graze", "hand", ["box", "cylinder"]),
    ("hit", "hand", ["box", "cylinder", "box"]),
    ("through", "hand", ["box", "cylinder", "sphere", "box"]),
    ("lift", "hand", ["box"]),
    ("over", "hand", ["cylinder"]),
]


def scenes():
    out, number = [], 0
    for kind, tool, shapes in PLAN:
        for shape in shapes:
            out.append(make(number, kind, tool, shape))
            number += 1
    return out


# ---------------------------------------------------------------------------------------------------------------------
# Simulation.


def geom(body, name):
    if body.shape == "box":
        size = " ".join(repr(v / 2) for v in body.size)
    elif body.shape == "cylinder":
        size = f"{body.size[0]!r} {body.size[1] / 2!r}"
    else:
        size = repr(body.size[0])
    return f'<geom name="{name}" type="{body.shape}" size="{size}" contype="0" conaffinity="0"/>'


def quat(yaw):
    return f"{math.cos(yaw / 2)!r} 0 0 {math.sin(yaw / 2)!r}"


def model(scene, h):
    """The compiled model of a scene. qpos: tool (3), object (7), movable obstacle (7)."""
    obj, obstacle = scene.object, scene.obstacle
    tool_geoms, tool_names = [], []
    for i, (a, b, r) in enumerate(BALL if scene.tool == "ball" else HAND):
        tool_names.append(f"tool{i}")
        tool_geoms.append(f'<geom name="tool{i}" type="sphere" size="{r}" contype="0" conaffinity="0"/>' if a == b else
                          f'<geom name="tool{i}" type="capsule" fromto="{" ".join(map(repr, a + b))}" size="{r}" '
                          f'contype="0" conaffinity="0"/>')
    bodies, pairs = [], [("table", "object", min(TABLE_FRICTION, obj.friction))]
    pairs += [(t, "object", min(TOOL_FRICTION, obj.friction)) for t in tool_names]
    for name, body in (("object", obj), ("obstacle", obstacle)):
        if body is None:
            continue
        free = name == "object" or body.movable
        inertial = ""
        if free:
            inertial = f'<freejoint/><inertial pos="{" ".join(map(repr, body.com))}" mass="{body.mass!r}" ' \
                       f'diaginertia="{" ".join(map(repr, body.inertia()))}"/>'
        bodies.append(f'<body name="{name}" pos="{" ".join(map(repr, body.pos))}" quat="{quat(body.yaw)}">'
                      f'{inertial}{geom(body, name)}</body>')
        if name == "obstacle":
            pairs += [("object", "obstacle", min(OBSTACLE_FRICTION, obj.friction))]
            if free:
                pairs += [("table", "obstacle", min(TABLE_FRICTION, OBSTACLE_FRICTION))]
            pairs += [(t, "obstacle", min(TOOL_FRICTION, OBSTACLE_FRICTION)) for t in tool_names]
    pair_xml = "".join(
        f'<pair geom1="{a}" geom2="{b}" condim="3" friction="{f!r} {f!r} 0 0 0" solref="{-CONTACT_RATE ** 2!r} {-2 * DAMPING * CONTACT_RATE!r}" '
        f'solreffriction="{-CONTACT_RATE ** 2!r} {-STOP_RATE * IMPEDANCE!r}" '
        f'solimp="{IMPEDANCE} {IMPEDANCE} 0.001 0.5 2"/>' for a, b, f in pairs)
    xml = f"""<mujoco><compiler angle="radian"/>
<option timestep="{h!r}" gravity="0 0 {-GRAVITY}" cone="elliptic" impratio="{IMPRATIO}" solver="Newton" iterations="200"
 ls_iterations="200" tolerance="1e-14" ls_tolerance="1e-6" ccd_iterations="200" ccd_tolerance="1e-9"
 integrator="implicitfast" jacobian="dense"><flag island="disable"/></option>
<worldbody><geom name="table" type="plane" size="0 0 1" contype="0" conaffinity="0"/>
<body name="tool" pos="{" ".join(map(repr, scene.tool_pos))}" gravcomp="1">
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
<inertial pos="0 0 0" mass="{TOOL_MASS_KG!r}" diaginertia="1 1 1"/>{"".join(tool_geoms)}</body>
{"".join(bodies)}</worldbody><contact>{pair_xml}</contact></mujoco>"""
    return mujoco.MjModel.from_xml_string(xml)


class Result:
    pass


def minimum_jerk(t):
    t = min(max(t, 0.0), 1.0)
    return t * t * t * (10 - 15 * t + 6 * t * t), 30 * t * t * (1 - t) ** 2


def tool_wrench(m, d, tool_geoms):
    """Force of the world on the tool and its torque about the tool's centre, world axes, of the step just taken."""
    out = np.zeros(6)
    if d.ncon == 0:
        return out
    geoms = d.contact.geom
    f = np.zeros(6)
    center = d.xpos[1]
    for i in range(d.ncon):
        a, b = int(geoms[i, 0]), int(geoms[i, 1])
        if a not in tool_geoms and b not in tool_geoms:
            continue
        mujoco.mj_contactForce(m, d, i, f)
        c = d.contact[i]
        # The frame's rows are the normal from geom 1 to geom 2 and two tangents; the force is that on geom 2.
        force = c.frame.reshape(3, 3).T @ f[:3]
        if a in tool_geoms:
            force = -force
        out[:3] += force
        out[3:] += np.cross(c.pos - center, force)
    return out


def simulate(scene, substeps=SUBSTEPS, speed=None, record=None):
    """Runs one action. With a speed (m/s), the tool moves at it steadily instead, for the same time."""
    h = CONTROL_DT_S / substeps
    m = model(scene, h)
    d = mujoco.MjData(m)
    mujoco.mj_resetData(m, d)
    u = np.array(DIRECTIONS[scene.direction], dtype=float)
    tool_geoms = {g for g in range(m.ngeom) if m.geom_bodyid[g] == 1}
    r = Result()
    start = d.qpos.copy()
    hold = np.zeros(3)
    for _ in range(round(SETTLE_S / h)):
        d.qpos[:3], d.qvel[:3], d.qfrc_applied[:3] = hold, hold, hold
        mujoco.mj_step(m, d)
    r.drift = 0.0
    for first in range(3, m.nq, 7):
        r.drift = max(r.drift, float(np.hypot(*(d.qpos[first:first + 2] - start[first:first + 2]))))
        d.qpos[first:first + 2] = start[first:first + 2]
        # Put the yaw back: the settled tilt is below 1e-5 rad.
        d.qpos[first + 3:first + 7] = start[first + 3:first + 7]
    d.qvel[:] = 0
    d.qfrc_applied[:] = 0
    mujoco.mj_forward(m, d)
    r.contacts = sum(1 for c in d.contact if {"table", "object"} == {m.geom(c.geom1).name, m.geom(c.geom2).name})
    total, per_control, r.peak, r.tool_error, r.depth = np.zeros(6), np.zeros(6), 0.0, 0.0, 0.0
    r.series, r.touched = [], set()
    steps = CONTROL_STEPS * substeps
    course = [minimum_jerk(k / steps) for k in range(steps + 1)] if speed is None else \
        [(speed * k * h / TRAVEL_M, speed * DURATION_S / TRAVEL_M) for k in range(steps + 1)]
    rate = TRAVEL_M / DURATION_S
    for k in range(steps):
        share, v = course[k]
        v_next = course[k + 1][1]
        d.qpos[:3] = TRAVEL_M * share * u
        d.qvel[:3] = rate * v * u
        d.qfrc_applied[:3] = TOOL_MASS_KG * rate * (v_next - v) / h * u
        mujoco.mj_step(m, d)
        if d.ncon:
            per_control += tool_wrench(m, d, tool_geoms)
            r.touched.update(map(tuple, d.contact.geom.tolist()))
            r.depth = min(r.depth, float(d.contact.dist.min()))
        r.tool_error = max(r.tool_error, float(np.abs(d.qvel[:3] - rate * v_next * u).max() * h))
        if (k + 1) % substeps == 0:
            mean = per_control / substeps
            r.peak = max(r.peak, float(np.linalg.norm(mean[:3])))
            r.series.append(mean)
            total += mean
            per_control[:] = 0
        if record is not None:
            record.append(d.qpos.copy())
    r.wrench = total / CONTROL_STEPS
    r.object = d.qpos[3:10].copy()
    r.object_velocity = d.qvel[3:9].copy()
    r.obstacle = None
    if scene.obstacle is not None:
        b = scene.obstacle
        r.obstacle = d.qpos[10:17].copy() if b.movable else \
            np.array([*b.pos, math.cos(b.yaw / 2), 0, 0, math.sin(b.yaw / 2)])
    return r


def angle_deg(a, b):
    return math.degrees(2 * math.acos(min(1.0, abs(float(np.dot(a, b))))))


# ---------------------------------------------------------------------------------------------------------------------
# Self-checks.


class Failed(Exception):
    pass


def expect(ok, text):
    print(("ok      " if ok else "FAILED  ") + text, flush=True)
    if not ok:
        raise Failed(text)


def launch(shape, size, speed, friction, seconds):
    """Free body launched without turning: final state (velocity, position) of the centre."""
    h = CONTROL_DT_S / SUBSTEPS
    body = Body(shape, size, mass=0.7, friction=friction)
    body.pos = (0.0, 0.0, body.half_height())
    m = model(Scene("launch", body, None, "ball", (0.0, 0.0, 5.0), 0), h)
    d = mujoco.MjData(m)
    d.qvel[3] = speed
    hold = np.zeros(3)
    for _ in range(round(seconds / h)):
        d.qpos[:3], d.qvel[:3] = hold, hold
        mujoco.mj_step(m, d)
    return float(d.qvel[3]), float(d.qpos[3])


def check(all_scenes, base):
    body = Body("box", (0.08, 0.08, 0.07), pos=(0.4, 0.1, 0.035), mass=0.6, friction=0.45)
    push = simulate(Scene("push", body, None, "ball", (0.4 - 0.065, 0.1, 0.035), 0), speed=0.05)
    steady = push.series[-1]
    want = -body.friction * body.mass * GRAVITY
    expect(abs(steady[0] / want - 1) < 0.01 and np.abs(steady[1:]).max() < 0.01 * abs(want),
           f"steady central push: {steady[0]:.6f} N along the push, -mu m g = {want:.6f} N")
    _, x = launch("box", (0.1, 0.1, 0.04), 1.0, 0.4, 0.4)
    want = 1.0 / (2 * 0.4 * GRAVITY)
    expect(abs(x / want - 1) < 0.01, f"slide of a launched box: {x:.6f} m, v^2/(2 mu g) = {want:.6f} m")
    v, _ = launch("sphere", (0.04, 0, 0), 1.0, 0.4, 0.4)
    expect(abs(v * 7 / 5 - 1) < 0.01, f"launched sphere rolls at {v:.6f} m/s, 5/7 = {5 / 7:.6f} m/s")
    boxes = [r.contacts for s, r in zip(all_scenes, base) if s.object.shape == "box"]
    expect(set(boxes) == {4}, f"{len(boxes)} boxes rest on 4 contacts each")
    drift = max(r.drift for r in base)
    expect(drift < 1e-5, f"settling moves nothing sideways by more than {drift:.1e} m")
    error = max(r.tool_error for r in base)
    expect(error < 1e-7, f"a step moves the tool off its course by at most {error:.1e} m")
    depth = min(r.depth for r in base)
    expect(depth > -1e-4, f"deepest overlap of any contact at any step: {-depth * 1e3:.4f} mm")
    names = [s.name for s in all_scenes]
    expect(len(set(names)) == len(names) >= 60, f"{len(names)} scenes, names unique")
    peak = max((r.peak, s.name) for s, r in zip(all_scenes, base))
    expect(peak[0] < PEAK_LIMIT_N, f"largest mean force of a control step: {peak[0]:.2f} N in {peak[1]}")
    rows = []
    for s, r in zip(all_scenes, base):
        fine = simulate(s, substeps=2 * SUBSTEPS)
        poses = [(r.object, fine.object)] + ([(r.obstacle, fine.obstacle)] if r.obstacle is not None else [])
        mm = max(1e3 * float(np.linalg.norm(a[:3] - b[:3])) for a, b in poses)
        deg = max(angle_deg(a[3:], b[3:]) for a, b in poses)
        force = float(np.linalg.norm(fine.wrench[:3] - r.wrench[:3])) / max(0.05, float(np.linalg.norm(fine.wrench[:3])))
        rows.append((max(mm / 0.2, deg / 0.5), mm, deg, force, s.name))
    rows.sort(reverse=True)
    print("half the time step changes the end pose most in:")
    for worst, mm, deg, force, name in rows[:8]:
        print(f"    {name:28s} {mm:8.4f} mm {deg:8.4f} deg, mean force {100 * force:6.2f} %"
              + ("  DEGENERATE" if worst >= 1 else ""))
    good = sum(1 for row in rows if row[0] < 1) / len(rows)
    print(f"median {np.median([r[1] for r in rows]):.5f} mm {np.median([r[2] for r in rows]):.5f} deg, "
          f"mean force {100 * np.median([r[3] for r in rows]):.3f} % (largest {100 * max(r[3] for r in rows):.2f} %)")
    expect(good >= 0.95, f"{100 * good:.1f} % of the scenes move by less than 0.2 mm and 0.5 deg")


# ---------------------------------------------------------------------------------------------------------------------
# Output.

COLUMNS = (
    ["name", "object_shape", "object_size_0", "object_size_1", "object_size_2", "object_mass_kg", "object_com_x_m",
     "object_com_y_m", "object_com_z_m", "object_friction", "object_x_m", "object_y_m", "object_z_m",
     "object_yaw_rad", "obstacle_shape", "obstacle_movable", "obstacle_mass_kg", "obstacle_size_0",
     "obstacle_size_1", "obstacle_size_2", "obstacle_x_m", "obstacle_y_m", "obstacle_z_m", "obstacle_yaw_rad", "tool",
     "tool_x_m", "tool_y_m", "tool_z_m", "direction_x", "direction_y", "direction_z"]
    + [f"{b}_end_{c}" for b in ("object", "obstacle") for c in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    + ["force_x_n", "force_y_n", "force_z_n", "torque_x_nm", "torque_y_nm", "torque_z_nm", "peak_force_n"])


def number(v):
    text = f"{0.0 if abs(v) < 1e-12 else v:.9g}"
    return "0" if text == "-0" else text


def end_pose(q):
    sign = -1.0 if q[3] < 0 else 1.0
    return [*q[:3], *(sign * v for v in q[4:7]), sign * q[3]]


def row(s, r):
    o, b = s.object, s.obstacle
    cells = [s.name, o.shape, *o.size, o.mass, *o.com, o.friction, *o.pos, o.yaw]
    if b is None:
        cells += ["none", 0, 0, 0, 0, 0, 0, 0, 0, 0]
    else:
        cells += [b.shape, int(b.movable), b.mass if b.movable else 0, *b.size, *b.pos, b.yaw]
    cells += [s.tool, *s.tool_pos, *DIRECTIONS[s.direction], *end_pose(r.object)]
    cells += [""] * 7 if b is None else end_pose(r.obstacle)
    cells += [*r.wrench, r.peak]
    assert len(cells) == len(COLUMNS)
    return ",".join(c if isinstance(c, str) else number(float(c)) for c in cells)


def header():
    h = CONTROL_DT_S / SUBSTEPS
    return f"""# Single tool moves as simulated by MuJoCo {mujoco.__version__}; written by: python tests/peers/mujoco_scenes.py
# Move: 0.02 m along direction with the share 10 t^3 - 15 t^4 + 6 t^5 over 1/3 s (20 control steps of 1/60 s), from rest.
# MuJoCo: time step 1/{round(1 / h)} s, implicitfast, elliptic cone, Newton (tolerance 1e-14), condim 3, explicit pairs;
# contacts {CONTACT_RATE:.0f} rad/s with damping ratio {DAMPING}, impedance {IMPEDANCE}, impratio {IMPRATIO:.0e}; settled for {SETTLE_S} s before the move.
# Contacts: Coulomb, coefficient = smaller of the two bodies' (table 1, tool 0.2, obstacle 0.5), restitution 0; g = 9.81.
# Sizes, m: box full lengths x y z; cylinder radius, height, -; sphere radius, -, -. Obstacle mass 0: fixed.
# Tool: ball of radius 0.025; hand: capsules in the tool's frame (base axes), radius 0.012: (-0.03,0.03,0)-(-0.03,0.09,-0.03),
# (0.03,0.03,0)-(0.03,0.09,-0.03), (0,-0.03,0)-(0,-0.09,-0.03). Table: plane z = 0. Base frame, z up, SI units.
# Positions are those of the shape's centre; object_com is the centre of mass from there in the body's frame; the inertia
# about the centre of mass is that of the uniform solid about its own centre. Quaternion: qx qy qz qw, qw >= 0.
# force, torque: by the world on the tool, mean over the move, torque about the tool's centre (moving), base axes.
# peak_force: largest magnitude among the 20 means over one control step.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    here = os.path.dirname(os.path.abspath(__file__))
    parser.add_argument("--out", default=os.path.join(here, "..", "..", "crates", "physics-model", "tests", "data",
                                                      "mujoco_scenes.csv"))
    parser.add_argument("--check", action="store_true", help="self-checks only, writes nothing")
    parser.add_argument("--no-check", action="store_true", help="writes without the self-checks")
    args = parser.parse_args()
    all_scenes = scenes()
    base = [simulate(s) for s in all_scenes]
    if not args.no_check or args.check:
        try:
            check(all_scenes, base)
        except Failed:
            sys.exit(1)
    if not args.check:
        with open(args.out, "w", encoding="ascii", newline="\n") as out:
            out.write(header())
            out.write(",".join(COLUMNS) + "\n")
            for s, r in zip(all_scenes, base):
                out.write(row(s, r) + "\n")
        print(f"{len(all_scenes)} scenes written to {os.path.relpath(args.out)}")


if __name__ == "__main__":
    main()
