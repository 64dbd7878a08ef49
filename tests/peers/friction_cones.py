#!/usr/bin/env python3
"""A box slides on a level table in engines with pyramids of friction and with Coulomb's cone: where it is after 0.2 s.

    python tests/peers/friction_cones.py > crates/physics-model/tests/data/friction_cones.csv

Of a box of 0.5 kg and 10 x 10 x 2 cm, μ = 0.4, that begins at 1.5 m/s in a direction that is counted from +x. MuJoCo's pyramid has its edges on the
axes, those of DART and Bullet their faces across them; MuJoCo's elliptic cone, DART's exact solver and Bullet's default are Coulomb's. Versions: mujoco
4.0.0, dartpy 6.20.0, pybullet 3.2.7. Bullet was added when the law was done: nothing was fitted to it."""

import math

import dartpy as dart
import mujoco
import pybullet

MU, SPEED, SECONDS, STEP = 0.4, 1.5, 0.2, 0.0005
SIZE, MASS = (0.1, 0.1, 0.02), 0.5
STEPS, SETTLE = round(SECONDS / STEP), 1000


def in_mujoco(cone, velocity):
    half = " ".join(str(s / 2) for s in SIZE)
    friction = f'friction="{MU} 0 0"'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{STEP}" cone="{cone}" impratio="10"/><worldbody><geom type="plane" size="0 0 1" {friction}/>'
        f'<body pos="0 0 {SIZE[2] / 2}"><freejoint/><geom type="box" size="{half}" mass="{MASS}" condim="3" {friction}/></body></worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, SETTLE)
    begin = data.qpos[:2].copy()
    data.qvel[:2] = velocity
    mujoco.mj_step(model, data, STEPS)
    return data.qpos[:2] - begin


def in_dart(cone, velocity):
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
    begin = box.getPositions()[3:5]
    box.setVelocities([0, 0, 0, *velocity, 0])
    for _ in range(STEPS):
        world.step()
    return box.getPositions()[3:5] - begin


def in_bullet(cone, velocity):
    pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=STEP, enableConeFriction=int(cone == "coulomb"), numSolverIterations=200)
    table = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[s / 2 for s in SIZE])
    box = pybullet.createMultiBody(MASS, shape, basePosition=[0, 0, SIZE[2] / 2])
    # Of a pair counts the product.
    pybullet.changeDynamics(table, -1, lateralFriction=1.0)
    pybullet.changeDynamics(box, -1, lateralFriction=MU, linearDamping=0, angularDamping=0)
    place = lambda: pybullet.getBasePositionAndOrientation(box)[0][:2]
    for _ in range(SETTLE):
        pybullet.stepSimulation()
    begin = place()
    pybullet.resetBaseVelocity(box, [*velocity, 0])
    for _ in range(STEPS):
        pybullet.stepSimulation()
    end = place()
    pybullet.disconnect()
    return [b - a for a, b in zip(begin, end)]


def main():
    print("engine,cone,direction_deg,x_m,y_m")
    for engine, run, cones in (("mujoco", in_mujoco, ("elliptic", "pyramidal")), ("dart", in_dart, ("coulomb", "pyramidal")),
                               ("bullet", in_bullet, ("coulomb", "pyramidal"))):
        for cone in cones:
            for degrees in (0, 10, 20, 30, 40, 55, 75, 130, 250):
                angle = math.radians(degrees)
                x, y = run(cone, [SPEED * math.cos(angle), SPEED * math.sin(angle)])
                print(f"{engine},{cone},{degrees},{x:.4f},{y:.4f}")


if __name__ == "__main__":
    main()
