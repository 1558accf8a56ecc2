"""An estimate as MJCF: bodies, joints, losses, reflected rotor inertia, joint springs."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np

from identify.inertia import body_from_parameters
from identify.robot import Joint
from identify.rotations import FloatArray
from service.export_model import ExportModel
from service.export_spring import JointSpring, joint_spring
from service.export_urdf import header, number, numbers

_VISIBLE_M = 1e-3
_THICKNESS = 0.08  # of the drawn capsule over its length


def held_springs(export: ExportModel) -> dict[str, JointSpring]:
    """Fit the joint springs that MJCF can hold; none where drives are coupled (they act on the drive)."""
    robot = export.robot
    result = {}
    for k, (joint, drive) in enumerate(zip(robot.joints, export.drives, strict=True)):
        alone = np.array_equal(robot.drive_matrix[k], np.eye(robot.n)[k])
        spring = joint_spring(drive, joint.limits.lower, joint.limits.upper) if alone else None
        if spring is not None:
            result[joint.name] = spring
    return result


def mjcf_text(export: ExportModel, springs: dict[str, JointSpring], sidecar: str) -> str:
    """Write the MJCF.

    Args:
        export: the numbers.
        springs: joint springs, by joint.
        sidecar: name of the file beside it that holds what MJCF cannot.

    Returns:
        The document.
    """
    robot = export.robot
    root = ElementTree.Element("mujoco", model=robot.name)
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    ElementTree.SubElement(root, "option", gravity=numbers(robot.gravity))
    parent = ElementTree.SubElement(root, "worldbody")
    for k, joint in enumerate(robot.joints):
        parent = _body(parent, export, k, springs.get(joint.name))
    if robot.coupling is not None:
        _coupled_drives(ElementTree.SubElement(root, "tendon"), export)
    _motors(ElementTree.SubElement(root, "actuator"), export)
    ElementTree.indent(root, "  ")
    notes = [f"What MJCF cannot hold is in {sidecar}."]
    if springs:
        notes.append("Joint springs are cubic (stiffness with three numbers): MuJoCo 4 reads them.")
    return header(export, notes) + ElementTree.tostring(root, encoding="unicode") + "\n"


def _body(
    parent: ElementTree.Element, export: ExportModel, k: int, spring: JointSpring | None
) -> ElementTree.Element:
    joint = export.robot.joints[k]
    body = ElementTree.SubElement(
        parent,
        "body",
        name=joint.link,
        pos=numbers(joint.translation_m),
        quat=numbers(_quaternion(joint.rotation)),
    )
    mass, com, inertia = body_from_parameters(export.links[k])
    full = [inertia[row, column] for row, column in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    ElementTree.SubElement(body, "inertial", pos=numbers(com), mass=number(mass), fullinertia=numbers(full))
    ElementTree.SubElement(body, "joint", _joint(export, k, spring))
    if k + 1 < export.robot.n:
        _draw(body, export.robot.joints[k + 1].translation_m)
    return body


def _joint(export: ExportModel, k: int, spring: JointSpring | None) -> dict[str, str]:
    joint, drive = export.robot.joints[k], export.drives[k]
    result = {
        "name": joint.name,
        "type": "slide" if joint.prismatic else "hinge",
        "axis": numbers(joint.axis),
    }
    if np.isfinite(joint.limits.lower) and np.isfinite(joint.limits.upper):
        result["range"] = numbers((joint.limits.lower, joint.limits.upper))
    if export.robot.coupling is None:
        result |= {
            "damping": number(drive.viscous),
            "frictionloss": number(drive.coulomb),
            "armature": number(armature(joint, drive.rotor_inertia)),
        }
    if spring is not None:
        result |= {"stiffness": numbers(spring.stiffness), "springref": number(spring.rest_rad)}
    return result


def armature(joint: Joint, rotor_inertia: float) -> float:
    """Give the rotor inertia as the joint feels it, n^2 Im [kg.m2]."""
    return joint.drive.gear_ratio**2 * rotor_inertia


def _draw(body: ElementTree.Element, to: FloatArray) -> None:
    """Draw a link as a capsule that neither weighs nor collides."""
    length = float(np.linalg.norm(to))
    if length > _VISIBLE_M:
        drawn = {"type": "capsule", "size": number(_THICKNESS * length), "fromto": f"0 0 0 {numbers(to)}"}
        ElementTree.SubElement(
            body, "geom", drawn | {"mass": "0", "contype": "0", "conaffinity": "0", "group": "1"}
        )


def _coupled_drives(tendons: ElementTree.Element, export: ExportModel) -> None:
    """A drive that turns a combination of joints is a fixed tendon with that drive's losses and rotor."""
    robot = export.robot
    for k, (joint, drive) in enumerate(zip(robot.joints, export.drives, strict=True)):
        losses = {"damping": number(drive.viscous), "frictionloss": number(drive.coulomb)}
        inertia = {"armature": number(armature(joint, drive.rotor_inertia))}
        fixed = ElementTree.SubElement(tendons, "fixed", {"name": f"{joint.name}_drive"} | losses | inertia)
        for moved, share in zip(robot.joints, robot.drive_matrix[k], strict=True):
            if share != 0.0:
                ElementTree.SubElement(fixed, "joint", joint=moved.name, coef=number(share))


def _motors(actuators: ElementTree.Element, export: ExportModel) -> None:
    """One motor a drive, its control is the torque at the joint side of the gear."""
    coupled = export.robot.coupling is not None
    for joint in export.robot.joints:
        acts_on = {"tendon": f"{joint.name}_drive"} if coupled else {"joint": joint.name}
        limit = joint.limits.effort
        bounds = {"ctrlrange": numbers((-limit, limit))} if np.isfinite(limit) and limit > 0 else {}
        ElementTree.SubElement(actuators, "motor", {"name": joint.name, **acts_on, **bounds})


def _quaternion(rotation: FloatArray) -> FloatArray:
    """Give the unit quaternion (w, x, y, z) of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_quat()[[3, 0, 1, 2]]
