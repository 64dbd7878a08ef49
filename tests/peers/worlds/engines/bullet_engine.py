"""Bullet: sequential impulses with hard contacts. Lengths are scaled up, since its margins suit bodies of a metre."""

import math

import numpy as np
import pybullet as p

from engines import TOOL_RATIO

VERSION = str(p.getAPIVersion())
STEPS = {"default": (1.0 / 240.0, 50), "fine": (0.001, 100), "unscaled": (1.0 / 480.0, 50)}


class Engine:
    unsupported = {"contact_compliance"}
    unsuitable = set()

    def __init__(self, body, variant):
        self.body, b = body, body
        self.step_s, iterations = STEPS[variant]
        self.scale = s = 1.0 if variant == "unscaled" else 0.5 / max(b.half_m)
        self.c = p.connect(p.DIRECT)
        c = {"physicsClientId": self.c}
        p.setGravity(*(b.gravity * s), **c)
        p.setPhysicsEngineParameter(fixedTimeStep=self.step_s, numSubSteps=0, numSolverIterations=iterations,
                                    restitutionVelocityThreshold=0.02 * s, **c)
        plane = p.createCollisionShape(p.GEOM_PLANE, **c)
        self.table = p.createMultiBody(0, plane, **c)
        self.object = self.make_object(s, c)
        ball = p.createCollisionShape(p.GEOM_SPHERE, radius=b.tool_radius_m * s, **c)
        self.tool_kg = TOOL_RATIO * b.mass_kg
        self.tool_kgm2 = self.tool_kg * b.tool_radius_m ** 2
        self.tool = p.createMultiBody(self.tool_kg, ball, **c)
        still = dict(linearDamping=0.0, angularDamping=0.0, rollingFriction=0.0, spinningFriction=0.0, restitution=b.restitution, **c)
        for which in (self.table, self.object, self.tool):
            p.changeDynamics(which, -1, **still)
        p.changeDynamics(self.object, -1, activationState=p.ACTIVATION_STATE_DISABLE_SLEEPING, **c)
        # Coefficients multiply.
        p.changeDynamics(self.table, -1, lateralFriction=1.0, **c)
        p.setCollisionFilterPair(self.table, self.tool, -1, -1, 0, **c)
        if b.obstacle:
            o = b.obstacle
            shape = p.createCollisionShape(p.GEOM_CYLINDER, radius=o["radius_m"] * s, height=o["height_m"] * s, **c)
            at = [o["x_m"] * s, o["y_m"] * s, o["height_m"] * s / 2]
            obstacle = p.createMultiBody(0, shape, basePosition=at, **c)
            p.changeDynamics(obstacle, -1, lateralFriction=min(1.0, 0.5 / b.friction), **c)
        self.set_friction(b.friction)
        self.set_mass(1.0)

    def make_object(self, s, c):
        b = self.body
        lift = 0.0003 * s if b.feet_m else 0.0
        half = [v * s for v in b.half_m]
        half[2] -= lift / 2
        kinds = {"box": p.GEOM_BOX, "cylinder": p.GEOM_CYLINDER, "sphere": p.GEOM_SPHERE}
        if not b.feet_m:
            shape = p.createCollisionShape(kinds[b.shape], halfExtents=half, radius=half[0], height=2 * half[2], **c)
        else:
            r, n = b.foot_radius_m * s, len(b.feet_m)
            at = [[0, 0, lift / 2]] + [[v[0] * s, v[1] * s, v[2] * s + r] for v in b.feet_m]
            shape = p.createCollisionShapeArray(
                shapeTypes=[kinds[b.shape]] + [p.GEOM_SPHERE] * n, halfExtents=[half] + [[0, 0, 0]] * n,
                radii=[half[0]] + [r] * n, lengths=[2 * half[2]] + [0.0] * n, collisionFramePositions=at, **c)
        return p.createMultiBody(b.mass_kg, shape, baseInertialFramePosition=[float(v) * s for v in b.com_m], **c)

    def turn(self, q):
        return np.array(p.getMatrixFromQuaternion(q)).reshape(3, 3)

    def place(self, pose, velocity, tool_m):
        s, c = self.scale, {"physicsClientId": self.c}
        arm = self.turn(pose[3:]) @ self.body.com_m
        at, w = np.array(pose[:3]) + arm, np.array(velocity[3:])
        p.resetBasePositionAndOrientation(self.object, at * s, pose[3:], **c)
        p.resetBaseVelocity(self.object, list((np.array(velocity[:3]) + np.cross(w, arm)) * s), list(w), **c)
        self.tool_m = np.array(tool_m, float)
        p.resetBasePositionAndOrientation(self.tool, self.tool_m * s, [0, 0, 0, 1], **c)

    def step(self, force, torque, tool_m):
        s, c, h = self.scale, {"physicsClientId": self.c}, self.step_s
        v = (tool_m - self.tool_m) / h
        p.resetBasePositionAndOrientation(self.tool, (self.tool_m * s).tolist(), [0, 0, 0, 1], **c)
        p.resetBaseVelocity(self.tool, (v * s).tolist(), [0, 0, 0], **c)
        p.applyExternalForce(self.tool, -1, (-self.body.gravity * s * self.tool_kg).tolist(), (self.tool_m * s).tolist(), p.WORLD_FRAME, **c)
        if force is not None:
            at, _ = p.getBasePositionAndOrientation(self.object, **c)
            p.applyExternalForce(self.object, -1, (force * s).tolist(), at, p.WORLD_FRAME, **c)
            p.applyExternalTorque(self.object, -1, (torque * s * s).tolist(), p.WORLD_FRAME, **c)
        p.stepSimulation(**c)
        self.tool_m = tool_m
        linear, angular = p.getBaseVelocity(self.tool, **c)
        return np.concatenate([(np.array(linear) / s - v) * (self.tool_kg / h), np.array(angular) * (self.tool_kgm2 / h)])

    def state(self):
        c = {"physicsClientId": self.c}
        at, q = p.getBasePositionAndOrientation(self.object, **c)
        v, w = p.getBaseVelocity(self.object, **c)
        pose, velocity = np.array([*at, *q]), np.array([*v, *w])
        pose[:3] /= self.scale
        velocity[:3] /= self.scale
        if self.body.com_m.any():
            arm = self.turn(q) @ self.body.com_m
            pose[:3] -= arm
            velocity[:3] -= np.cross(w, arm)
        return pose, velocity

    def set_friction(self, mu):
        c = {"physicsClientId": self.c}
        p.changeDynamics(self.object, -1, lateralFriction=float(mu), **c)
        p.changeDynamics(self.tool, -1, lateralFriction=self.body.tool_friction / float(mu), **c)

    def set_mass(self, share):
        # Only the moments of inertia can be set: products of inertia are dropped.
        mass, inertia = self.body.shares(share)
        moments = (np.diag(inertia) * self.scale ** 2).tolist()
        p.changeDynamics(self.object, -1, mass=float(mass), localInertiaDiagonal=moments, physicsClientId=self.c)

    def __del__(self):
        if getattr(self, "c", -1) >= 0 and p is not None and math is not None:
            try:
                p.disconnect(self.c)
            except p.error:
                pass
