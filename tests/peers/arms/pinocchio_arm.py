"""Reference poses and torques of arms by Pinocchio, for the tests of crates/arm-dynamics.

    python pinocchio_arm.py make OUT       draws an arm with odd axes, a sliding joint, fixed links and a finger, writes arm.urdf and reference.csv
    python pinocchio_arm.py example OUT    writes a log of that arm with friction in joint1 and joint3: tests/data/joint-log
    python pinocchio_arm.py compare ROBOT  compares `robot check --json` (path of the program) with Pinocchio on the URDF files of example-robot-data and pybullet_data
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin

GRAVITY = np.array([0.0, 0.0, -9.81])


def numbers(values) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def drawn_urdf(rng: np.random.Generator) -> str:
    """Eight joints of which the third slides, a flange fixed to the last link, and a finger that is locked."""
    text = ['<robot name="drawn">', '  <link name="base"/>']

    def link(name: str) -> str:
        # From the second moments of a cloud of mass: then it is that of a body.
        root = rng.normal(size=(3, 3)) * 0.1
        spread = root @ root.T + 0.005 * np.eye(3)
        moment = np.trace(spread) * np.eye(3) - spread
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        inertia = " ".join(f'{key}="{moment["xyz".index(key[1]), "xyz".index(key[2])]:.9g}"' for key in keys)
        return (f'  <link name="{name}"><inertial><origin xyz="{numbers(rng.uniform(-0.2, 0.2, 3))}" rpy="{numbers(rng.uniform(-2, 2, 3))}"/>'
                f'<mass value="{rng.uniform(0.2, 3.0):.9g}"/><inertia {inertia}/></inertial></link>')

    def joint(name: str, kind: str, parent: str, child: str) -> str:
        axis = "" if kind == "fixed" else f'<axis xyz="{numbers(rng.normal(size=3))}"/>'
        limit = "" if kind in ("fixed", "continuous") else '<limit lower="-2.5" upper="2.5" effort="100" velocity="3"/>'
        return (f'  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
                f'<origin xyz="{numbers(rng.uniform(-0.4, 0.4, 3))}" rpy="{numbers(rng.uniform(-3, 3, 3))}"/>{axis}{limit}</joint>')

    parent = "base"
    for i in range(8):
        kind = "prismatic" if i == 2 else "continuous" if i == 5 else "revolute"
        text += [link(f"link{i}"), joint(f"joint{i}", kind, parent, f"link{i}")]
        parent = f"link{i}"
    text += [link("flange"), joint("mount", "fixed", "link7", "flange"), link("finger"), joint("grip", "prismatic", "flange", "finger")]
    return "\n".join(text + ["</robot>"]) + "\n"


def make(out: Path) -> None:
    rng = np.random.default_rng(20260911)
    (out / "arm.urdf").write_text(drawn_urdf(rng))
    whole = pin.buildModelFromUrdf(str(out / "arm.urdf"))
    model = pin.buildReducedModel(whole, [whole.getJointId("grip")], pin.neutral(whole))
    model.gravity.linear = GRAVITY
    data = model.createData()
    tip = model.getFrameId("flange")
    lines = [",".join(f"{name}{i}" for name in ("q", "v", "a", "tau") for i in range(8)) + ",x,y,z,qx,qy,qz,qw"]
    for _ in range(20):
        angles, rate, acceleration = rng.uniform(-2.5, 2.5, 8), rng.normal(size=8), rng.normal(size=8) * 3
        # A continuous joint is a cosine and a sine to Pinocchio.
        q = np.concatenate([angles[:5], [np.cos(angles[5]), np.sin(angles[5])], angles[6:]])
        torque = pin.rnea(model, data, q, rate, acceleration)
        pin.framesForwardKinematics(model, data, q)
        pose = data.oMf[tip]
        turn = pin.Quaternion(pose.rotation).coeffs()
        lines.append(",".join(f"{value:.15g}" for value in np.concatenate([angles, rate, acceleration, torque, pose.translation, turn])))
    (out / "reference.csv").write_text("\n".join(lines) + "\n")


def example(out: Path) -> None:
    """16 s at 100 Hz; Coulomb friction of 0.8 and 0.5 N m, viscous of 0.5 and 0.3 N m s/rad; noise of 2e-5 rad and 0.05 N m."""
    out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(5)
    (out / "arm.urdf").write_text(drawn_urdf(np.random.default_rng(20260911)))
    whole = pin.buildModelFromUrdf(str(out / "arm.urdf"))
    model = pin.buildReducedModel(whole, [whole.getJointId("grip")], pin.neutral(whole))
    model.gravity.linear = GRAVITY
    data = model.createData()
    names = ", ".join(f'"joint{i}"' for i in range(8))
    (out / "log.toml").write_text(
        f'version = 1\nrobot = "arm.urdf"\njoints = [{names}]\ntip_link = "flange"\nperiod_secs = 0.01\n')
    coulomb, viscous = np.zeros(8), np.zeros(8)
    coulomb[[1, 3]], viscous[[1, 3]] = (0.8, 0.5), (0.5, 0.3)
    units = [("m", "force", "n") if i == 2 else ("rad", "torque", "nm") for i in range(8)]
    lines = ["time_secs," + ",".join(f"joint_{i}_{u[0]},joint_{u[1]}_{i}_{u[2]}" for i, u in enumerate(units))]
    size = np.where(np.arange(8) == 2, 0.06, 0.35)
    for row in range(1600):
        time = row / 100.0
        angle, rate, acceleration = np.zeros(8), np.zeros(8), np.zeros(8)
        for k in (1, 2, 3):
            omega = 2 * np.pi * (0.1 + 0.017 * np.arange(8)) * k
            phase = omega * time + 1.3 * np.arange(8) + 0.7 * k
            angle += size / k * np.sin(phase)
            rate += size / k * omega * np.cos(phase)
            acceleration -= size / k * omega**2 * np.sin(phase)
        q = np.concatenate([angle[:5], [np.cos(angle[5]), np.sin(angle[5])], angle[6:]])
        torque = pin.rnea(model, data, q, rate, acceleration) + coulomb * np.sign(rate) + viscous * rate
        angle, torque = angle + 2e-5 * rng.normal(size=8), torque + 0.05 * rng.normal(size=8)
        lines.append(f"{time:.2f}," + ",".join(f"{a:.5f},{t:.3f}" for a, t in zip(angle, torque)))
    (out / "samples.csv").write_text("\n".join(lines) + "\n")


def compare(program: str) -> None:
    import pybullet_data

    packages = Path(pybullet_data.getDataPath()).parent
    roots = [packages / "cmeel.prefix/share/example-robot-data/robots", Path(pybullet_data.getDataPath())]
    files = sorted(file for root in roots for file in root.rglob("*.urdf"))
    worst, read = {}, 0
    for file in files:
        ran = subprocess.run([program, "check", str(file), "--json"], capture_output=True, text=True)
        if ran.returncode:
            assert ran.returncode == 2 and ran.stderr.count("\n") == 1, (file, ran.stderr)
            continue
        found = json.loads(ran.stdout)
        try:
            whole = pin.buildModelFromUrdf(str(file))
        except Exception as error:  # Pinocchio refuses some that lack what only it needs.
            print(file.name, "not read by Pinocchio:", str(error)[:80])
            continue
        names = [joint["name"] for joint in found["joints"]]
        q = pin.neutral(whole)
        for i in range(1, whole.njoints):
            joint, name = whole.joints[i], whole.names[i]
            value = next((j["position"] for j in found["joints"] if j["name"] == name), None)
            if value is None:
                low, high = whole.lowerPositionLimit[joint.idx_q], whole.upperPositionLimit[joint.idx_q]
                value = float(np.clip(0.0, low, high)) if joint.nq == 1 and low < high else 0.0
            if joint.nq == 2:
                q[joint.idx_q], q[joint.idx_q + 1] = np.cos(value), np.sin(value)
            elif joint.nq == 1:
                q[joint.idx_q] = value
        whole.gravity.linear = GRAVITY
        data = whole.createData()
        torque = pin.computeGeneralizedGravity(whole, data, q)
        pin.framesForwardKinematics(whole, data, q)
        place = data.oMf[whole.getFrameId(found["tip_link"])].translation
        errors = [abs(torque[whole.joints[whole.getJointId(n)].idx_v] - j["holds_nm"]) for n, j in zip(names, found["joints"])]
        worst[file.name] = (max(errors), float(np.abs(place - found["tip_position_m"]).max()))
        read += 1
    for name, (torque, place) in worst.items():
        print(f"{name:45s} gravity {torque:.1e} N m, tip {place:.1e} m")
    print(f"{read} of {len(files)} files compared; worst {max(t for t, _ in worst.values()):.1e} N m, {max(p for _, p in worst.values()):.1e} m")


if __name__ == "__main__":
    if sys.argv[1] in ("make", "example"):
        {"make": make, "example": example}[sys.argv[1]](Path(sys.argv[2]))
    else:
        compare(sys.argv[2])
