"""What a simulator's file cannot hold, as JSON beside it, and the torques it stands for."""

from __future__ import annotations

from typing import Any

import numpy as np

from identify.regressor import rigid_columns
from service.export_mjcf import armature
from service.export_model import ExportModel, FloatArray
from service.export_spring import JointSpring

SCHEMA_VERSION = 1
_NOTE = (
    "Torques of the drives that the MJCF does not hold: per joint offset + asymmetric_viscous * abs(speed) + "
    "sum of cos_l cos(l q) + sin_l sin(l q), minus the joint spring of the MJCF where there is one. A "
    "rotor's spin momentum (gear_ratio * speed * inertia about axis in the frame of carrier) also acts on "
    "the joints that move its carrier and on the base; the MJCF has only its armature."
)


def sidecar_content(export: ExportModel, springs: dict[str, JointSpring]) -> dict[str, Any]:
    """Arrange what the MJCF cannot hold.

    Args:
        export: the numbers.
        springs: the joint springs that the MJCF holds.

    Returns:
        A JSON object.
    """
    estimate, robot = export.estimate, export.robot
    base = estimate.loaded.chain.base
    joints = []
    for joint, drive in zip(robot.joints, export.drives, strict=True):
        carrier, spring = joint.drive.rotor_carrier, springs.get(joint.name)
        joints.append(
            {
                "name": joint.name,
                "offset": drive.offset,
                "asymmetric_viscous": drive.asymmetric_viscous,
                "gravity_compensation": {"cos": drive.cosine.tolist(), "sin": drive.sine.tolist()},
                "mjcf_spring": None
                if spring is None
                else {
                    "rest": spring.rest_rad,
                    "stiffness": list(spring.stiffness),
                    "largest_torque_left_over": spring.left_over_nm,
                },
                "rotor": {
                    "inertia": drive.rotor_inertia,
                    "gear_ratio": joint.drive.gear_ratio,
                    "carrier": base if carrier < 0 else robot.joints[carrier].link,
                    "axis": joint.drive.rotor_axis.tolist(),
                },
            }
        )
    return {
        "schema_version": SCHEMA_VERSION,
        "robot": robot.name,
        "simulated": estimate.simulated,
        "projected": export.projected,
        "note": _NOTE,
        "notes": list(export.notes),
        "coupling": None if robot.coupling is None else robot.coupling.tolist(),
        "joints": joints,
    }


def drive_rest(sidecar: dict[str, Any], export: ExportModel, q: FloatArray, qd: FloatArray) -> FloatArray:
    """Give the drive torques that only the sidecar holds, shape (n, N).

    Args:
        sidecar: its content.
        export: for the transmission.
        q: joint positions, shape (n, N).
        qd: joint velocities, shape (n, N).

    Returns:
        Torques [N.m or N], drive by drive.
    """
    speed = export.robot.drive_matrix @ qd
    result = np.empty_like(q)
    for k, joint in enumerate(sidecar["joints"]):
        result[k] = joint["offset"] + joint["asymmetric_viscous"] * np.abs(speed[k])
        waves = joint["gravity_compensation"]
        for order, (cosine, sine) in enumerate(zip(waves["cos"], waves["sin"], strict=True), start=1):
            result[k] += cosine * np.cos(order * q[k]) + sine * np.sin(order * q[k])
        if joint["mjcf_spring"] is not None:
            spring = joint["mjcf_spring"]
            result[k] -= JointSpring(spring["rest"], tuple(spring["stiffness"]), 0.0).torque_nm(q[k])
    return result


def rotor_rest(
    export: ExportModel, q: FloatArray, qd: FloatArray, qdd: FloatArray, with_armature: bool
) -> tuple[FloatArray, FloatArray]:
    """Give the rotors' joint torques (n, N) beyond the armature, and their base wrench (6, N)."""
    robot = export.robot
    inertia = np.array([drive.rotor_inertia for drive in export.drives])
    columns = rigid_columns(robot, q, qd, qdd)
    torque = np.tensordot(columns.rotor_internal, inertia, axes=([1], [0]))
    if with_armature:
        matrix = robot.drive_matrix
        reflected = np.array(
            [armature(joint, value) for joint, value in zip(robot.joints, inertia, strict=True)]
        )
        torque = torque - matrix.T @ (reflected[:, None] * (matrix @ qdd))
    return torque, np.tensordot(columns.rotor_external, inertia, axes=([1], [0]))
