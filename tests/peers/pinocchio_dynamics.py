"""Records inverse dynamics of both arms, computed by Pinocchio from the project's own URDFs.

    python tests/peers/pinocchio_dynamics.py

Writes crates/physics-model/tests/data/{sawyer,jaco}_dynamics.csv: joint positions (rad), rates (rad/s), accelerations (rad/s^2) and the torques
(N m) of M(q) a + C(q, v) v + g(q), joints in the order of the scenario file, gravity (0, 0, -9.81) m/s^2, no rotor inertia.
"""

import pathlib
import tomllib

import numpy as np
import pinocchio

ROOT = pathlib.Path(__file__).resolve().parents[2]


def record(name: str, rows: int = 25) -> None:
    robot = tomllib.loads((ROOT / f"scenarios/robots/{name}.toml").read_text())["robot"]
    model = pinocchio.buildModelFromUrdf(str(ROOT / robot["urdf"]))
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    data = model.createData()
    rng = np.random.default_rng(7)
    # Locked joints stay at their value, at rest; their mass counts.
    rest = pinocchio.neutral(model)
    for joint, value in robot["locked_joints"].items():
        rest[model.joints[model.getJointId(joint)].idx_q] = value
    joints = [model.joints[model.getJointId(name)] for name in robot["actuated_joints"]]
    rates = [joint.idx_v for joint in joints]
    lines = [
        f"# Pinocchio {pinocchio.__version__}, rnea, {robot['urdf']}; see tests/peers/pinocchio_dynamics.py",
        ",".join(f"{kind}{j}" for kind in ("q", "v", "a", "t") for j in range(len(joints))),
    ]
    for _ in range(rows):
        angles = rng.uniform(-np.pi, np.pi, len(joints))
        q, v, a = rest.copy(), np.zeros(model.nv), np.zeros(model.nv)
        for joint, angle in zip(joints, angles):
            if joint.nq == 2:  # A continuous joint is a point on the unit circle.
                q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
            else:
                q[joint.idx_q] = angle
        v[rates] = rng.uniform(-2.0, 2.0, len(joints))
        a[rates] = rng.uniform(-5.0, 5.0, len(joints))
        torque = pinocchio.rnea(model, data, q, v, a)[rates]
        lines.append(",".join(repr(float(value)) for row in (angles, v[rates], a[rates], torque) for value in row))
    (ROOT / f"crates/physics-model/tests/data/{name}_dynamics.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    for arm in ("sawyer", "jaco"):
        record(arm)
