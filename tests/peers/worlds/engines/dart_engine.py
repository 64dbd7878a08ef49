"""DART: hard contacts, friction in an exact cone; found by ODE's detector (`bullet`: by Bullet's). `pyramidal` has its default solver, a linear
complementarity problem whose friction is more by up to √2 between the axes."""

import math

import dartpy as dart
import numpy as np

from engines import TOOL_RATIO

VERSION = getattr(dart, "__version__", "6.20.0")
VARIANTS = {"default": (0.002, dart.collision.OdeCollisionDetector), "bullet": (0.002, dart.collision.BulletCollisionDetector),
            "fine": (0.001, dart.collision.OdeCollisionDetector), "pyramidal": (0.002, dart.collision.OdeCollisionDetector)}
# Of a pair counts the smaller coefficient.
ROUGH = 10.0


def isometry(turn, at):
    out = dart.math.Isometry3()
    out.set_rotation(turn)
    out.set_translation(at)
    return out


def matrix(q):
    x, y, z, w = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def quaternion(r):
    """x, y, z, w of a rotation matrix (Shepperd 1978)."""
    (a, b, c), (d, e, f), (g, h, i) = r.tolist()
    trace = a + e + i
    if trace > 0.0:
        q = (h - f, c - g, d - b, 1 + trace)
    elif a >= e and a >= i:
        q = (1 + a - e - i, b + d, c + g, h - f)
    elif e >= i:
        q = (b + d, 1 - a + e - i, f + h, c - g)
    else:
        q = (c + g, f + h, 1 - a - e + i, d - b)
    return np.array(q) / math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)


class Engine:
    unsupported = {"contact_compliance"}
    unsuitable = set()

    def __init__(self, body, variant):
        self.body, b = body, body
        self.step_s, detector = VARIANTS[variant]
        self.world = dart.simulation.World()
        self.world.setTimeStep(self.step_s)
        self.world.setGravity(b.gravity)
        solver = self.world.getConstraintSolver()
        solver.setCollisionDetector(detector())
        if variant != "pyramidal":
            solver.setBoxedLcpSolver(dart.constraint.NsgsFrictionSolver())
        self.table = self.fixed("table", dart.dynamics.BoxShape([200.0, 200.0, 2.0]), [0, 0, -1.0], b.friction)
        self.joint, self.object = self.free("object", b.mass_kg, b.com_m, b.inertia)
        lift = 0.0003 if b.feet_m else 0.0
        half = list(b.half_m)
        half[2] -= lift / 2
        shape = {"box": lambda: dart.dynamics.BoxShape([2 * v for v in half]),
                 "cylinder": lambda: dart.dynamics.CylinderShape(half[0], 2 * half[2]),
                 "sphere": lambda: dart.dynamics.SphereShape(half[0])}[b.shape]()
        self.cover(self.object, shape, [0, 0, lift / 2], ROUGH, b.restitution)
        for foot in b.feet_m:
            at = np.array(foot) + [0, 0, b.foot_radius_m]
            self.cover(self.object, dart.dynamics.SphereShape(b.foot_radius_m), at, ROUGH, b.restitution)
        self.tool_kg = TOOL_RATIO * b.mass_kg
        self.tool_kgm2 = self.tool_kg * b.tool_radius_m ** 2
        self.tool_joint, self.tool = self.free("tool", self.tool_kg, np.zeros(3), np.eye(3) * self.tool_kgm2)
        self.tool.setGravityMode(False)
        self.cover(self.tool, dart.dynamics.SphereShape(b.tool_radius_m), [0, 0, 0], b.tool_friction, 1.0)
        if b.obstacle:
            o = b.obstacle
            self.fixed("obstacle", dart.dynamics.CylinderShape(o["radius_m"], o["height_m"]), [o["x_m"], o["y_m"], o["height_m"] / 2],
                       min(b.friction, 0.5))
        self.own = b.mass_kg

    def cover(self, node, shape, at, friction, restitution):
        part = node.createShapeNode(shape)
        part.createCollisionAspect()
        part.createDynamicsAspect()
        part.setRelativeTranslation(np.array(at, float))
        dynamics = part.getDynamicsAspect()
        dynamics.setFrictionCoeff(friction)
        dynamics.setRestitutionCoeff(restitution)
        return dynamics

    def fixed(self, name, shape, at, friction):
        skeleton = dart.dynamics.Skeleton(name)
        _, node = skeleton.createWeldJointAndBodyNodePair()
        dynamics = self.cover(node, shape, at, friction, 1.0)
        self.world.addSkeleton(skeleton)
        return dynamics

    def free(self, name, mass, com, inertia):
        skeleton = dart.dynamics.Skeleton(name)
        joint, node = skeleton.createFreeJointAndBodyNodePair()
        node.setInertia(dart.dynamics.Inertia(mass, np.array(com, float), np.array(inertia, float)))
        self.world.addSkeleton(skeleton)
        return joint, node

    def place(self, pose, velocity, tool_m):
        turn = matrix(pose[3:])
        self.joint.setPositions(dart.dynamics.FreeJoint.convertToPositions(isometry(turn, np.array(pose[:3], float))))
        # In this version in base axes.
        self.joint.setVelocities(np.array([*velocity[3:], *velocity[:3]], float))
        self.tool_m = np.array(tool_m, float)
        self.tool_joint.setPositions(np.concatenate([np.zeros(3), self.tool_m]))
        self.tool_joint.setVelocities(np.zeros(6))

    def step(self, force, torque, tool_m):
        h = self.step_s
        v = (tool_m - self.tool_m) / h
        self.tool_joint.setPositions(np.concatenate([np.zeros(3), self.tool_m]))
        self.tool_joint.setVelocities(np.concatenate([np.zeros(3), v]))
        if force is not None:
            self.object.addExtForce(force, self.body.com_m, False, True)
            self.object.addExtTorque(torque, False)
        self.world.step()
        self.tool_m = tool_m
        speed = self.tool_joint.getVelocities()
        return np.concatenate([(speed[3:] - v) * (self.tool_kg / h), speed[:3] * (self.tool_kgm2 / h)])

    def state(self):
        at = self.object.getWorldTransform()
        v = self.joint.getVelocities()
        return np.concatenate([at.translation(), quaternion(at.rotation())]), np.concatenate([v[3:], v[:3]])

    def set_friction(self, mu):
        self.table.setFrictionCoeff(mu)

    def set_mass(self, share):
        mass, inertia = self.body.shares(share)
        self.object.setInertia(dart.dynamics.Inertia(float(mass), np.array(self.body.com_m, float), inertia))
