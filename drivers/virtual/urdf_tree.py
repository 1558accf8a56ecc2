"""The kinematic tree in a URDF, as far as dynamics needs it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np

from drivers.virtual.errors import PlantError
from drivers.virtual.plant_file import ZERO3, LinkInertial, Vector3

MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class TreeJoint:
    """One joint of the tree: where it sits on its parent, how it moves."""

    name: str
    kind: str
    parent: str
    child: str
    xyz_m: Vector3
    rotation: np.ndarray
    """(3, 3) from the child's frame to the parent's."""
    axis: np.ndarray
    """(3,) unit vector in the child's frame."""
    lower: float
    upper: float
    velocity: float
    effort: float
    """0 where the URDF gives no limit."""


@dataclass(frozen=True)
class Tree:
    """All links and joints, root first."""

    root: str
    joints: tuple[TreeJoint, ...]
    inertials: dict[str, LinkInertial]

    def joint(self, name: str) -> TreeJoint:
        """Return the joint of that name."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        known = ", ".join(joint.name for joint in self.joints)
        raise PlantError(f"The URDF has no joint {name}; it has {known}.")

    def zero_pose(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Position (3,) and rotation (3, 3) of every link in the root's frame with all joints at zero."""
        poses = {self.root: (np.zeros(3), np.eye(3))}
        for joint in self.joints:
            position, rotation = poses[joint.parent]
            poses[joint.child] = (position + rotation @ np.array(joint.xyz_m), rotation @ joint.rotation)
        return poses


def rotation_from_rpy(rpy_rad: Vector3) -> np.ndarray:
    """Rotation matrix of fixed-axis roll, pitch, yaw (URDF's convention)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy_rad), np.sin(rpy_rad)
    roll = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    pitch = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    yaw = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(yaw @ pitch @ roll, dtype=float)


def read_tree(urdf_text: str) -> Tree:
    """Read links, joints and inertials of a URDF.

    Raises:
        PlantError: The text is no URDF, or its joints do not form one tree.
    """
    try:
        robot = ElementTree.fromstring(urdf_text)
        joints = [_joint(element) for element in robot.findall("joint")]
        inertials = {link.get("name", ""): _inertial(link) for link in robot.findall("link")}
    except (ElementTree.ParseError, KeyError, ValueError, AttributeError) as error:
        raise PlantError(f"The URDF cannot be read ({error}): check its links, joints and origins.") from None
    roots = set(inertials) - {joint.child for joint in joints}
    if len(roots) != 1:
        raise PlantError(f"The URDF must have one root link, it has {len(roots)}: {sorted(roots)}.")
    root = roots.pop()
    return Tree(root, _root_first(root, joints), {k: v for k, v in inertials.items() if v is not None})


def _root_first(root: str, joints: list[TreeJoint]) -> tuple[TreeJoint, ...]:
    ordered: list[TreeJoint] = []
    reached, left = {root}, list(joints)
    while left:
        ready = [joint for joint in left if joint.parent in reached]
        if not ready:
            raise PlantError(f"The URDF joint {left[0].name} hangs on no link of the tree.")
        ordered += ready
        reached |= {joint.child for joint in ready}
        left = [joint for joint in left if joint not in ready]
    return tuple(ordered)


def _numbers(text: str | None, default: str) -> Vector3:
    x, y, z = (float(word) for word in (text or default).split())
    return (x, y, z)


def _origin(element: ElementTree.Element) -> tuple[Vector3, Vector3]:
    origin = element.find("origin")
    if origin is None:
        return ZERO3, ZERO3
    return _numbers(origin.get("xyz"), "0 0 0"), _numbers(origin.get("rpy"), "0 0 0")


def _joint(element: ElementTree.Element) -> TreeJoint:
    xyz_m, rpy_rad = _origin(element)
    axis_element, limit = element.find("axis"), element.find("limit")
    axis = np.array(_numbers(None if axis_element is None else axis_element.get("xyz"), "1 0 0"))
    bound = {} if limit is None else limit.attrib
    parent, child = element.find("parent"), element.find("child")
    if parent is None or child is None:
        raise ValueError(f"joint {element.get('name')} lacks parent or child")
    return TreeJoint(
        name=element.attrib["name"],
        kind=element.attrib["type"],
        parent=parent.attrib["link"],
        child=child.attrib["link"],
        xyz_m=xyz_m,
        rotation=rotation_from_rpy(rpy_rad),
        axis=axis / np.linalg.norm(axis),
        lower=float(bound.get("lower", -np.pi)),
        upper=float(bound.get("upper", np.pi)),
        velocity=float(bound.get("velocity", 1.0)),
        effort=float(bound.get("effort", 0.0)),
    )


def _inertial(link: ElementTree.Element) -> LinkInertial | None:
    element = link.find("inertial")
    if element is None:
        return None
    xyz_m, rpy_rad = _origin(element)
    mass, inertia = element.find("mass"), element.find("inertia")
    if mass is None or inertia is None or float(mass.attrib["value"]) <= 0.0:
        return None
    ixx, iyy, izz, ixy, ixz, iyz = (
        float(inertia.attrib[k]) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    turn = rotation_from_rpy(rpy_rad)
    tensor = turn @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]) @ turn.T
    six = (tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2])
    return LinkInertial(
        name=link.attrib["name"], mass_kg=float(mass.attrib["value"]), com_m=xyz_m, inertia_kg_m2=six
    )
