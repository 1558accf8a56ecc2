"""What an estimate says of every link and drive, with the freedom it leaves filled and named."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identify.consistency import Consistency
from identify.inertia import PARAMETERS
from identify.parameters import unknown_rotors
from identify.robot import Robot
from service.errors import EstimateError
from service.estimate_reading import Estimate, FloatArray


@dataclass(frozen=True)
class DriveTerms:
    """What acts inside one joint, without the links' gravity that its parameters had absorbed.

    Attributes:
        joint: its name.
        coulomb: [N.m or N].
        viscous: [N.m.s/rad or N.s/m].
        asymmetric_viscous: likewise, times the absolute speed.
        offset: constant torque [N.m or N].
        cosine: gravity compensation, cos(l q), l = 1, 2, ... [N.m], shape (h,).
        sine: likewise sin(l q), shape (h,).
        rotor_inertia: motor side [kg.m2], 0 where the rotor counts as part of the link.
    """

    joint: str
    coulomb: float
    viscous: float
    asymmetric_viscous: float
    offset: float
    cosine: FloatArray
    sine: FloatArray
    rotor_inertia: float

    def compensation_nm(self, q: FloatArray) -> FloatArray:
        """Torque [N.m] the drive gives against the gravity compensation at positions q (N,)."""
        orders = np.arange(1, len(self.cosine) + 1)[:, None] * q
        return self.cosine @ np.cos(orders) + self.sine @ np.sin(orders)


@dataclass(frozen=True)
class ExportModel:
    """A full set of numbers for a simulator.

    Attributes:
        estimate: where they come from.
        robot: the chain, all rotor inertias filled in.
        theta: (projected) parameters, without gaps, shape (P,).
        links: ten parameters a link, shape (n, 10).
        drives: one a joint.
        projected: whether the parameters were moved to be physically possible.
        notes: what a reader of the files must know.
    """

    estimate: Estimate
    robot: Robot
    theta: FloatArray
    links: FloatArray
    drives: tuple[DriveTerms, ...]
    projected: bool
    notes: tuple[str, ...]


def export_model(estimate: Estimate, found: Consistency) -> ExportModel:
    """Split an estimate into links and drives.

    Args:
        estimate: the estimate.
        found: its physical consistency, with a full set of bodies.

    Returns:
        The numbers for a simulator.
    """
    raw = np.concatenate([found.links.ravel(), found.rotors])
    theta, own, absent = _without_gaps(estimate, found.projected, raw)
    robot = estimate.loaded.robot
    rotors = _rotor_inertias(robot, found.rotors)
    joints = tuple(
        replace(joint, drive=replace(joint.drive, rotor_inertia=rotors[k]))
        if joint.drive.has_rotor
        else joint
        for k, joint in enumerate(robot.joints)
    )
    return ExportModel(
        estimate,
        replace(robot, joints=joints),
        theta,
        found.links,
        tuple(
            _drive_terms(joint.name, joint.drive.gravity_harmonics, own, rotors[k])
            for k, joint in enumerate(joints)
        ),
        not found.consistent,
        _notes(estimate, found, absent),
    )


def _rotor_inertias(robot: Robot, unknown: FloatArray) -> list[float]:
    result = [joint.drive.rotor_inertia or 0.0 if joint.drive.has_rotor else 0.0 for joint in robot.joints]
    for index, value in zip(unknown_rotors(robot), unknown, strict=True):
        result[index] = float(value)
    return result


def _without_gaps(
    estimate: Estimate, projected: FloatArray, raw: FloatArray
) -> tuple[FloatArray, dict[str, float], list[str]]:
    """Parameters without gaps; what is the drives' own in them; names of drive parameters without a value."""
    model = estimate.model
    names = [f"{link}.{p}" for link in model.robot.link_names for p in PARAMETERS]
    names += [f"{model.robot.joints[k].name}.rotor_inertia" for k in unknown_rotors(model.robot)]
    values = dict(zip(names, raw, strict=True))
    theta, own, absent = projected.copy(), {}, []
    for k, parameter in enumerate(model.parameters):
        absorbed = sum(share * values[name] for name, share in parameter.definition.items() if name in values)
        if parameter.name not in parameter.definition or parameter.name in values:
            theta[k] = absorbed if np.isnan(theta[k]) else theta[k]
            continue
        if np.isnan(theta[k]):
            theta[k] = absorbed
            absent.append(parameter.name)
        own[parameter.name] = float(theta[k] - absorbed)
    return theta, own, absent


def _drive_terms(joint: str, harmonics: int, own: dict[str, float], rotor_inertia: float) -> DriveTerms:
    def value(term: str) -> float:
        return own.get(f"{joint}.{term}", 0.0)

    held = next((name for name in own if name.startswith(f"{joint}.joint_")), None)
    if held is not None:
        raise EstimateError(
            f"The estimate has friction on a joint's own side ({held}), which neither URDF nor MJCF can hold beside its motor's; "
            "identify with friction = [\"coulomb\", \"viscous\"] to export."
        )

    orders = range(1, harmonics + 1)
    return DriveTerms(
        joint,
        value("coulomb"),
        value("viscous"),
        value("asymmetric_viscous"),
        value("offset"),
        np.array([value(f"gravity_cos_{order}") for order in orders]),
        np.array([value(f"gravity_sin_{order}") for order in orders]),
        rotor_inertia,
    )


def _notes(estimate: Estimate, found: Consistency, absent: list[str]) -> tuple[str, ...]:
    notes = []
    if estimate.simulated:
        notes.append("The estimate comes from simulated data: simulated, not measured.")
    if not found.consistent:
        notes.append(
            f"The estimate itself is not physically possible; these are the nearest possible parameters, "
            f"{found.distance:.3g} std away (projected)."
        )
    if found.filled:
        notes.append(
            f"The data fix the base parameters, not every link parameter: {found.filled} directions among "
            f"masses, first moments and inertias are filled by bodies nearest to a prior ({found.prior}); "
            "they change no torque that the model explains."
        )
    if estimate.model.kind == "external":
        notes.append("An external estimate sees no friction and no springs: the files have none of either.")
    if absent:
        notes.append(f"Not identifiable in this run and taken as zero: {', '.join(absent)}.")
    if not estimate.content.get("intervals_valid", True):
        notes.append("The model does not fit the run within its noise; see the estimate's warnings.")
    return tuple(notes)
