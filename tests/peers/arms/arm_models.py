"""Robot arms: reading, perturbing and writing URDF files, and reduction to a chain of moving bodies.

Units are SI and radians.  The URDF files come from the packages `example-robot-data` and `pybullet_data`.
Visuals, collisions, transmissions and moving fingers are dropped (fingers become fixed links).
"""

from __future__ import annotations

import copy
import os
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field

import numpy as np


@dataclass
class Link:
    """A URDF link: mass [kg], centre of mass [m], inertia about it [kg m^2], both in axes of the link."""

    name: str
    mass: float = 0.0
    com: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass
class Joint:
    """A URDF joint.  `rotation` and `position` place the joint frame in the parent link."""

    name: str
    kind: str
    parent: str
    child: str
    rpy: np.ndarray
    position: np.ndarray
    axis: np.ndarray
    lower: float = 0.0
    upper: float = 0.0
    velocity: float = 0.0
    effort: float = 0.0
    damping: float = 0.0  # viscous friction, N m s/rad
    friction: float = 0.0  # Coulomb friction, N m

    @property
    def rotation(self) -> np.ndarray:
        return rotation_of_rpy(self.rpy)

    @property
    def moves(self) -> bool:
        return self.kind != "fixed"


@dataclass
class Body:
    """A moving body of the chain: its joint frame in the body before it, and its merged mass properties."""

    name: str
    rotation: np.ndarray
    position: np.ndarray
    axis: np.ndarray
    mass: float
    com: np.ndarray
    inertia: np.ndarray


@dataclass
class Arm:
    """An arm: links and joints from base to tip, `payload_scale` relative to an arm that carries 3 kg."""

    name: str
    links: dict[str, Link]
    joints: list[Joint]
    base: str
    tip: str
    payload_scale: float

    @property
    def moving(self) -> list[Joint]:
        return [joint for joint in self.joints if joint.moves]


# name: (package, path, base link, tip link, payload scale, velocity limits [rad/s] where the file's are not usable)
CATALOGUE = {
    "panda": ("robots", "panda_description/urdf/panda.urdf", None, "panda_hand_tcp", 1.0, None),
    "ur5": ("robots", "ur_description/urdf/ur5_robot.urdf", None, "tool0", 1.0, None),
    "ur10": ("robots", "ur_description/urdf/ur10_robot.urdf", None, "tool0", 2.0, None),
    "jaco": ("robots", "kinova_description/robots/kinova.urdf", None, "j2s6s200_end_effector", 0.6, None),
    "xarm7": ("robots", "xarm_description/urdf/xarm7.urdf", None, "link_eef", 1.0, None),
    "z1": ("robots", "z1_description/urdf/z1.urdf", None, "gripperStator", 0.5, None),
    "iiwa": ("pybullet", "kuka_iiwa/model.urdf", None, "lbr_iiwa_link_7", 1.5,
             [1.71, 1.71, 1.75, 2.27, 2.44, 3.14, 3.14]),
    "tiago": ("robots", "tiago_description/robots/tiago_no_hand.urdf", "torso_lift_link", "arm_tool_link", 0.8, None),
}


def rotation_of_rpy(rpy) -> np.ndarray:
    """Rotation matrix of fixed-axis roll, pitch, yaw (the URDF convention)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])


def _vector(text, default=(0.0, 0.0, 0.0)) -> np.ndarray:
    return np.array(default if text is None else [float(x) for x in text.split()], dtype=float)


def _package_folder(package: str) -> str:
    for folder in sys.path:
        path = (os.path.join(folder, "cmeel.prefix/share/example-robot-data/robots") if package == "robots"
                else os.path.join(folder, "pybullet_data"))
        if os.path.isdir(path):
            return path
    raise FileNotFoundError(f"package with {package} URDFs is not installed")


def second_moments(inertia: np.ndarray) -> np.ndarray:
    """Matrix of second moments of mass: positive semidefinite exactly when the inertia is physical."""
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def inertia_of(moments: np.ndarray) -> np.ndarray:
    return np.trace(moments) * np.eye(3) - moments


def _physical(inertia: np.ndarray) -> np.ndarray:
    """The nearest inertia whose second moments are at least 0.5 % of the largest one."""
    values, vectors = np.linalg.eigh(second_moments(inertia))
    values = np.maximum(values, 0.005 * values.max())
    return inertia_of(vectors @ np.diag(values) @ vectors.T)


def file_of(name: str) -> str:
    """The URDF file of an arm of the catalogue, as its package has it."""
    package, path = CATALOGUE[name][:2]
    return os.path.join(_package_folder(package), path)


def load_arm(name: str) -> Arm:
    """Read an arm of the catalogue."""
    _, _, base, tip, payload_scale, velocities = CATALOGUE[name]
    root = ET.parse(file_of(name)).getroot()
    all_joints = {j.find("child").get("link"): j for j in root.findall("joint")}
    # the moving joints: those between base and tip
    on_path, link = set(), tip
    while link in all_joints and link != base:
        on_path.add(all_joints[link].get("name"))
        link = all_joints[link].find("parent").get("link")
    base = link
    joints, kept, queue = [], [base], [base]
    while queue:
        parent = queue.pop(0)
        for child, element in all_joints.items():
            if element.find("parent").get("link") != parent:
                continue
            if parent == base and element.get("name") not in on_path:
                continue  # what else is mounted on the base does not move with the arm
            joint = _read_joint(element)
            if joint.name not in on_path:
                joint.kind = "fixed"
            joints.append(joint)
            kept.append(child)
            queue.append(child)
    elements = {l.get("name"): l for l in root.findall("link")}
    links = {k: _read_link(elements[k]) for k in kept}
    arm = Arm(name, links, joints, base, tip, payload_scale)
    if velocities:
        for joint, velocity in zip(arm.moving, velocities):
            joint.velocity = velocity
    return arm


def _read_joint(element) -> Joint:
    origin, limit, axis = element.find("origin"), element.find("limit"), element.find("axis")
    joint = Joint(element.get("name"), element.get("type"), element.find("parent").get("link"),
                  element.find("child").get("link"),
                  _vector(origin.get("rpy") if origin is not None else None),
                  _vector(origin.get("xyz") if origin is not None else None),
                  _vector(axis.get("xyz") if axis is not None else None, (1.0, 0.0, 0.0)))
    joint.axis /= max(np.linalg.norm(joint.axis), 1e-9)  # some fixed joints have an axis of zero
    if limit is not None:
        joint.lower, joint.upper = float(limit.get("lower", "-3.14159")), float(limit.get("upper", "3.14159"))
        joint.velocity, joint.effort = float(limit.get("velocity", "1")), float(limit.get("effort", "1"))
    return joint


def _read_link(element) -> Link:
    inertial = element.find("inertial")
    link = Link(element.get("name"))
    if inertial is None or float(inertial.find("mass").get("value")) <= 0.0:
        return link
    origin = inertial.find("origin")
    link.mass = float(inertial.find("mass").get("value"))
    link.com = _vector(origin.get("xyz") if origin is not None else None)
    turn = rotation_of_rpy(_vector(origin.get("rpy") if origin is not None else None))
    i = {k: float(inertial.find("inertia").get(k, "0")) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")}
    inertia = np.array([[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]])
    link.inertia = _physical(turn @ inertia @ turn.T)
    return link


def merge(parts: list[tuple[float, np.ndarray, np.ndarray]]) -> tuple[float, np.ndarray, np.ndarray]:
    """Merge (mass, com, inertia about com) given in the same axes."""
    mass = sum(p[0] for p in parts)
    if mass <= 0.0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    com = sum(p[0] * p[1] for p in parts) / mass
    inertia = np.zeros((3, 3))
    for m, c, i in parts:
        d = c - com
        inertia += i + m * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, com, inertia


def chain(arm: Arm) -> tuple[list[Body], np.ndarray, np.ndarray]:
    """Moving bodies in order, and the placement (rotation, position) of the tip link in the last body."""
    place = {arm.base: (-1, np.eye(3), np.zeros(3))}
    bodies: list[Body] = []
    parts: list[list] = []
    for joint in arm.joints:
        index, rotation, position = place[joint.parent]
        rotation, position = rotation @ joint.rotation, position + rotation @ joint.position
        if joint.moves:
            assert index == len(bodies) - 1, f"{arm.name} is not a serial chain"
            bodies.append(Body(joint.child, rotation, position, joint.axis, 0.0, np.zeros(3), np.zeros((3, 3))))
            parts.append([])
            index, rotation, position = len(bodies) - 1, np.eye(3), np.zeros(3)
        place[joint.child] = (index, rotation, position)
        if index >= 0:
            link = arm.links[joint.child]
            parts[index].append((link.mass, position + rotation @ link.com, rotation @ link.inertia @ rotation.T))
    for body, own in zip(bodies, parts):
        body.mass, body.com, body.inertia = merge(own)
    assert place[arm.tip][0] == len(bodies) - 1
    return bodies, place[arm.tip][1], place[arm.tip][2]


def perturbed(arm: Arm, rng: np.random.Generator, share: float = 0.05, place_m: float = 0.005) -> Arm:
    """A nominal model: mass and second moments off by up to `share`, centre of mass by up to `place_m`, still physical."""
    arm = copy.deepcopy(arm)
    for link in arm.links.values():
        draw = rng.uniform(-1.0, 1.0, 7)
        if link.mass <= 0.0:
            continue
        link.mass *= 1.0 + share * draw[0]
        link.com = link.com + place_m * draw[1:4] / np.sqrt(3.0)
        values, vectors = np.linalg.eigh(second_moments(link.inertia))
        link.inertia = inertia_of(vectors @ np.diag(values * (1.0 + share * draw[4:7])) @ vectors.T)
    return arm


def write_urdf(arm: Arm, path: str) -> None:
    """Write links, joints, limits and `<dynamics>`; nothing else."""

    def text(values) -> str:
        return " ".join(f"{v:.12g}" for v in values)

    root = ET.Element("robot", name=arm.name)
    for link in arm.links.values():
        element = ET.SubElement(root, "link", name=link.name)
        if link.mass > 0.0:
            inertial, i = ET.SubElement(element, "inertial"), link.inertia
            ET.SubElement(inertial, "origin", xyz=text(link.com), rpy="0 0 0")
            ET.SubElement(inertial, "mass", value=f"{link.mass:.12g}")
            ET.SubElement(inertial, "inertia", {k: f"{v:.12g}" for k, v in dict(
                ixx=i[0, 0], ixy=i[0, 1], ixz=i[0, 2], iyy=i[1, 1], iyz=i[1, 2], izz=i[2, 2]).items()})
    for joint in arm.joints:
        element = ET.SubElement(root, "joint", name=joint.name, type=joint.kind)
        ET.SubElement(element, "parent", link=joint.parent)
        ET.SubElement(element, "child", link=joint.child)
        ET.SubElement(element, "origin", xyz=text(joint.position), rpy=text(joint.rpy))
        if joint.moves:
            ET.SubElement(element, "axis", xyz=text(joint.axis))
            limit = dict(effort=f"{joint.effort:.12g}", velocity=f"{joint.velocity:.12g}")
            if joint.kind == "revolute":
                limit |= dict(lower=f"{joint.lower:.12g}", upper=f"{joint.upper:.12g}")
            ET.SubElement(element, "limit", limit)
            ET.SubElement(element, "dynamics", damping=f"{joint.damping:.9g}", friction=f"{joint.friction:.9g}")
    ET.indent(root)
    ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
