"""A URDF text becomes a serial chain with its reference inertials."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from identify.errors import ModelError
from identify.inertia import parameters_from_body, transform_parameters
from identify.robot import Joint, Limits
from identify.rotations import FloatArray, rotation_from_rpy

_SLIDING, _TURNING = ("prismatic",), ("revolute", "continuous")


@dataclass(frozen=True)
class Chain:
    """What a URDF says of the moving chain.

    Attributes:
        name: the URDF robot's name.
        base: link that does not move.
        joints: moving joints from base to tip, without drives.
        parameters: link parameters about the joint frames, merged over fixed joints, shape (n, 10);
            nan where a link has no inertial element.
        link_of: for every link of the URDF, index of the moving link it is merged into, -1 for the base.
        pose_of: for every link, its rotation (3, 3) and translation (3,) in the frame it is merged into.
    """

    name: str
    base: str
    joints: tuple[Joint, ...]
    parameters: FloatArray
    link_of: dict[str, int]
    pose_of: dict[str, tuple[FloatArray, FloatArray]]


@dataclass
class _Node:
    """One URDF joint, as read."""

    name: str
    kind: str
    parent: str
    child: str
    rotation: FloatArray
    translation: FloatArray
    axis: FloatArray
    limits: Limits = field(default_factory=Limits)


def _numbers(text: str | None, count: int, where: str, default: tuple[float, ...]) -> FloatArray:
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise ModelError(f"URDF: {where} is '{text}', but {count} finite numbers are needed there.")
    return values


def _origin(element: ElementTree.Element | None, where: str) -> tuple[FloatArray, FloatArray]:
    if element is None:
        return np.eye(3), np.zeros(3)
    xyz = _numbers(element.get("xyz"), 3, f"origin xyz of {where}", (0.0, 0.0, 0.0))
    rpy = _numbers(element.get("rpy"), 3, f"origin rpy of {where}", (0.0, 0.0, 0.0))
    return rotation_from_rpy(rpy), xyz


def _limits(element: ElementTree.Element | None, kind: str, where: str) -> Limits:
    if element is None:
        return Limits()
    read = {
        key: float(_numbers(element.get(key), 1, f"limit {key} of {where}", (default,))[0])
        for key, default in (("lower", -np.inf), ("upper", np.inf), ("velocity", np.inf), ("effort", np.inf))
    }
    if kind == "continuous":
        read["lower"], read["upper"] = -np.inf, np.inf
    if read["lower"] > read["upper"]:
        raise ModelError(f"URDF: {where} has lower limit {read['lower']} above upper limit {read['upper']}.")
    return Limits(**read)


def _unit_axis(element: ElementTree.Element | None, where: str) -> FloatArray:
    axis = _numbers(None if element is None else element.get("xyz"), 3, f"axis of {where}", (1.0, 0.0, 0.0))
    norm = np.linalg.norm(axis)
    if norm < 1e-9:
        raise ModelError(f"URDF: the axis of {where} has length zero; give a direction such as '0 0 1'.")
    return axis / norm


def _attribute(element: ElementTree.Element | None, key: str, where: str) -> str:
    value = None if element is None else element.get(key)
    if not value:
        raise ModelError(f"URDF: {where} lacks its '{key}'.")
    return value


def _read_joint(element: ElementTree.Element) -> _Node:
    name = _attribute(element, "name", "a joint")
    kind, where = _attribute(element, "type", f"joint '{name}'"), f"joint '{name}'"
    if kind not in (*_SLIDING, *_TURNING, "fixed"):
        raise ModelError(
            f"URDF: {where} is of type '{kind}', which is not supported; "
            "revolute, continuous, prismatic and fixed joints are."
        )
    if element.find("mimic") is not None:
        raise ModelError(f"URDF: {where} mimics another joint, which is not supported; make it fixed.")
    rotation, translation = _origin(element.find("origin"), where)
    return _Node(
        name,
        kind,
        _attribute(element.find("parent"), "link", f"the parent of {where}"),
        _attribute(element.find("child"), "link", f"the child of {where}"),
        rotation,
        translation,
        _unit_axis(element.find("axis"), where) if kind != "fixed" else np.array([0.0, 0.0, 1.0]),
        _limits(element.find("limit"), kind, where),
    )


def _read_inertial(link: ElementTree.Element) -> FloatArray | None:
    inertial = link.find("inertial")
    if inertial is None:
        return None
    where = f"link '{link.get('name')}'"
    rotation, com = _origin(inertial.find("origin"), f"the inertial of {where}")
    mass = float(_attribute(inertial.find("mass"), "value", f"the mass of {where}"))
    element = inertial.find("inertia")
    i = {
        key: float(_attribute(element, key, f"the inertia of {where}"))
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    }
    inertia = np.array(
        [[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]]
    )
    return parameters_from_body(mass, com, inertia, rotation)


def _parse(text: str) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ModelError(f"The URDF is not well-formed XML: {error}.") from error
    if root.tag != "robot":
        raise ModelError(f"The URDF's outermost element is <{root.tag}>, but <robot> is needed.")
    return root


def _base_link(links: Iterable[str], nodes: list[_Node]) -> str:
    children = {node.child for node in nodes}
    bases = [link for link in links if link not in children]
    if len(bases) != 1:
        raise ModelError(
            f"The URDF must have exactly one link without a parent, but has {len(bases)}: {', '.join(bases) or 'none'}."
        )
    return bases[0]


def read_urdf(text: str, moving: Iterable[str] | None = None) -> Chain:
    """Read a serial chain; links behind fixed joints are merged into the link that carries them.

    Args:
        text: the URDF document.
        moving: names of the joints that move; None takes every joint that is not fixed.

    Returns:
        The chain from base to tip.

    Raises:
        ModelError: malformed or unsupported content, a branch of moving joints, an unnamed joint.
    """
    root = _parse(text)
    links = {_attribute(link, "name", "a link"): _read_inertial(link) for link in root.findall("link")}
    nodes = [_read_joint(joint) for joint in root.findall("joint")]
    for node in nodes:
        for link in (node.parent, node.child):
            if link not in links:
                raise ModelError(f"URDF: joint '{node.name}' names link '{link}', which does not exist.")
    _check_moving(nodes, moving)
    return _walk(root.get("name", "robot"), links, nodes, _base_link(links, nodes))


def _check_moving(nodes: list[_Node], moving: Iterable[str] | None) -> None:
    if moving is None:
        return
    present, wanted = {node.name for node in nodes if node.kind != "fixed"}, list(moving)
    missing = [name for name in wanted if name not in present]
    if missing:
        raise ModelError(
            f"Joint '{missing[0]}' of the robot file is not a moving joint of the URDF, which has: "
            f"{', '.join(sorted(present))}."
        )
    extra = sorted(present - set(wanted))
    if extra:
        raise ModelError(
            f"The URDF's moving joint '{extra[0]}' has no [[joint]] entry in the robot file; "
            "add one, or make the joint fixed in the URDF."
        )


def _walk(name: str, links: dict[str, FloatArray | None], nodes: list[_Node], base: str) -> Chain:
    """Go from the base to the tip, merging what is fixed."""
    joints: list[Joint] = []
    sums: list[FloatArray | None] = []
    link_of, pose_of = {base: -1}, {base: (np.eye(3), np.zeros(3))}
    current = base
    while current is not None:
        index = link_of[current]
        group = _fixed_group(current, nodes, pose_of, link_of)
        if index >= 0:
            sums.append(_merged(group, links, pose_of))
        current = _next_joint(group, nodes, pose_of, link_of, joints)
    parameters = np.array([np.full(10, np.nan) if s is None else s for s in sums]).reshape(len(joints), 10)
    return Chain(name, base, tuple(joints), parameters, link_of, pose_of)


def _fixed_group(start: str, nodes: list[_Node], pose_of: dict, link_of: dict) -> list[str]:
    """List the links rigidly fixed to ``start`` and note their poses in its frame."""
    group, queue = [start], [start]
    while queue:
        parent = queue.pop()
        rotation, translation = pose_of[parent]
        for node in nodes:
            if node.parent == parent and node.kind == "fixed":
                pose_of[node.child] = (rotation @ node.rotation, translation + rotation @ node.translation)
                link_of[node.child] = link_of[start]
                group.append(node.child)
                queue.append(node.child)
    return group


def _merged(group: list[str], links: dict[str, FloatArray | None], pose_of: dict) -> FloatArray | None:
    known = [(link, links[link]) for link in group if links[link] is not None]
    if not known:
        return None
    return np.sum([transform_parameters(parameters, *pose_of[link]) for link, parameters in known], axis=0)


def _next_joint(
    group: list[str], nodes: list[_Node], pose_of: dict, link_of: dict, joints: list[Joint]
) -> str | None:
    moving = [node for node in nodes if node.parent in group and node.kind != "fixed"]
    if len(moving) > 1:
        raise ModelError(
            f"URDF: the chain branches at link '{moving[0].parent}' into joints "
            f"{', '.join(repr(node.name) for node in moving)}; only serial chains are supported."
        )
    if not moving:
        return None
    node = moving[0]
    rotation, translation = pose_of[node.parent]
    joints.append(
        Joint(
            node.name,
            node.child,
            node.kind in _SLIDING,
            rotation @ node.rotation,
            translation + rotation @ node.translation,
            node.axis,
            node.limits,
        )
    )
    link_of[node.child], pose_of[node.child] = len(joints) - 1, (np.eye(3), np.zeros(3))
    return node.child
