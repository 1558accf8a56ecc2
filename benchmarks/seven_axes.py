"""A seven-axis arm of plausible size for speed measurements; invented, no maker's data."""

from __future__ import annotations

from drivers.virtual.from_robot import plant_from_urdf
from drivers.virtual.plant_file import JointPlant, PlantSpec

_LENGTHS_M = (0.33, 0.0, 0.32, 0.08, 0.38, 0.09, 0.10)
_MASSES_KG = (8.0, 6.5, 5.0, 4.5, 3.5, 2.5, 1.2)
_TURNS = ("0 0 0", "-1.5708 0 0", "1.5708 0 0", "1.5708 0 0", "-1.5708 0 0", "1.5708 0 0", "1.5708 0 0")


def seven_axes() -> PlantSpec:
    """The plant, on a force plate."""
    parts = ['<robot name="seven"><link name="link_0"><inertial><mass value="20"/>'
             '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>']
    rows = zip(_LENGTHS_M, _MASSES_KG, _TURNS, strict=True)
    for number, (length_m, mass_kg, turn) in enumerate(rows, start=1):
        inertia = 0.02 * mass_kg
        parts.append(
            f'<link name="link_{number}"><inertial>'
            f'<origin xyz="0.01 0.02 0.1"/><mass value="{mass_kg}"/>'
            f'<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia / 2}" ixy="0" ixz="0" iyz="0"/>'
            f'</inertial></link><joint name="joint_{number}" type="revolute">'
            f'<parent link="link_{number - 1}"/><child link="link_{number}"/>'
            f'<origin xyz="0 0 {length_m}" rpy="{turn}"/><axis xyz="0 0 1"/>'
            '<limit lower="-2.6" upper="2.6" velocity="2.0" effort="120"/></joint>'
        )
    joints = tuple(
        JointPlant(
            name=f"joint_{number}", gear_ratio=100.0, torque_constant_nm_a=0.1, rotor_inertia_kg_m2=1e-4,
            rotor_link=f"link_{number - 1}", coulomb_nm=6.0, viscous_nm_s=4.0,
        )
        for number in range(1, 8)
    )
    return plant_from_urdf("seven", "".join(parts) + "</robot>", joints)
