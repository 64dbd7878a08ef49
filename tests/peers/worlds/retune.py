"""How much of an effect is left where mass, frictions and clocks of the same engine make up for it as well as they can.

A friction other than `log.toml` says, or a camera that is late, is no effect to `diagnose`: it re-tunes both. Whatever these can make of a
hidden effect cannot be told from the readings, by no solver. So the logs say by how much readings differ from the best that the same engine does
without the effect. Nothing here knows `diagnose` or its answers.
"""

import dataclasses

import numpy as np
from scipy.optimize import least_squares

import sensors
from world import World

EPISODES = 6  # that are simulated again and again
STEP = 0.04  # of logarithms, and of clocks in units of SECONDS: engines do not vary smoothly
SECONDS = 0.05
WIDEST = np.array([1.0, 0.7, 1.0, 2.0, 2.0])  # ln friction, ln mass, ln tool friction, clocks of object and force
EVALUATIONS = 5
SCALE = 3.0  # standard deviations: a reading that is further off hardly counts, as episodes may go another way for chance alone


def residuals(one, two, rig):
    """How two sets of readings at the same times differ, in standard deviations, reading by reading."""
    out = []
    for key, (_, a) in one.items():
        b, n = two[key][1], min(len(a), len(two[key][1]))
        if key == "command" or n == 0:
            continue
        off = np.full(a.shape, sensors.FARTHEST * rig.noise[sensors.NOISE_OF[key]])[:, :3]
        off[:n] = 2.0 * sensors.product(a[:n], b[:n] * [-1, -1, -1, 1])[:, :3] if key == "orientation" else a[:n] - b[:n]
        out.append(np.clip(off / rig.noise[sensors.NOISE_OF[key]], -sensors.FARTHEST, sensors.FARTHEST).ravel())
    return np.concatenate(out) if out else np.zeros(0)


class Bare:
    """The same episodes without the effect, with other numbers."""

    def __init__(self, scene, rig, plan, stamps, engine, variant):
        self.scene, self.rig, self.plan, self.stamps = scene, rig, plan, stamps
        self.engine, self.variant, self.kept = engine, variant, {}

    def traces(self, numbers):
        key = tuple(np.round(numbers, 9))
        if key not in self.kept:
            friction, mass, tool = (float(v) for v in np.exp(numbers))
            scene = dataclasses.replace(self.scene, friction=self.scene.friction * friction, mass_kg=self.scene.mass_kg * mass,
                                        tool_friction=self.scene.tool_friction * tool)
            world = World(scene, {}, self.engine, self.variant)
            self.kept[key] = [world.run(episode) for episode in self.plan]
        return self.kept[key]

    def readings(self, x):
        late, behind = SECONDS * x[3:]
        rig = dataclasses.replace(self.rig, skew_s=self.rig.skew_s + late)
        out = []
        for trace, times in zip(self.traces(x[:3]), self.stamps):
            read = sensors.read(trace, times, {}, rig)
            if behind and "force" in read:
                moved = sensors.read_force(trace, read["force"][0] - behind, {}, rig)
                read |= {key: (read[key][0], moved[key]) for key in ("force", "torque") if key in read}
            out.append(read)
        return out


def left(traces, scene, rig, plan, stamps, effects, engine, variant):
    """`after_retuning`: the mean square, in noise standard deviations, by which readings with `effects` differ from the best without; and the best."""
    some = [i for i in range(0, len(plan), max(1, len(plan) // EPISODES)) if len(traces[i].time_s) >= 3][:EPISODES]
    truth = [sensors.read(traces[i], stamps[i], effects, rig) for i in some]
    bare = Bare(scene, rig, [plan[i] for i in some], [stamps[i] for i in some], engine, variant)

    def off(x):
        return np.concatenate([residuals(a, b, rig) for a, b in zip(truth, bare.readings(x))])

    start = np.zeros(5)
    if "friction_level" in effects:  # the scene's own is what log.toml would be right with
        start[0] = np.log(effects["friction_level"]["coefficient"] / scene.friction)
    found = least_squares(off, start, bounds=(-WIDEST, WIDEST), loss="cauchy", f_scale=SCALE,
                          max_nfev=EVALUATIONS, jac=lambda x: slopes(off, x))
    rest = off(found.x)
    x = [float(f"{v:.3g}") for v in (*np.exp(found.x[:3]), *(SECONDS * found.x[3:]))]
    best = dict(zip(("friction_factor", "mass_factor", "tool_friction_factor", "object_late_s", "force_late_s"), x))
    return {"after_retuning": float(f"{np.mean(rest * rest):.4g}"), "retuned": best}


def slopes(off, x):
    """One-sided differences towards the middle of the range."""
    at, columns = off(x), []
    for i in range(len(x)):
        step = -STEP if x[i] > 0 else STEP
        moved = x.copy()
        moved[i] += step
        columns.append((off(moved) - at) / step)
    return np.stack(columns, axis=1)
