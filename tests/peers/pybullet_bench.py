#!/usr/bin/env python3
"""Times PyBullet (p.DIRECT, Python included) on the project's action and prints one JSON object.

    python tests/peers/pybullet_bench.py [--batches K] [--actions N]

The scenes are those of mujoco_bench.py. One action = restore (poses, speeds, masses, inertias, frictions) + 20 control
steps of 1/60 s, the tool set kinematically with resetBasePositionAndOrientation and resetBaseVelocity, + reading the
observation (object pose, mean contact force on the tool); solver settings are the defaults, numSubSteps is 0
(which means one step) or 2. Shapes cannot be resized in place and are kept: the timing favours PyBullet.
A contact's coefficient is the product of the two bodies' in Bullet, so table and tool get 1 and 0.5 to make object-table
0.4 and tool-object 0.2; obstacle-table is then 0.5, object-obstacle 0.2 instead of 0.4. Reported times are the medians
of the thread's CPU time. Without pybullet: one line on stderr, exit status 3.
"""

import argparse
import json
import sys
import time
from importlib.metadata import version

try:
    import pybullet as p
except ImportError:
    sys.stderr.write("missing: pip install pybullet\n")
    sys.exit(3)

CONTROL_STEPS = 20
TRAVEL_M = 0.02
TOOL_Z_M = {"ball": 0.05, "hand": 0.06}
TOOL_Y_M = {"ball": 0.0, "hand": 0.025 - 0.102}
OBJECT, OBJECT_AT, OBJECT_KG = (0.08, 0.08, 0.09), (0.0, 0.065, 0.045), 0.5
OBSTACLE, OBSTACLE_AT, OBSTACLE_KG = (0.05, 0.05, 0.09), (0.03, 0.14, 0.045), 1.0
HAND = (((-0.03, 0.03, 0.0), (-0.03, 0.09, -0.03)), ((0.03, 0.03, 0.0), (0.03, 0.09, -0.03)),
        ((0.0, -0.03, 0.0), (0.0, -0.09, -0.03)))
HAND_RADIUS_M = 0.012
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def box_inertia(mass, size):
    x, y, z = size
    return [mass * (y * y + z * z) / 12, mass * (x * x + z * z) / 12, mass * (x * x + y * y) / 12]


def capsule_shapes():
    """The hand as one compound; a capsule's axis is z."""
    positions, turns, lengths = [], [], []
    for a, b in HAND:
        axis = [b[i] - a[i] for i in range(3)]
        length = sum(v * v for v in axis) ** 0.5
        z = [v / length for v in axis]
        # Shortest rotation from z to the axis.
        q = [-z[1], z[0], 0.0, 1 + z[2]]
        norm = sum(v * v for v in q) ** 0.5
        positions.append([(a[i] + b[i]) / 2 for i in range(3)])
        turns.append([v / norm for v in q])
        lengths.append(length)
    return p.createCollisionShapeArray(shapeTypes=[p.GEOM_CAPSULE] * len(HAND), radii=[HAND_RADIUS_M] * len(HAND),
                                       lengths=lengths, collisionFramePositions=positions,
                                       collisionFrameOrientations=turns)


class World:
    def __init__(self, obstacle, tool, substeps):
        p.resetSimulation()
        p.setGravity(0, 0, -9.81)
        p.setTimeStep(1.0 / 60.0)
        p.setPhysicsEngineParameter(fixedTimeStep=1.0 / 60.0, numSubSteps=substeps if substeps > 1 else 0,
                                    deterministicOverlappingPairs=1)
        table = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
        p.changeDynamics(table, -1, lateralFriction=1.0, restitution=0.0)
        self.movable = obstacle == "movable"
        self.substeps = substeps
        self.start = (0.0, TOOL_Y_M[tool], TOOL_Z_M[tool])
        shape = p.createCollisionShape(p.GEOM_SPHERE, radius=0.025) if tool == "ball" else capsule_shapes()
        # A body of great mass without gravity's effect (its speed is set before every step): a massless one would be
        # static and contacts would not see its speed.
        self.tool = p.createMultiBody(1e3, shape, basePosition=self.start)
        p.changeDynamics(self.tool, -1, lateralFriction=0.5, restitution=0.0, linearDamping=0.0, angularDamping=0.0,
                         localInertiaDiagonal=[1e3, 1e3, 1e3])
        self.object = p.createMultiBody(OBJECT_KG, p.createCollisionShape(p.GEOM_BOX, halfExtents=[v / 2 for v in OBJECT]),
                                        basePosition=OBJECT_AT)
        p.changeDynamics(self.object, -1, restitution=0.0, linearDamping=0.0, angularDamping=0.0)
        self.obstacle = None
        if obstacle != "none":
            self.obstacle = p.createMultiBody(OBSTACLE_KG if self.movable else 0,
                                              p.createCollisionShape(p.GEOM_BOX, halfExtents=[v / 2 for v in OBSTACLE]),
                                              basePosition=OBSTACLE_AT)
            p.changeDynamics(self.obstacle, -1, lateralFriction=0.5, restitution=0.0, linearDamping=0.0,
                             angularDamping=0.0)
        p.setCollisionFilterPair(table, self.tool, -1, -1, 0)

    def restore(self):
        bodies = [(self.object, OBJECT_AT, OBJECT_KG, OBJECT, 0.4)]
        if self.movable:
            bodies.append((self.obstacle, OBSTACLE_AT, OBSTACLE_KG, OBSTACLE, 0.5))
        for body, at, mass, size, friction in bodies:
            p.changeDynamics(body, -1, mass=mass, localInertiaDiagonal=box_inertia(mass, size),
                             lateralFriction=friction)
            p.resetBasePositionAndOrientation(body, at, UPRIGHT)
            p.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0))

    def action(self):
        force = 0.0
        x, y, z = self.start
        for k in range(CONTROL_STEPS):
            t = k / CONTROL_STEPS
            at = (x, y + TRAVEL_M * t * t * t * (10 - 15 * t + 6 * t * t), z)
            p.resetBasePositionAndOrientation(self.tool, at, UPRIGHT)
            # Gravity would pull the tool during the step: its speed is raised by what a step takes.
            p.resetBaseVelocity(self.tool, (0, TRAVEL_M * 3 * 30 * t * t * (1 - t) ** 2, 9.81 / 60.0), (0, 0, 0))
            p.stepSimulation()
            for c in p.getContactPoints(bodyA=self.tool):
                force += c[9] * c[7][1] + c[10] * c[11][1] + c[12] * c[13][1]
        position, _ = p.getBasePositionAndOrientation(self.object)
        # Bullet divides the last substep's impulse by the whole step.
        return position[1], force * self.substeps / CONTROL_STEPS


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--batches", type=int, default=0, help="print the medians of this many batches")
    parser.add_argument("--substeps", type=int, nargs="+", default=[1, 2], help="substeps of Bullet in a control step")
    parser.add_argument("--actions", type=int, default=500, help="actions per batch")
    args = parser.parse_args()
    p.connect(p.DIRECT)
    out = {"pybullet": version("pybullet")}
    for obstacle in ("none", "movable", "fixed"):
        out[obstacle] = {}
        for tool in ("ball", "hand"):
            entry = {"pybullet_us": {}, "object_y_m": {}, "force_y_n": {}}
            for substeps in args.substeps:
                world = World(obstacle, tool, substeps)
                medians = []
                for _ in range(20):
                    world.restore()
                    world.action()
                for _ in range(max(args.batches, 1)):
                    times = []
                    for _ in range(args.actions):
                        start = time.thread_time_ns()
                        world.restore()
                        y, force = world.action()
                        times.append((time.thread_time_ns() - start) / 1e3)
                    times.sort()
                    medians.append(round(times[len(times) // 2], 3))
                entry["pybullet_us"][str(substeps)] = medians if args.batches else medians[0]
                entry["object_y_m"][str(substeps)] = round(y, 9)
                entry["force_y_n"][str(substeps)] = round(force, 9)
            out[obstacle][tool] = entry
    print(json.dumps(out))


if __name__ == "__main__":
    main()
