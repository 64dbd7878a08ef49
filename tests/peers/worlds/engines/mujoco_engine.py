"""MuJoCo: soft contacts by convex optimisation. `default` has its defaults but for an elliptic cone, `pyramidal` also their
cone, whose friction is less by up to 1 / √2 between the axes. Contacts are quicker for objects thinner than 10 cm, which would sink in
when they land."""

import math

import mujoco
import numpy as np

from engines import TOOL_RATIO

VERSION = mujoco.__version__
# Time constant of a contact (of objects of 10 cm and more), solimp, cone, impratio, step.
VARIANTS = {
    "default": (0.02, "0.9 0.95 0.001 0.5 2", "elliptic", 1, 0.002),
    "soft": (0.05, "0.8 0.9 0.002 0.5 2", "elliptic", 1, 0.002),
    "hard": (0.01, "0.97 0.99 0.0005 0.5 2", "elliptic", 10, 0.001),
    "pyramidal": (0.02, "0.9 0.95 0.001 0.5 2", "pyramidal", 1, 0.002),
}


def words(values):
    return " ".join(repr(float(v)) for v in values)


class Engine:
    unsupported = set()
    unsuitable = set()

    def __init__(self, body, variant):
        self.body = body
        constant, solimp, cone, impratio, self.step_s = VARIANTS[variant]
        constant *= min(1.0, math.sqrt(min(body.half_m) / 0.05))
        solref = f"{max(constant, 2.5 * self.step_s):.4g} 1"
        if body.restitution:
            # Direct stiffness and damping: e = exp(−π ζ / √(1 − ζ²)).
            damping = -math.log(body.restitution) / math.hypot(math.pi, math.log(body.restitution))
            solref, solimp, self.step_s = f"{-600.0 ** 2} {-2 * damping * 600.0}", "0.99 0.99 0.001 0.5 2", 0.0005
        if body.compliance:
            # Rate of one of the contacts that share the load: static sinking is g / ω² of the whole.
            rate, damping = 2 * math.pi * body.compliance[0], body.compliance[1]
            solref, solimp, self.step_s = f"{-rate ** 2} {-2 * damping * rate}", "0.001 0.001 0.001 0.5 2", 0.0005
        self.m = mujoco.MjModel.from_xml_string(self.xml(solref, solimp, cone, impratio))
        self.d = mujoco.MjData(self.m)
        # Views of the state: the properties are slow.
        self.q, self.v, self.load = self.d.qpos, self.d.qvel, self.d.xfrc_applied[1]
        self.tool_q, self.tool_v, self.turn = self.d.qpos[7:14], self.d.qvel[6:12], self.d.xmat[1]
        self.still = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        self.pairs = [i for i in range(self.m.npair) if self.m.pair(i).name.startswith("table")]
        self.tool_kg = TOOL_RATIO * body.mass_kg
        self.tool_kgm2 = self.tool_kg * body.tool_radius_m ** 2

    def xml(self, solref, solimp, cone, impratio):
        b = self.body
        off = 'contype="0" conaffinity="0"'
        lift = 0.0003 if b.feet_m else 0.0
        size = {"box": b.half_m, "cylinder": [b.half_m[0], b.half_m[2]], "sphere": b.half_m[:1]}[b.shape]
        if lift:
            size = [*size[:-1], size[-1] - lift / 2]
        pair = (lambda one, two, mu: f'<pair name="{one}-{two}" geom1="{one}" geom2="{two}" condim="3" friction="{mu!r} {mu!r} 0 0 0" '
                                     f'solref="{solref}" solimp="{solimp}"/>')
        pairs = pair("table", "object", b.friction) + pair("tool", "object", b.tool_friction)
        feet, obstacle, r = "", "", b.foot_radius_m
        for i, at in enumerate(b.feet_m):
            feet += f'<geom name="foot{i}" type="sphere" size="{r}" pos="{words(np.array(at) + [0, 0, r])}" {off}/>'
            pairs += pair("table", f"foot{i}", b.friction)
        if b.obstacle:
            o = b.obstacle
            obstacle = (f'<geom name="obstacle" type="cylinder" size="{o["radius_m"]} {o["height_m"] / 2}" '
                        f'pos="{o["x_m"]} {o["y_m"]} {o["height_m"] / 2}" {off}/>')
            pairs += pair("obstacle", "object", min(b.friction, 0.5)) + pair("tool", "obstacle", b.tool_friction)
        i = b.inertia
        full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
        kg = TOOL_RATIO * b.mass_kg
        moment = kg * b.tool_radius_m ** 2
        return f"""<mujoco><compiler angle="radian" boundmass="0" boundinertia="0"/><size memory="4M"/>
<option timestep="{self.step_s}" gravity="{words(b.gravity)}" cone="{cone}" impratio="{impratio}"/>
<worldbody><geom name="table" type="plane" size="0 0 1" {off}/>{obstacle}
<body name="object"><freejoint/><inertial pos="{words(b.com_m)}" mass="{b.mass_kg!r}" fullinertia="{words(full)}"/>
<geom name="object" type="{b.shape}" size="{words(size)}" pos="0 0 {lift / 2}" {off}/>{feet}</body>
<body name="tool" gravcomp="1"><freejoint/><inertial pos="0 0 0" mass="{kg!r}" diaginertia="{moment!r} {moment!r} {moment!r}"/>
<geom name="tool" type="sphere" size="{b.tool_radius_m}" {off}/></body></worldbody><contact>{pairs}</contact></mujoco>"""

    def place(self, pose, velocity, tool_m):
        mujoco.mj_resetData(self.m, self.d)
        # The angular velocity of a free joint is in the body's axes.
        turn = np.zeros(9)
        q = np.array([pose[6], *pose[3:6]])
        mujoco.mju_quat2Mat(turn, q)
        self.d.qpos[:7] = [*pose[:3], *q]
        self.d.qvel[:3] = velocity[:3]
        self.d.qvel[3:6] = turn.reshape(3, 3).T @ np.array(velocity[3:])
        self.tool_m = np.array(tool_m, float)
        mujoco.mj_forward(self.m, self.d)

    def step(self, force, torque, tool_m):
        speed = self.tool_v
        v = (tool_m - self.tool_m) / self.step_s
        self.still[:3] = self.tool_m
        self.tool_q[:] = self.still
        speed[:3], speed[3:] = v, 0.0
        if force is not None:
            self.load[:3], self.load[3:] = force, torque
        mujoco.mj_step(self.m, self.d)
        self.tool_m = tool_m
        wrench = speed * (self.tool_kgm2 / self.step_s)
        wrench[:3] = (speed[:3] - v) * (self.tool_kg / self.step_s)
        return wrench

    def state(self):
        # The matrix is that of the step's begin: good to a step's turn.
        v = self.v[:6].copy()
        v[3:] = self.turn.reshape(3, 3) @ v[3:]
        return self.q[[0, 1, 2, 4, 5, 6, 3]], v

    def set_friction(self, mu):
        self.m.pair_friction[self.pairs, :2] = mu

    def set_mass(self, share):
        mass, inertia = self.body.shares(share)
        ratio = mass / self.m.body_mass[1]
        self.m.body_mass[1] = mass
        self.m.body_inertia[1] *= ratio
