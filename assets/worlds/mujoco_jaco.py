#!/usr/bin/env python3
"""A Jaco that pushes an object in MuJoCo, behind the world protocol (docs/src/reference/world-protocol.md). It stands in
for the real arm.

    pip install mujoco numpy
    cargo xtask eval --domain obstacle --robot jaco --world "python3 assets/worlds/mujoco_jaco.py"

Nothing of the planner's physics is in it. MuJoCo reads the URDF; the joints are position servos (5000 N·m/rad, critically damped, gravity
compensated, a rotor inertia of 0.02 kg·m²) that a load deflects; contacts are MuJoCo's with an elliptic cone, springs of 5 ms and steps of
about a millisecond. A joint torque is what its servo gives, compensation of gravity included, which is M q'' + C q' + g - J^T w by the
equations of motion; the sensor reads its mean over the action. Scenes come from the distributions in the hello message, with the trial's
seed. The obstacle is there in as many trials as they say, and never observed.
"""

import json
import math
import pathlib
import statistics
import sys

VERSION = "1"
URDF = pathlib.Path(__file__).resolve().parent.parent / "robots" / "jaco.urdf"
SUBSTEPS = 16  # of a control step
STIFFNESS_NMPRAD = 5000.0
ROTOR_KGM2 = 0.02
CONTACT = {"solref": [0.005, 1.0], "solimp": [0.9, 0.95, 0.001, 0.5, 2.0]}
ROLLING_LEVER_M = 0.002
SETTLE_STEPS = 60
GAP_M = 0.006  # between object and obstacle at the start
DRAWS = 1000

try:
    import mujoco
    import numpy as np
except ImportError as error:
    mujoco, missing = None, str(error)


# Scenes.


def truncated_normal(rng, d):
    if d["stddev"] == 0:
        return min(max(d["mean"], d["low"]), d["high"])
    normal = statistics.NormalDist(d["mean"], d["stddev"])
    low, high = normal.cdf(d["low"]), normal.cdf(d["high"])
    share = min(max(low + (high - low) * rng.random(), 1e-12), 1 - 1e-12)
    return min(max(normal.inv_cdf(share), d["low"]), d["high"])


def draw_body(rng, d, table):
    """Shape, sizes, mass and pose of one body; None for no obstacle."""
    shape = ("box", "cylinder", "sphere", None)[int(rng.choice(len(d["shape"]), p=d["shape"]))]
    if shape is None:
        return None
    size = [truncated_normal(rng, part) for part in d["size_m"][shape]]
    extent = {"box": size, "cylinder": [2 * size[0], 2 * size[0], size[-1]], "sphere": [2 * size[0]] * 3}[shape]
    body = {"shape": shape, "size": size, "extent": extent, "yaw": truncated_normal(rng, d["yaw_rad"])}
    mass = d["mass_kg"]
    body["mass"] = max(rng.gamma(mass["shape"], mass["mean"] / mass["shape"]), 0.02)
    body["pos"] = [truncated_normal(rng, d["x_m"]), truncated_normal(rng, d["y_m"]), table + extent[2] / 2]
    body["com"], body["friction"] = [0.0] * 3, None
    if "com_m" in d:
        com = [truncated_normal(rng, axis) for axis in d["com_m"]]
        body["com"] = [min(max(c, -e / 4), e / 4) for c, e in zip(com, extent)]
        if shape == "sphere":  # stands on its heavy side, as the planner's spheres do
            body["com"] = [0.0, 0.0, -abs(body["com"][2])]
        body["friction"] = truncated_normal(rng, d["friction"])
    return body


def place(body):
    return body and {"position_m": body["pos"], "yaw_rad": body["yaw"]}


def drawn(obj, obstacle):
    """What the scene was drawn as, for statistics of a belief; places are those before bodies settle."""
    plain = lambda body: body and {"shape": body["shape"], "mass_kg": body["mass"], "size_m": (body["size"] + [0.0, 0.0])[:3]}
    theta = {"object": {**plain(obj), "com_m": obj["com"], "friction": obj["friction"]}, "obstacle": plain(obstacle)}
    return {"theta": theta, "object": place(obj), "obstacle": place(obstacle)}


def inertia(body):
    m, s = body["mass"], body["size"]
    if body["shape"] == "box":
        return [m * (s[1] ** 2 + s[2] ** 2) / 12, m * (s[0] ** 2 + s[2] ** 2) / 12, m * (s[0] ** 2 + s[1] ** 2) / 12]
    if body["shape"] == "cylinder":
        across = m * (3 * s[0] ** 2 + s[1] ** 2) / 12
        return [across, across, m * s[0] ** 2 / 2]
    return [0.4 * m * s[0] ** 2] * 3


def add_body(spec, name, body, free):
    at = spec.worldbody.add_body(name=name, pos=body["pos"], quat=[math.cos(body["yaw"] / 2), 0, 0, math.sin(body["yaw"] / 2)])
    if free:
        at.add_freejoint()
        at.explicitinertial, at.mass, at.ipos, at.inertia = True, body["mass"], body["com"], inertia(body)
    s = body["size"]
    kind, size = {"box": (mujoco.mjtGeom.mjGEOM_BOX, [v / 2 for v in s]),
                  "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, [s[0], s[-1] / 2, 0]),
                  "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, [s[0], 0, 0])}[body["shape"]]
    at.add_geom(name=name, type=kind, size=size, contype=0, conaffinity=0)


def add_pair(spec, a, b, friction, rolls=False):
    lever = ROLLING_LEVER_M if rolls else 0.0
    spec.add_pair(geomname1=a, geomname2=b, condim=6 if rolls else 3, friction=[friction, friction, 1e-4, lever, lever], **CONTACT)


def build(hello, obj, obstacle):
    """The compiled scene: the arm from its URDF, the tool's shapes from the hello message, the bodies."""
    robot, task, scene = hello["robot"], hello["task"], hello["scene"]
    spec = mujoco.MjSpec.from_string(URDF.read_text())
    spec.compiler.fusestatic = False  # the hand stays a body of its own
    spec.option.timestep = task["control_period_secs"] / SUBSTEPS
    spec.option.gravity = [0, 0, -scene["gravity_mps2"]]
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for geom in list(spec.geoms):
        spec.delete(geom)
    for joint in list(spec.joints):
        if joint.name in robot["joints"]:
            joint.armature, joint.limited = ROTOR_KGM2, False
            continue
        # Held where the scenario holds it: turned, and no joint any longer.
        turn, quat = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, np.array(joint.axis), robot["locked_joints"][joint.name])
        body = joint.parent
        mujoco.mju_mulQuat(quat, np.array(body.quat), turn)
        body.quat = quat
        spec.delete(joint)
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0
    for name in robot["joints"]:
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[1] = STIFFNESS_NMPRAD, -STIFFNESS_NMPRAD
    tool, names = spec.body("end_effector"), []
    for i, shape in enumerate(robot["tool_shapes"]):
        (kind, s), = shape.items()
        names.append(f"tool{i}")
        common = {"name": names[-1], "contype": 0, "conaffinity": 0, "mass": 0.0}
        if kind == "ball":
            tool.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=s["center_m"], size=[s["radius_m"], 0, 0], **common)
        else:
            tool.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=s["a_m"] + s["b_m"], size=[s["radius_m"], 0, 0], **common)
    spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], pos=[0, 0, task["table_height_m"]],
                            contype=0, conaffinity=0)
    add_body(spec, "object", obj, True)
    add_pair(spec, "table", "object", obj["friction"], obj["shape"] == "sphere")
    pushed = [("object", min(scene["tool_friction"], obj["friction"]))]
    if obstacle:
        movable = scene["obstacle_mobility"] == "movable"
        add_body(spec, "obstacle", obstacle, movable)
        add_pair(spec, "object", "obstacle", min(scene["obstacle_friction"], obj["friction"]))
        if movable:
            add_pair(spec, "table", "obstacle", scene["obstacle_friction"], obstacle["shape"] == "sphere")
        pushed.append(("obstacle", min(scene["tool_friction"], scene["obstacle_friction"])))
    for body, friction in pushed:
        for name in names:
            add_pair(spec, name, body, friction)
    return spec.compile(), names


# The world.


def minimum_jerk(t):
    return t ** 3 * (10 - 15 * t + 6 * t * t), 30 * t * t * (1 - t) ** 2


class World:
    def __init__(self, hello):
        self.hello, self.task, self.robot = hello, hello["task"], hello["robot"]
        if self.robot["name"] != "jaco":
            raise ValueError(f"this world has a jaco, {self.robot['name']} was asked for")
        self.joints = len(self.robot["joints"])
        self.rotation = np.array(self.robot["tool_rotation"])

    def reset(self, trial, seed):
        self.rng = np.random.default_rng(seed)
        distribution = self.hello["scene"]["distribution"]
        for _ in range(DRAWS):
            obj = draw_body(self.rng, distribution["object"], self.task["table_height_m"])
            self.obstacle = draw_body(self.rng, distribution["obstacle"], self.task["table_height_m"])
            self.m, self.tool_names = build(self.hello, obj, self.obstacle)
            self.d = mujoco.MjData(self.m)
            self.ik = mujoco.MjData(self.m)
            n = self.joints
            self.tool = np.array(self.task["tool_start_m"])
            start = self.solve(np.array(self.robot["start_rad"]), self.tool)
            if start is None:
                raise ValueError("the arm does not reach tool_start_m")
            self.d.qpos[:n] = start
            mujoco.mj_forward(self.m, self.d)
            if self.possible():
                break
        else:
            raise ValueError(f"{DRAWS} draws in a row overlapped")
        self.drawn = drawn(obj, self.obstacle)
        self.names = [self.m.geom(i).name for i in range(self.m.ngeom)]
        mass = np.zeros((self.m.nv, self.m.nv))
        mujoco.mj_fullM(self.m, self.d, mass)
        self.damping = 2 * np.sqrt(STIFFNESS_NMPRAD * np.diag(mass)[:n])
        self.m.actuator_biasprm[:, 2] = -self.damping
        self.commanded = start
        self.hold(start)
        for _ in range(SETTLE_STEPS):
            mujoco.mj_step(self.m, self.d)
        return {"trial": trial, "observation": self.observe(self.torques()), "joints_rad": self.d.qpos[:n].tolist(),
                "has_obstacle": self.obstacle is not None, "drawn": self.drawn}

    def act(self, step, move):
        """One tool move: straight, minimum jerk. Where a joint takes too much, the arm goes back along its way."""
        task, n, steps = self.task, self.joints, self.task["control_steps"]
        duration = steps * task["control_period_secs"]
        target, start_q = self.tool + np.array(move), self.commanded
        inside = all(low - 1e-9 <= v <= high + 1e-9 for v, (low, high) in zip(target, task["reach"].values()))
        end = self.solve(start_q, target) if inside else None
        middle = self.solve(start_q, (self.tool + target) / 2) if inside else None
        out_of_reach = end is None or middle is None
        if out_of_reach:
            target, middle, end = self.tool, start_q, start_q
        linear, quadratic = 4 * middle - 3 * start_q - end, 2 * (start_q + end - 2 * middle)
        before, torque_sum = self.position(), np.zeros(n)
        large_force, touched, stopped, made, share = False, False, out_of_reach, 0, 0.0
        for control in range(1, steps + 1):
            goes_on = not stopped
            made = control if goes_on else made
            share_from, share_to = share, 0.0 if out_of_reach else minimum_jerk(made / steps)[0]
            torque, force = np.zeros(n), np.zeros(3)
            for sub in range(1, SUBSTEPS + 1):
                if goes_on:
                    share, rate = minimum_jerk((control - 1 + sub / SUBSTEPS) / steps)
                    rate /= duration
                else:
                    share = share_from + (share_to - share_from) * sub / SUBSTEPS
                    rate = (share_to - share_from) / task["control_period_secs"]
                self.hold(start_q + linear * share + quadratic * share * share, (linear + 2 * quadratic * share) * rate)
                mujoco.mj_step(self.m, self.d)
                torque += self.torques() / SUBSTEPS
                on_tool, on_obstacle = self.contacts()
                force += on_tool / SUBSTEPS
                touched |= on_obstacle
            torque_sum += torque
            if force.any() and np.abs(torque).max() > task["large_force_limit"]:
                large_force = True
                if force @ (target - self.tool) < 0:
                    stopped, made = True, max(made - 1, 0)
        self.commanded = start_q + linear * share + quadratic * share * share
        self.tool = self.tool + share * (target - self.tool)
        after = self.position()
        goal = task["goal"]
        at_goal = math.hypot(after[0] - goal["x_m"], after[1] - goal["y_m"]) <= goal["radius_m"]
        speed = float(np.linalg.norm(self.d.body("object").cvel[3:]))
        good = bool(np.isfinite(self.d.qpos).all()) and speed < 5 and after[2] > task["table_height_m"] + 0.004
        if not good:
            raise ValueError("the simulation became unstable")
        moved = float(np.linalg.norm(after - before)) > task["moved_threshold_m"]
        return {"step": step, "observation": self.observe(torque_sum / steps), "joints_rad": self.d.qpos[:n].tolist(),
                "outcome": "terminal" if at_goal else "continue",
                "events": {"large_force": large_force, "out_of_reach": out_of_reach, "object_moved": moved, "goal": at_goal,
                           "obstacle_touched": touched}}

    def hold(self, q, rate=0.0):
        # The velocity term makes up for the servo's damping, so that it follows without lag.
        self.d.ctrl[:] = q + self.damping * rate / STIFFNESS_NMPRAD

    def torques(self):
        return self.d.qfrc_actuator[:self.joints] + self.d.qfrc_gravcomp[:self.joints]

    def position(self):
        return self.d.body("object").xpos.copy()

    def contacts(self):
        """Force of the last step on the tool, base axes, N, and whether object or tool pressed on the obstacle."""
        total, touched, wrench = np.zeros(3), False, np.zeros(6)
        for i in range(self.d.ncon):
            contact = self.d.contact[i]
            a, b = self.names[contact.geom1], self.names[contact.geom2]
            if "table" in (a, b):
                continue
            mujoco.mj_contactForce(self.m, self.d, i, wrench)
            touched |= "obstacle" in (a, b) and wrench[0] > 0
            if a in self.tool_names or b in self.tool_names:
                force = contact.frame.reshape(3, 3).T @ wrench[:3]  # on the second geom
                total += force if b in self.tool_names else -force
        return total, bool(touched)

    def observe(self, torques):
        noise, pose = self.hello["scene"]["noise"], self.d.joint(self.joints).qpos
        values = torques + noise["joint_torque_nm"] * self.rng.standard_normal(self.joints)
        position = pose[:3] + noise["position_m"] * self.rng.standard_normal(3)
        axis, turn, quat = noise["orientation_rad"] * self.rng.standard_normal(3), np.zeros(4), np.zeros(4)
        angle = float(np.linalg.norm(axis))
        mujoco.mju_axisAngle2Quat(turn, axis / max(angle, 1e-12), angle)
        mujoco.mju_mulQuat(quat, turn, pose[3:])
        w, x, y, z = quat if quat[0] >= 0 else -quat
        return [float(v) for v in (*values, *position, x, y, z, w)]

    def possible(self):
        position, goal = self.position(), self.task["goal"]
        if math.hypot(position[0] - goal["x_m"], position[1] - goal["y_m"]) <= goal["radius_m"]:
            return False
        gap = lambda a, b: mujoco.mj_geomDistance(self.m, self.d, self.m.geom(a).id, self.m.geom(b).id, 1.0, None)
        bodies = ["object", "obstacle"] if self.obstacle else ["object"]
        return all(gap(t, b) > 0 for t in self.tool_names for b in bodies) and \
            (not self.obstacle or gap("object", "obstacle") > GAP_M)

    def solve(self, seed, position):
        """Joint positions near the seed that bring the tool there in its fixed orientation; None where there are none."""
        m, d, n, q = self.m, self.ik, self.joints, seed.copy()
        jacobian, turn, error = np.zeros((6, m.nv)), np.zeros(3), np.zeros(6)
        tool = m.body("end_effector").id
        for _ in range(50):
            d.qpos[:n] = q
            mujoco.mj_kinematics(m, d)
            mujoco.mj_comPos(m, d)
            error[:3] = position - d.xpos[tool]
            quat = np.zeros(4)
            mujoco.mju_mat2Quat(quat, (self.rotation @ d.xmat[tool].reshape(3, 3).T).flatten())
            mujoco.mju_quat2Vel(turn, quat, 1.0)
            error[3:] = turn
            if np.abs(error).max() < 1e-8:
                return q
            mujoco.mj_jacBody(m, d, jacobian[:3], jacobian[3:], tool)
            j = jacobian[:, :n]
            q = q + j.T @ np.linalg.solve(j @ j.T + 1e-10 * np.eye(6), error)
        return None


def main():
    world = None
    for line in sys.stdin:
        (name, body), = json.loads(line).items()
        if name == "close":
            return
        try:
            if name == "hello":
                if mujoco is None:
                    raise ValueError(f"{missing}: pip install mujoco numpy")
                world = World(body)
                answer = {"protocol": 1, "world": "mujoco-jaco", "version": f"{VERSION}-mujoco{mujoco.__version__}", "robot": "jaco"}
            elif name == "reset":
                answer = world.reset(body["trial"], body["seed"])
            else:
                answer = world.act(body["step"], body["move_m"])
        except ValueError as error:
            name, answer = "error", {"message": str(error)}
        print(json.dumps({name: answer}), flush=True)


if __name__ == "__main__":
    main()
