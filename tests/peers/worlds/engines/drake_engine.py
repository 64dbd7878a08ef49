"""Drake: discrete contact by convex optimisation (SAP), with point contacts or hydroelastic patches, and TAMSI.

A pair of shapes has one contact point: the object stands on small balls in its corners or rims."""

import math

import numpy as np
import pydrake
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (AddCompliantHydroelasticProperties, AddContactMaterial, AddRigidHydroelasticProperties, Box,
                              CollisionFilterDeclaration, Cylinder, GeometrySet, HalfSpace, ProximityProperties, RoleAssign, Sphere)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import (AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction, DiscreteContactApproximation,
                                     ExternallyAppliedSpatialForce)
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder

from engines import TOOL_RATIO

VERSION = getattr(pydrake, "__version__", "1.51.1")
VARIANTS = {"point": (ContactModel.kPoint, DiscreteContactApproximation.kSap, 0.002),
            "hydroelastic": (ContactModel.kHydroelasticWithFallback, DiscreteContactApproximation.kSap, 0.002),
            "tamsi": (ContactModel.kPoint, DiscreteContactApproximation.kTamsi, 0.001)}
# Pairs have 2 a b / (a + b): with a huge one of the object, twice the other's.
SMOOTH = 1e6


class Engine:
    unsupported = {"contact_compliance", "restitution"}
    unsuitable = {"lying"}

    def __init__(self, body, variant):
        self.body, b = body, body
        model, approximation, self.step_s = VARIANTS[variant]
        # A sphere's patch is a polygon on which it does not roll.
        self.soft = variant == "hydroelastic" and b.shape != "sphere"
        self.foot_radius_m = min(b.foot_radius_m, 0.0002)
        builder = DiagramBuilder()
        plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, self.step_s)
        self.plant = plant
        plant.set_contact_model(model)
        plant.set_discrete_contact_approximation(approximation)
        plant.mutable_gravity_field().set_gravity_vector(b.gravity)
        world = plant.world_body()
        table = plant.RegisterCollisionGeometry(world, RigidTransform(), HalfSpace(), "table", self.material(b.friction / 2, rigid=True))
        self.table = table
        self.object = self.add(plant, "object", b.mass_kg, b.com_m, b.inertia)
        self.shapes(plant)
        self.tool_kg = TOOL_RATIO * b.mass_kg
        self.tool_kgm2 = self.tool_kg * b.tool_radius_m ** 2
        tools = plant.AddModelInstance("tools")
        self.tool = self.add(plant, "tool", self.tool_kg, np.zeros(3), np.eye(3) * self.tool_kgm2, tools)
        ball = plant.RegisterCollisionGeometry(self.tool, RigidTransform(), Sphere(b.tool_radius_m), "tool",
                                               self.material(b.tool_friction / 2, rigid=True))
        if b.obstacle:
            o = b.obstacle
            at = RigidTransform([o["x_m"], o["y_m"], o["height_m"] / 2])
            obstacle = plant.RegisterCollisionGeometry(world, at, Cylinder(o["radius_m"], o["height_m"]), "obstacle",
                                            self.material(min(b.friction, 0.5) / 2, rigid=True))
        plant.set_gravity_enabled(tools, False)
        plant.Finalize()
        apart = CollisionFilterDeclaration().ExcludeBetween(GeometrySet(table), GeometrySet(ball))
        if self.bears:
            apart.ExcludeBetween(GeometrySet(table), GeometrySet(self.whole))
        others = [ball] + ([obstacle] if b.obstacle else [])
        for foot in self.bears:
            apart.ExcludeBetween(GeometrySet(others), GeometrySet(foot))
        self.scene_graph.collision_filter_manager().Apply(apart)
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = plant.GetMyMutableContextFromRoot(self.root)
        self.load = ExternallyAppliedSpatialForce()
        self.load.body_index = self.object.index()
        self.load.p_BoBq_B = b.com_m
        self.port = plant.get_applied_spatial_force_input_port()
        self.place_of, self.speed_of = self.object.floating_positions_start(), self.object.floating_velocities_start_in_v()
        self.tool_place, self.tool_speed = self.tool.floating_positions_start(), self.tool.floating_velocities_start_in_v()
        self.mu, self.forced = b.friction, False

    def add(self, plant, name, mass, com, inertia, instance=None):
        about = inertia / mass
        unit = UnitInertia(about[0, 0], about[1, 1], about[2, 2], about[0, 1], about[0, 2], about[1, 2])
        whole = SpatialInertia(mass, com, unit.ShiftFromCenterOfMass(com))
        return plant.AddRigidBody(name, whole) if instance is None else plant.AddRigidBody(name, instance, whole)

    def material(self, mu, rigid):
        out = ProximityProperties()
        AddContactMaterial(dissipation=20.0, friction=CoulombFriction(mu, mu), properties=out)
        if not self.soft:
            # A point sinks in by some 10 µm under the object's weight.
            out.UpdateProperty("material", "point_contact_stiffness", float(self.body.mass_kg * 9.81 / 2e-5))
            return out
        size = min(self.body.half_m)
        if rigid:
            AddRigidHydroelasticProperties(size / 2, out)
        else:
            # Pressure of its weight over a tenth of its sole sinks it in by about 0.1 % of its size.
            area = self.body.half_m[0] * self.body.half_m[1]
            AddCompliantHydroelasticProperties(size / 2, float(self.body.mass_kg * 9.81 / area * 300.0), out)
        return out

    def shapes(self, plant):
        b = self.body
        lift = 0.0003 if b.feet_m else 0.0
        half, at = list(b.half_m), RigidTransform([0, 0, lift / 2])
        half[2] -= lift / 2
        shape = {"box": lambda: Box(*(2 * v for v in half)), "cylinder": lambda: Cylinder(half[0], 2 * half[2]),
                 "sphere": lambda: Sphere(half[0])}[b.shape]()
        self.whole = plant.RegisterCollisionGeometry(self.object, at, shape, "object", self.material(SMOOTH, rigid=False))
        self.bears = []
        for i, foot in enumerate(self.points()):
            ball, smooth = Sphere(self.foot_radius_m), self.material(SMOOTH, rigid=False)
            self.bears.append(plant.RegisterCollisionGeometry(self.object, RigidTransform(foot), ball, f"foot{i}", smooth))

    def points(self):
        """Centres of the balls that it stands on; none where patches or the sphere itself bear it."""
        b, r = self.body, self.foot_radius_m
        if b.feet_m:
            top = [(x, y, -z) for x, y, z in b.feet_m]
            return [np.array([x, y, z + math.copysign(r, -z)]) for x, y, z in [*b.feet_m, *top]]
        if self.soft or b.shape == "sphere":
            return []
        x, y, z = (v - r for v in b.half_m)
        if b.shape == "box":
            ring = [(x, y), (x, -y), (-x, y), (-x, -y)]
        else:
            ring = [(x * math.cos(k * math.pi / 4), x * math.sin(k * math.pi / 4)) for k in range(8)]
        return [np.array([px, py, side * z]) for side in (-1, 1) for px, py in ring]

    def place(self, pose, velocity, tool_m):
        q = np.array([pose[6], *pose[3:6]])
        self.root.SetTime(0.0)
        self.plant.SetFreeBodyPose(self.context, self.object, RigidTransform(Quaternion(q / np.linalg.norm(q)), pose[:3]))
        self.plant.SetFreeBodySpatialVelocity(self.context, self.object, SpatialVelocity(np.array(velocity[3:]), np.array(velocity[:3])))
        self.tool_m = np.array(tool_m, float)
        self.plant.SetFreeBodyPose(self.context, self.tool, RigidTransform(self.tool_m))
        self.plant.SetFreeBodySpatialVelocity(self.context, self.tool, SpatialVelocity(np.zeros(3), np.zeros(3)))

    def step(self, force, torque, tool_m):
        h = self.step_s
        v = (tool_m - self.tool_m) / h
        if force is not None or not self.forced:
            self.load.F_Bq_W = SpatialForce(np.zeros(3) if torque is None else torque, np.zeros(3) if force is None else force)
            self.port.FixValue(self.context, [self.load])
            self.forced = True
        x = self.plant.GetPositionsAndVelocities(self.context)
        n = self.plant.num_positions()
        x[self.tool_place:self.tool_place + 7] = [1, 0, 0, 0, *self.tool_m]
        x[n + self.tool_speed:n + self.tool_speed + 6] = [0, 0, 0, *v]
        self.plant.SetPositionsAndVelocities(self.context, x)
        self.diagram.ExecuteForcedEvents(self.root)
        self.root.SetTime(self.root.get_time() + h)
        self.tool_m = tool_m
        speed = self.plant.GetVelocities(self.context)[self.tool_speed:self.tool_speed + 6]
        return np.concatenate([(speed[3:] - v) * (self.tool_kg / h), speed[:3] * (self.tool_kgm2 / h)])

    def state(self):
        x = self.plant.GetPositionsAndVelocities(self.context)
        q = x[self.place_of:self.place_of + 7]
        v = x[self.plant.num_positions() + self.speed_of:][:6]
        return np.array([q[4], q[5], q[6], q[1], q[2], q[3], q[0]]), np.array([v[3], v[4], v[5], v[0], v[1], v[2]])

    def set_friction(self, mu):
        if abs(mu - self.mu) < 1e-3 * self.mu:
            return
        self.mu = mu
        context = self.scene_graph.GetMyMutableContextFromRoot(self.root)
        self.scene_graph.AssignRole(context, self.plant.get_source_id(), self.table, self.material(mu / 2, rigid=True), RoleAssign.kReplace)

    def set_mass(self, share):
        mass, _ = self.body.shares(share)
        self.object.SetMass(self.context, mass)
