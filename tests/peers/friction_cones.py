#!/usr/bin/env python3
"""A box slides on a level table in engines with pyramids of friction and with Coulomb's cone: where it is after 0.2 s. One that also spins: where it is after
0.3 s, when most have stopped, and how far it has turned.

    python tests/peers/friction_cones.py > crates/physics-model/tests/data/friction_cones.csv
    python tests/peers/friction_cones.py spin > crates/physics-model/tests/data/friction_cones_spin.csv

Of a box of 0.5 kg and 10 x 10 x 2 cm, μ = 0.4, that begins at 1.5 m/s in a direction that is counted from +x. MuJoCo's pyramid has its edges on the
axes, those of DART and Bullet their faces across them; MuJoCo's elliptic cone, DART's exact solver and Bullet's default are Coulomb's. Versions: mujoco
4.0.0, dartpy 6.20.0, pybullet 3.2.7. Bullet was added when the law was done: nothing was fitted to it."""

import math
import sys

import dartpy as dart
import mujoco
import pybullet

MU, SPEED, STEP = 0.4, 1.5, 0.0005
SIZE, MASS = (0.1, 0.1, 0.02), 0.5
SETTLE = 1000


def turned(before, after):
    """By how much yaw has grown in a step, rad."""
    return (after - before + math.pi) % (2 * math.pi) - math.pi


def yaw_of(x, y, z, w):
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def follow(step, place, steps):
    """Steps the box; how far it has gone and turned: x, y, yaw."""
    (x, y, before), total = place(), 0.0
    first = (x, y)
    for _ in range(steps):
        step()
        x, y, yaw = place()
        total, before = total + turned(before, yaw), yaw
    return x - first[0], y - first[1], total


def in_mujoco(cone, velocity, spin, steps):
    half = " ".join(str(s / 2) for s in SIZE)
    friction = f'friction="{MU} 0 0"'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{STEP}" cone="{cone}" impratio="10"/><worldbody><geom type="plane" size="0 0 1" {friction}/>'
        f'<body pos="0 0 {SIZE[2] / 2}"><freejoint/><geom type="box" size="{half}" mass="{MASS}" condim="3" {friction}/></body></worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, SETTLE)
    data.qvel[:] = [*velocity, 0, 0, 0, spin]

    def place():
        w, x, y, z = data.qpos[3:]
        return data.qpos[0], data.qpos[1], yaw_of(x, y, z, w)

    return follow(lambda: mujoco.mj_step(model, data), place, steps)


def in_dart(cone, velocity, spin, steps):
    world = dart.simulation.World()
    world.setTimeStep(STEP)
    world.setGravity([0, 0, -9.81])
    if cone == "coulomb":
        world.getConstraintSolver().setBoxedLcpSolver(dart.constraint.NsgsFrictionSolver())
    for name, size, at in (("table", (20.0, 20.0, 1.0), -0.5), ("box", SIZE, SIZE[2] / 2)):
        skeleton = dart.dynamics.Skeleton(name)
        free = name == "box"
        make = skeleton.createFreeJointAndBodyNodePair if free else skeleton.createWeldJointAndBodyNodePair
        joint, body = make()
        shape = dart.dynamics.BoxShape(list(size))
        node = body.createShapeNode(shape)
        node.createVisualAspect(), node.createCollisionAspect(), node.createDynamicsAspect()
        node.getDynamicsAspect().setFrictionCoeff(MU)
        if free:
            body.setInertia(dart.dynamics.Inertia(MASS, [0, 0, 0], shape.computeInertia(MASS)))
            joint.setPositions([0, 0, 0, 0, 0, at])
            box = joint
        else:
            place = dart.math.Isometry3()
            place.set_translation([0, 0, at])
            joint.setTransformFromParentBodyNode(place)
        world.addSkeleton(skeleton)
    for _ in range(SETTLE):
        world.step()
    box.setVelocities([0, 0, spin, *velocity, 0])

    def place():
        position = box.getPositions()
        return position[3], position[4], position[2]

    return follow(world.step, place, steps)


def in_bullet(cone, velocity, spin, steps):
    pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=STEP, enableConeFriction=int(cone == "coulomb"), numSolverIterations=200)
    table = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[s / 2 for s in SIZE])
    box = pybullet.createMultiBody(MASS, shape, basePosition=[0, 0, SIZE[2] / 2])
    # Of a pair counts the product.
    pybullet.changeDynamics(table, -1, lateralFriction=1.0)
    pybullet.changeDynamics(box, -1, lateralFriction=MU, linearDamping=0, angularDamping=0)

    def place():
        position, orientation = pybullet.getBasePositionAndOrientation(box)
        return position[0], position[1], yaw_of(*orientation)

    for _ in range(SETTLE):
        pybullet.stepSimulation()
    pybullet.resetBaseVelocity(box, [*velocity, 0], [0, 0, spin])
    found = follow(pybullet.stepSimulation, place, steps)
    pybullet.disconnect()
    return found


ENGINES = (("mujoco", in_mujoco, ("elliptic", "pyramidal")), ("dart", in_dart, ("coulomb", "pyramidal")),
           ("bullet", in_bullet, ("coulomb", "pyramidal")))


def sliding():
    print("engine,cone,direction_deg,x_m,y_m")
    for engine, run, cones in ENGINES:
        for cone in cones:
            for degrees in (0, 10, 20, 30, 40, 55, 75, 130, 250):
                angle = math.radians(degrees)
                x, y, _ = run(cone, [SPEED * math.cos(angle), SPEED * math.sin(angle)], 0.0, round(0.2 / STEP))
                print(f"{engine},{cone},{degrees},{x:.4f},{y:.4f}")


def spinning():
    print("engine,cone,vx_mps,vy_mps,spin_rps,x_m,y_m,yaw_rad")
    for engine, run, cones in ENGINES:
        for cone in cones:
            for vx, vy, spin in ((0, 0, 10), (0.6, 0, 10), (0.6, 0, -10), (0.4, 0.4, 10), (1, 0, 3), (1, 0.3, 3)):
                x, y, yaw = run(cone, [vx, vy], spin, round(0.3 / STEP))
                print(f"{engine},{cone},{vx},{vy},{spin},{x:.4f},{y:.4f},{yaw:.4f}")


if __name__ == "__main__":
    spinning() if sys.argv[1:] == ["spin"] else sliding()
