"""What is done to the object: tool courses that are smooth in time, and tosses. Nothing here knows an engine."""

import math
from dataclasses import dataclass

import numpy as np

from scene import log_uniform, sign


class Course:
    """A way of the tool centre: straight moves with ramps of the speed at both ends, and waits."""

    def __init__(self, at):
        self.at, self.moves, self.end_s = np.array(at, float), [], 0.0
        self.start = self.at.copy()

    def wait(self, seconds):
        self.end_s += seconds
        return self

    def move(self, by, speed, start_s=0.08, stop_s=0.08):
        by = np.array(by, float)
        length = float(np.linalg.norm(by))
        if length < 1e-9:
            return self
        speed = min(speed, length / (start_s / 2 + stop_s / 2))
        cruise = (length - speed * (start_s + stop_s) / 2) / speed
        self.moves.append((self.end_s, by / length, speed, start_s, cruise, stop_s))
        self.end_s += start_s + cruise + stop_s
        self.at = self.at + by
        return self

    def places(self, times):
        """`[time, 3]`; before the begin and after the end it rests."""
        out = np.repeat(self.start[None], len(times), axis=0)
        for begin, u, v, start, cruise, stop in self.moves:
            t = np.clip(times - begin, 0.0, start + cruise + stop)
            a, c = np.minimum(t, start), np.clip(t - start, 0.0, cruise)
            b = np.clip(t - start - cruise, 0.0, stop)
            way = v * a * a / (2 * start) + v * c + v * b - v * b * b / (2 * stop)
            out += way[:, None] * u
        return out


@dataclass
class Episode:
    pose: list  # x, y, z, qx, qy, qz, qw
    velocity: list  # linear of the centre, angular
    course: Course = None
    seconds: float = 1.0
    added_kg: float = 0.0
    rests: bool = True  # on the table when it begins
    tick_s: float = 0.0  # of the controller, which goes straight from tick to tick; 0: smooth

    def places(self, times):
        """Of the tool's course, `[time, 3]`."""
        if not self.tick_s:
            return self.course.places(times)
        ticks = np.arange(math.ceil(self.course.end_s / self.tick_s) + 2) * self.tick_s
        nodes = self.course.places(ticks)
        return np.stack([np.interp(times, ticks, nodes[:, a]) for a in range(3)], axis=1)


def gap(scene, yaw, rel):
    """Horizontal distance of a point from the object's side, at half height."""
    half = scene.footprint
    if len(half) == 1:
        return math.hypot(*rel) - half[0]
    c, s = math.cos(yaw), math.sin(yaw)
    q = [abs(c * rel[0] + s * rel[1]) - half[0], abs(-s * rel[0] + c * rel[1]) - half[1]]
    return math.hypot(max(q[0], 0.0), max(q[1], 0.0)) + min(max(q), 0.0)


def behind(scene, place, yaw, direction, aside):
    """Where the tool touches when it comes along `direction`, `aside` of the half width beside the middle."""
    u = np.array([math.cos(direction), math.sin(direction)])
    n = np.array([-u[1], u[0]])
    half = scene.footprint
    if len(half) == 2:
        c, s = math.cos(yaw), math.sin(yaw)
        width = abs(n[0] * c + n[1] * s) * half[0] + abs(-n[0] * s + n[1] * c) * half[1]
    else:
        width = half[0]
    t = -3.0 * scene.length_m - scene.tool_radius_m
    for _ in range(200):
        step = gap(scene, yaw, t * u + aside * width * n) - scene.tool_radius_m
        if step < 1e-7:
            break
        t += step
    height = max(scene.half_height_m, scene.tool_radius_m * 1.1)
    return np.array([*(place + t * u + aside * width * n), height]), np.array([*u, 0.0])


def resting(scene, rng, spread=1.5):
    place = np.array(scene.centre_m) + rng.uniform(-spread, spread, 2) * scene.length_m
    return place, float(rng.uniform(-math.pi, math.pi))


def stroke(scene, rng, kind, direction=None, aside=None, speed=None, added_kg=0.0, long_rest=False):
    """One push of a kind: straight, hit (lets go), turn, steps or creep."""
    length, fast = scene.length_m, scene.speed_mps
    place, yaw = resting(scene, rng)
    direction = rng.uniform(-math.pi, math.pi) if direction is None else direction
    if scene.kind == "lying":
        # Across the axis, mostly: it would not roll along it.
        yaw = direction + rng.uniform(-0.5, 0.5) + (0 if rng.random() < 0.8 else math.pi / 2)
    aside = rng.uniform(-0.5, 0.5) if aside is None else aside
    touch, u = behind(scene, place, yaw, direction, aside)
    speed = fast * log_uniform(rng, 0.05, 0.3) if speed is None else speed
    before = length * rng.uniform(0.05, 0.15)
    course = Course(touch - before * u).wait(rng.uniform(0.08, 0.2))
    way = min(length * rng.uniform(0.5, 1.6), 1.2 * speed + 0.15 * length)
    if kind == "hit":
        # The tool stops soon after it has touched: the object goes on by itself.
        speed = fast * rng.uniform(0.2, 0.6)
        course.move((before + 0.15 * length) * u, speed, 0.08, 0.02)
    elif kind == "turn":
        course.move((before + way / 2) * u, speed)
        bend = sign(rng) * rng.uniform(0.3, 1.0)
        c, s = math.cos(bend), math.sin(bend)
        course.move(way / 2 * np.array([c * u[0] - s * u[1], s * u[0] + c * u[1], 0.0]), speed)
    elif kind == "steps":
        course.move(before * u, speed)
        for _ in range(3):
            course.move(way / 3 * u, speed, 0.04, 0.04).wait(0.15)
    elif kind == "creep":
        course.move(before * 0.9 * u, 0.15 * fast).move((0.1 * before + 0.12 * length) * u, 0.06 * length)
    else:
        course.move((before + way) * u, speed, 0.08, 0.04)
    if long_rest:
        course.wait(rng.uniform(4.0, 8.0)).move(0.3 * length * u, speed)
    course.wait(rng.uniform(0.05, 0.2)).move(-rng.uniform(0.1, 0.3) * length * u, 0.2 * fast)
    course.wait(0.4 if kind == "hit" else rng.uniform(0.1, 0.25))
    pose = [*place, scene.half_height_m, *scene.orientation(yaw)]
    return Episode(pose, [0.0] * 6, course, course.end_s, added_kg)


def toss(scene, rng):
    """Thrown or let go above the table; a slide where it begins on the table."""
    length, fast = scene.length_m, scene.speed_mps
    place, yaw = resting(scene, rng)
    linear, angular = np.zeros(3), np.zeros(3)
    which = rng.choice(["slide", "drop", "throw"], p=[0.35, 0.15, 0.5])
    q = scene.orientation(yaw)
    height = scene.half_height_m
    if which == "slide":
        direction = rng.uniform(-math.pi, math.pi)
        linear[:2] = fast * rng.uniform(0.3, 1.2) * np.array([math.cos(direction), math.sin(direction)])
        angular[2] = fast / length * rng.normal(0.0, 0.5)
    else:
        height += length * rng.uniform(0.15, 1.0)
        if which == "throw":
            linear[:2], linear[2] = fast * rng.normal(0.0, 0.4, 2), fast * rng.uniform(-0.2, 0.6)
            angular[:] = fast / length * rng.normal(0.0, 0.8, 3)
            q = rng.normal(size=4)
            q = list(map(float, q / np.linalg.norm(q)))
            height += 0.7 * math.hypot(*(2 * v for v in scene.half_sizes_m)) - scene.half_height_m * 0.5
    seconds = min(2.5, 4.0 * math.sqrt(length / 9.81) + rng.uniform(0.5, 1.0))
    return Episode([*place, height, *q], [*linear, *angular], None, float(seconds), 0.0, which == "slide")


def in_the_air(scene, rng):
    """Free motion along all axes, then a push."""
    length, fast = scene.length_m, scene.speed_mps
    place, yaw = resting(scene, rng)
    touch, u = behind(scene, place, yaw, rng.uniform(-math.pi, math.pi), 0.0)
    course = Course(touch - 0.3 * length * u + [0, 0, 1.5 * length]).wait(0.15)
    for axis in np.eye(3):
        for way in (0.5, -1.0, 0.5):
            course.move(way * length * axis, fast * rng.uniform(0.3, 0.6)).wait(0.05)
    course.move([0, 0, -1.5 * length], 0.5 * fast).wait(0.1).move(0.7 * length * u, 0.15 * fast).wait(0.15)
    course.move(-0.2 * length * u, 0.2 * fast).wait(0.2)
    pose = [*place, scene.half_height_m, *scene.orientation(yaw)]
    return Episode(pose, [0.0] * 6, course, course.end_s)


def draw_plan(rng, scene, rig):
    """The episodes of a log."""
    if rig.tosses:
        return [toss(scene, rng) for _ in range(rig.episodes)]
    out = draw_designed(rng, scene, rig) if rig.designed else draw_passive(rng, scene, rig)
    for episode in out:
        episode.tick_s = rig.period_s if rig.straight else 0.0
    return out


def draw_passive(rng, scene, rig):
    kinds = rng.choice(["straight", "hit", "turn", "steps", "creep"], size=rig.episodes, p=[0.45, 0.2, 0.15, 0.1, 0.1])
    long = rig.episodes // 4 if rig.long_rests else 0
    return [stroke(scene, rng, str(kind), long_rest=i < long) for i, kind in enumerate(kinds)]


def draw_designed(rng, scene, rig):
    """Eight directions, four speeds, a known weight in every fourth; some strokes that let go, some moves in the air."""
    long = rig.episodes // 4 if rig.long_rests else 0
    speeds = [scene.speed_mps * v for v in (0.04, 0.1, 0.2, 0.35)]
    added = round(scene.mass_kg * rng.uniform(0.4, 1.0), 4)
    out, turns = [], rng.permutation(8)
    for i in range(rig.episodes):
        if i % 8 == 7:
            out.append(in_the_air(scene, rng) if i % 16 == 7 else stroke(scene, rng, "hit"))
            continue
        direction = 2 * math.pi * turns[(i + i // 8) % 8] / 8
        aside = (0.0, 0.35, 0.0, -0.35)[i % 4]
        weight = added if (i + i // 4) % 4 == 1 else 0.0
        kind = "creep" if i % 12 == 5 else "straight"
        rest = i % 3 == 0 and i // 3 < long
        out.append(stroke(scene, rng, kind, direction, aside, speeds[(i + i // 4) % 4], weight, rest))
    return out
