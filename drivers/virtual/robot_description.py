"""The robot file of a plant: what its user may know, nothing of its true inertials or friction."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

from drivers.virtual.plant_file import JointPlant, PlantSpec

SPRING_HARMONICS = 3  # Verdonck 2001, equation 15


def robot_attachments(plant: PlantSpec) -> dict[str, bytes]:
    """`robot.toml` and its URDF without inertials, as a log carries them."""
    urdf_name = f"{plant.name}.urdf"
    return {
        "robot.toml": robot_toml(plant, urdf_name).encode(),
        urdf_name: _without_inertials(plant.urdf_text).encode(),
    }


def robot_toml(plant: PlantSpec, urdf_name: str) -> str:
    """The text of a `robot.toml` with the plant's drives, springs and plate."""
    lines = [
        f'name = "{plant.name}"',
        f'urdf = "{urdf_name}"',
        f"gravity = {list(plant.gravity_m_s2)}",
    ]
    if plant.coupling is not None:
        lines.append(f"coupling = {[list(row) for row in plant.coupling]}")
    if plant.plate is not None:
        lines += [
            "",
            "[force_plate]",
            f"xyz = {list(plant.plate.xyz_m)}",
            f"rpy = {list(plant.plate.rpy_rad)}",
            "tared = true",
        ]
    for joint in plant.joints:
        lines += ["", "[[joint]]", *_joint_lines(joint)]
    return "\n".join(lines) + "\n"


def _joint_lines(joint: JointPlant) -> list[str]:
    lines = [
        f'name = "{joint.name}"',
        f"gear_ratio = {joint.gear_ratio!r}",
        f"torque_constant = {joint.torque_constant_nm_a!r}",
    ]
    if joint.rotor_inertia_kg_m2 > 0.0:
        lines.append(f"rotor_inertia = {joint.rotor_inertia_kg_m2!r}")
    if joint.rotor_link is not None:
        lines.append(f'rotor_link = "{joint.rotor_link}"')
    if joint.rotor_axis is not None:
        lines.append(f"rotor_axis = {list(joint.rotor_axis)}")
    lines += ['friction = ["coulomb", "viscous"]', "offset = true"]
    if joint.spring is not None:
        lines.append(f"gravity_compensation = {{ harmonics = {SPRING_HARMONICS} }}")
    return lines


def _without_inertials(urdf_text: str) -> str:
    robot = ElementTree.fromstring(urdf_text)
    for link in robot.findall("link"):
        for inertial in link.findall("inertial"):
            link.remove(inertial)
    return ElementTree.tostring(robot, encoding="unicode")
