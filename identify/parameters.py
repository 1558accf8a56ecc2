"""Parameters of a model: names, groups, units, definitions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from identify.inertia import PARAMETERS, UNITS
from identify.robot import WRENCH_CHANNELS, Robot

GROUPS = ("inertial", "rotor", "friction", "offset", "gravity_compensation", "plate")


@dataclass(frozen=True)
class Parameter:
    """One unknown of a model.

    Attributes:
        name: as in the estimate file.
        group: one of :data:`GROUPS`.
        unit: SI.
        definition: coefficients over raw parameters (``link_2.mx``, ``joint_2.rotor_inertia``, ...).
        joint: name of the joint it belongs to, None for inertial and plate parameters.
    """

    name: str
    group: str
    unit: str
    definition: Mapping[str, float] = field(default_factory=dict)
    joint: str | None = None


def raw_rigid_parameters(robot: Robot) -> list[tuple[str, str]]:
    """List names and units of all link parameters, then of the rotor inertias that are unknown."""
    names = [
        (f"{link}.{parameter}", unit)
        for link in robot.link_names
        for parameter, unit in zip(PARAMETERS, UNITS, strict=True)
    ]
    return names + [(f"{robot.joints[k].name}.rotor_inertia", "kg.m2") for k in unknown_rotors(robot)]


def unknown_rotors(robot: Robot) -> list[int]:
    """Indices of the drives whose rotor inertia is to be estimated."""
    return [k for k, joint in enumerate(robot.joints) if joint.drive.has_rotor and joint.drive.rotor_inertia is None]


def internal_parameters(robot: Robot) -> list[Parameter]:
    """List the parameters of friction, offsets and gravity compensation (d_fg), joint by joint."""
    result: list[Parameter] = []
    for joint in robot.joints:
        drive, torque = joint.drive, joint.torque_unit
        per_speed = f"{torque}.s/m" if joint.prismatic else f"{torque}.s/rad"
        for term in drive.friction:
            unit = torque if term.endswith("coulomb") else per_speed
            result.append(Parameter(f"{joint.name}.{term}", "friction", unit, {}, joint.name))
        if drive.offset:
            result.append(Parameter(f"{joint.name}.offset", "offset", torque, {}, joint.name))
        for harmonic in range(1, drive.gravity_harmonics + 1):
            for wave in ("cos", "sin"):
                name = f"{joint.name}.gravity_{wave}_{harmonic}"
                result.append(Parameter(name, "gravity_compensation", torque, {}, joint.name))
    return result


def plate_parameters(robot: Robot) -> list[Parameter]:
    """List the offsets of a tared plate, none where there is no plate or it is calibrated."""
    if robot.plate is None or not robot.plate.tared:
        return []
    units = ["N"] * 3 + ["N.m"] * 3
    return [
        Parameter(f"plate.{channel}.offset", "plate", unit)
        for channel, unit in zip(WRENCH_CHANNELS, units, strict=True)
    ]
