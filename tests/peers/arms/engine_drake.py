"""Drake: forward simulation of a scene.

Drake's MultibodyPlant gives the mass matrix, the velocity-dependent and the gravity torques.  Its plants have no Coulomb
friction in joints, so the step is made here: semi-implicit Euler whose Coulomb friction is implicit and exact (set
valued), found by an active-set search over which joints stick and which slide; damping is implicit too.
"""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (FixedOffsetFrame, JacobianWrtVariable, PrismaticJoint, RevoluteJoint,
                                    RotationalInertia, SpatialInertia)

from scene import Scene


def _placement(rotation: np.ndarray, position: np.ndarray) -> RigidTransform:
    u, _, v = np.linalg.svd(rotation)  # exactly orthonormal, as Drake demands
    return RigidTransform(RotationMatrix(u @ v), position)


def _spatial_inertia(body) -> SpatialInertia:
    i = body.inertia
    about_com = RotationalInertia(i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
    return SpatialInertia.MakeFromCentralInertia(body.mass, body.com, about_com)


class DrakeEngine:
    """Forward simulation with Drake's dynamics."""

    name = "drake"

    def __init__(self, scene: Scene, stiff: bool):
        self.scene = scene
        self.step_secs = 0.00025 if stiff or scene.table or scene.cable else 0.0005
        self.plant = plant = MultibodyPlant(time_step=0.0)
        plant.mutable_gravity_field().set_gravity_vector(scene.gravity)
        parent, names = plant.world_body(), []
        if scene.table:
            table = plant.AddRigidBody("table", SpatialInertia.MakeFromCentralInertia(
                scene.table.mass, np.zeros(3), RotationalInertia(1.0, 1.0, 1.0)))
            plant.AddJoint(PrismaticJoint("table", parent.body_frame(), table.body_frame(), scene.table.direction))
            parent = table
        for i, body in enumerate(scene.bodies):
            frame = plant.AddFrame(FixedOffsetFrame(f"place_{i}", parent.body_frame(),
                                                    _placement(body.rotation, body.position)))
            if i in scene.elastic:
                rotor = plant.AddRigidBody(f"rotor_{i}", SpatialInertia.Zero())
                plant.AddJoint(RevoluteJoint(f"motor_{i}", frame, rotor.body_frame(), body.axis))
                frame = rotor.body_frame()
                names.append(f"spring_{i}")
            else:
                names.append(f"motor_{i}")
            link = plant.AddRigidBody(f"body_{i}", _spatial_inertia(body))
            plant.AddJoint(RevoluteJoint(names[-1], frame, link.body_frame(), body.axis))
            parent = link
        plant.Finalize()
        self.tip = parent.body_frame()
        self.context = plant.CreateDefaultContext()
        size = plant.num_velocities()
        at = lambda joint: plant.GetJointByName(joint).velocity_start()
        self.motor = np.array([at(f"motor_{i}") for i in range(len(scene.bodies))])
        self.springs = {i: at(f"spring_{i}") for i in scene.elastic}
        self.table = at("table") if scene.table else None
        self.q, self.v = np.zeros(size), np.zeros(size)
        self.added = np.zeros(size)  # reflected inertia
        self.added[self.motor] = scene.armature
        for i, elastic in scene.elastic.items():
            self.added[self.motor[i]] += elastic.rotor_inertia
        self.level, self.damping = np.zeros(size), np.zeros(size)  # Coulomb, viscous
        for i, law in enumerate(scene.friction):
            self.level[self.motor[i]] = 0.0 if law.bristle_rad else law.coulomb
            self.damping[self.motor[i]] = law.viscous
        for i, elastic in scene.elastic.items():
            self.damping[self.springs[i]] = 0.0 if elastic.gap_rad else elastic.damping
        if scene.table:
            self.damping[self.table] = scene.table.damping
        self.varying = {i: f for i, f in enumerate(scene.friction) if f.varies}
        self.friction, self.acceleration = np.zeros(size), np.zeros(size)
        self.direction = np.zeros(size)
        self.unsolved = 0  # steps whose active set was not found

    def reset(self, q: np.ndarray) -> None:
        """Rest at motor positions `q` with relaxed springs."""
        self.q[:], self.v[:], self.direction[:], self.friction[:] = 0.0, 0.0, 0.0, 0.0
        self.q[self.motor] = q

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Motor positions and velocities."""
        return self.q[self.motor], self.v[self.motor]

    def deflection(self) -> np.ndarray:
        """Link minus motor positions."""
        out = np.zeros(len(self.motor))
        for i, dof in self.springs.items():
            out[i] = self.q[dof]
        return out

    def step(self, torque: np.ndarray, log_secs: float) -> None:
        """One step with motor torques `torque` [N m]."""
        plant, context, q, v, h = self.plant, self.context, self.q, self.v, self.step_secs
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        mass = plant.CalcMassMatrix(context)
        force = plant.CalcGravityGeneralizedForces(context) - plant.CalcBiasTerm(context)
        force[self.motor] += torque
        for i, law in self.varying.items():
            dof = self.motor[i]
            self.level[dof], self.damping[dof] = law.level(v[dof], torque[i] - self.friction[dof], log_secs)
        for i, elastic in self.scene.elastic.items():
            dof = self.springs[i]
            # the damping of a plain spring is implicit, that of a gap is part of its contact law
            force[dof] += elastic.torque(q[dof], v[dof] if elastic.gap_rad else 0.0)
        if self.scene.table:
            force[self.table] += self.scene.table.force(log_secs) - self.scene.table.stiffness * q[self.table]
        if self.scene.cable:
            force += self._cable()
        mass[np.diag_indices_from(mass)] += self.added
        right = mass @ v + h * force
        mass[np.diag_indices_from(mass)] += h * self.damping
        new, coulomb = self._slide_or_stick(mass, right, h * self.level)
        self.friction = coulomb / h + self.damping * new
        self.acceleration = (new - v) / h
        self.v = new
        self.q = q + h * new

    def _slide_or_stick(self, matrix: np.ndarray, right: np.ndarray, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocities v and friction impulses f: matrix v = right - f, |f| <= level, f = level sign(v) where v is not 0."""
        has = level > 0.0
        if not has.any():
            return np.linalg.solve(matrix, right), np.zeros_like(right)
        direction = self.direction
        for _ in range(20):
            stuck = has & (direction == 0.0)
            impulse = np.where(has, direction * level, 0.0)
            if stuck.any():
                slide, new = ~stuck, np.zeros_like(right)
                if slide.any():
                    new[slide] = np.linalg.solve(matrix[np.ix_(slide, slide)], (right - impulse)[slide])
                impulse[stuck] = (right - matrix @ new)[stuck]
                freed = stuck & (np.abs(impulse) > level)
            else:
                new = np.linalg.solve(matrix, right - impulse)
                freed = stuck
            caught = has & (direction * new < 0.0)
            if not (freed.any() or caught.any()):
                break
            direction = np.where(freed, np.sign(impulse), np.where(caught, 0.0, direction))
        else:
            self.unsolved += 1
        self.direction = direction
        return new, impulse

    def _cable(self) -> np.ndarray:
        plant, cable = self.plant, self.scene.cable
        world = plant.world_frame()
        point = plant.CalcPointsPositions(self.context, self.tip, cable.point, world).ravel()
        jacobian = plant.CalcJacobianTranslationalVelocity(self.context, JacobianWrtVariable.kV, self.tip, cable.point,
                                                           world, world)
        force = cable.force(point, jacobian @ self.v)
        return np.zeros(len(self.v)) if force is None else jacobian.T @ force

    def exact(self) -> tuple[np.ndarray, ...]:
        """Of the step just made: accelerations of the motors and the friction torques on them."""
        return self.acceleration[self.motor], self.friction[self.motor]
