"""MuJoCo: forward simulation of a scene, and rigid-body dynamics of a chain for controllers and for sizing."""

from __future__ import annotations

import mujoco
import numpy as np

from scene import Scene

DUMMY = '<inertial pos="0 0 0" mass="1e-7" diaginertia="1e-10 1e-10 1e-10"/>'


def _text(values) -> str:
    return " ".join(f"{v:.17g}" for v in np.ravel(values))


def _quaternion(rotation: np.ndarray) -> str:
    q = np.empty(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(rotation).ravel())
    return _text(q)


def _inertial(body) -> str:
    i = body.inertia
    full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return f'<inertial pos="{_text(body.com)}" mass="{body.mass:.17g}" fullinertia="{_text(full)}"/>'


def scene_xml(scene: Scene, step_secs: float) -> str:
    """The scene in MuJoCo's own format.  Joint names: motor_I, spring_I (elastic joints), table."""
    # friction rows as stiff as MuJoCo permits: creep of a sticking joint stays below 1e-6 rad/s
    soft = f'solreffriction="{2.0 * step_secs:.17g} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"'
    opening, closing = "", ""
    if scene.table:
        t = scene.table
        opening += (f'<body name="table"><inertial pos="0 0 0" mass="{t.mass:.17g}" diaginertia="1 1 1"/>'
                    f'<joint name="table" type="slide" axis="{_text(t.direction)}" stiffness="{t.stiffness:.17g}" '
                    f'damping="{t.damping:.17g}"/>')
        closing += "</body>"
    for i, body in enumerate(scene.bodies):
        friction, elastic = scene.friction[i], scene.elastic.get(i)
        loss = 0.0 if friction.bristle_rad else max(friction.coulomb, 1e-9 if friction.varies else 0.0)
        armature = scene.armature[i] + (elastic.rotor_inertia if elastic else 0.0)
        motor = (f'<joint name="motor_{i}" type="hinge" axis="{_text(body.axis)}" armature="{armature:.17g}" '
                 f'damping="{friction.viscous:.17g}" frictionloss="{loss:.17g}" {soft}/>')
        place = f'pos="{_text(body.position)}" quat="{_quaternion(body.rotation)}"'
        if elastic:
            native = "" if elastic.gap_rad else f'stiffness="{elastic.stiffness:.17g}" damping="{elastic.damping:.17g}"'
            opening += (f'<body name="rotor_{i}" {place}>{DUMMY}{motor}<body name="body_{i}">{_inertial(body)}'
                        f'<joint name="spring_{i}" type="hinge" axis="{_text(body.axis)}" {native}/>')
            closing += "</body></body>"
        else:
            opening += f'<body name="body_{i}" {place}>{_inertial(body)}{motor}'
            closing += "</body>"
    opening += f'<site name="tip" pos="{_text(scene.tip_position)}" quat="{_quaternion(scene.tip_rotation)}"/>'
    return (f'<mujoco><compiler angle="radian" autolimits="false"/><option timestep="{step_secs:.17g}" '
            f'gravity="{_text(scene.gravity)}" integrator="Euler" solver="Newton" tolerance="1e-12" iterations="50"/>'
            f'<worldbody>{opening}{closing}</worldbody></mujoco>')


class MujocoEngine:
    """Forward simulation with semi-implicit Euler steps; Coulomb friction is MuJoCo's `frictionloss`."""

    name = "mujoco"

    def __init__(self, scene: Scene, stiff: bool):
        del stiff  # the step is short enough for all scenes
        self.scene, self.step_secs = scene, 0.00025
        self.model = mujoco.MjModel.from_xml_string(scene_xml(scene, self.step_secs))
        self.data = mujoco.MjData(self.model)
        address = lambda name: self.model.jnt_dofadr[mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, name)]
        self.motor = np.array([address(f"motor_{i}") for i in range(len(scene.bodies))])
        self.springs = {i: int(address(f"spring_{i}")) for i in scene.elastic}
        self.table = int(address("table")) if scene.table else None
        self.gaps = {i: e for i, e in scene.elastic.items() if e.gap_rad}
        self.varying = {i: f for i, f in enumerate(scene.friction) if f.varies}
        self.tip = int(self.model.body(f"body_{len(scene.bodies) - 1}").id)

    def reset(self, q: np.ndarray) -> None:
        """Rest at motor positions `q` with relaxed springs."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.motor] = q
        mujoco.mj_forward(self.model, self.data)

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Motor positions and velocities."""
        return self.data.qpos[self.motor], self.data.qvel[self.motor]

    def deflection(self) -> np.ndarray:
        """Link minus motor positions."""
        out = np.zeros(len(self.motor))
        for i, dof in self.springs.items():
            out[i] = self.data.qpos[dof]
        return out

    def step(self, torque: np.ndarray, log_secs: float) -> None:
        """One step with motor torques `torque` [N m]."""
        model, data = self.model, self.data
        for i, law in self.varying.items():
            dof = self.motor[i]
            v = data.qvel[dof]
            transmitted = torque[i] + data.qfrc_constraint[dof] - model.dof_damping[dof] * v
            level, viscous = law.level(v, transmitted, log_secs)
            model.dof_frictionloss[dof] = max(level, 1e-9)
            model.dof_damping[dof] = viscous
        if self.scene.cable or self.gaps:
            data.qfrc_applied[:] = 0.0
        data.qfrc_applied[self.motor] = torque
        if self.scene.table:
            data.qfrc_applied[self.table] = self.scene.table.force(log_secs)
        for i, elastic in self.gaps.items():
            dof = self.springs[i]
            data.qfrc_applied[dof] = elastic.torque(data.qpos[dof], data.qvel[dof])
        if self.scene.cable:
            self._pull_cable()
        mujoco.mj_step(model, data)

    def _pull_cable(self) -> None:
        model, data, cable = self.model, self.data, self.scene.cable
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        point = data.xpos[self.tip] + data.xmat[self.tip].reshape(3, 3) @ cable.point
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, point, self.tip)
        force = cable.force(point, jacobian @ data.qvel)
        if force is not None:
            data.qfrc_applied += jacobian.T @ force

    def exact(self) -> tuple[np.ndarray, ...]:
        """Of the step just made, at its start: accelerations of the motors and the friction torques on them."""
        data = self.data
        friction = -data.qfrc_constraint[self.motor] - data.qfrc_passive[self.motor]
        return data.qacc[self.motor].copy(), friction


class RigidModel:
    """Rigid-body dynamics of a scene without friction, springs, table: what a controller would compute."""

    def __init__(self, scene: Scene):
        bare = Scene(scene.bodies, scene.tip_rotation, scene.tip_position, scene.gravity,
                     [type(f)() for f in scene.friction], scene.armature)
        self.model = mujoco.MjModel.from_xml_string(scene_xml(bare, 0.001))
        self.data = mujoco.MjData(self.model)
        self.n = len(scene.bodies)

    def inverse(self, q, v, a) -> np.ndarray:
        """Joint torques [N m] for a motion."""
        self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = q, v, a
        mujoco.mj_inverse(self.model, self.data)
        return self.data.qfrc_inverse.copy()

    def inverse_rows(self, q, v, a) -> np.ndarray:
        return np.array([self.inverse(*row) for row in zip(q, v, a)])

    def mass_matrix(self, q) -> np.ndarray:
        self.data.qpos[:], self.data.qvel[:] = q, 0.0
        mujoco.mj_forward(self.model, self.data)
        out = np.zeros((self.n, self.n))
        mujoco.mj_fullM(self.model, self.data, out)
        return out

    def tip(self, q) -> np.ndarray:
        """Position of the tip frame [m], base axes."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.site_xpos[0].copy()
