"""Columns of what acts inside the joints: friction (7), offsets, Fourier gravity compensation (15)."""

from __future__ import annotations

import numpy as np

from identify.parameters import internal_parameters
from identify.robot import Robot
from identify.rotations import FloatArray


def drive_velocity(robot: Robot, qd: FloatArray) -> FloatArray:
    """Motor speeds over their own gear ratios, shape (n, N): the speeds that friction acts on."""
    return qd if robot.coupling is None else robot.drive_matrix @ qd


def internal_columns(robot: Robot, q: FloatArray, qd: FloatArray, sign: FloatArray | None = None) -> FloatArray:
    """Evaluate the columns of the internal parameters (Psi_fg).

    Args:
        robot: the chain.
        q: joint positions, shape (n, N).
        qd: joint velocities, shape (n, N).
        sign: sign of the drive velocity to use instead of its own, shape (n, N).

    Returns:
        Drive torques per parameter, shape (n, k, N), in the order of
        :func:`identify.parameters.internal_parameters`.

    Source:
        Verdonck, Swevers, Samin 2001, Eqs. (7) and (15).
    """
    speed = drive_velocity(robot, qd)
    direction = np.sign(speed) if sign is None else sign
    columns = np.zeros((robot.n, len(internal_parameters(robot)), q.shape[1]))
    to_drive = np.eye(robot.n) if robot.coupling is None else np.linalg.inv(robot.drive_matrix).T
    k = 0
    for index, joint in enumerate(robot.joints):
        drive = joint.drive
        terms = {"coulomb": direction[index], "viscous": speed[index], "asymmetric_viscous": np.abs(speed[index])}
        for term in drive.friction:
            if term in terms:
                columns[index, k] = terms[term]
            else:  # on the joint itself: a coupled transmission hands it on to every motor that moves the joint
                own = np.sign(qd[index]) if term == "joint_coulomb" else qd[index]
                columns[:, k] = to_drive[:, index, None] * own
            k += 1
        if drive.offset:
            columns[index, k] = 1.0
            k += 1
        for harmonic in range(1, drive.gravity_harmonics + 1):
            columns[index, k] = np.cos(harmonic * q[index])
            columns[index, k + 1] = np.sin(harmonic * q[index])
            k += 2
    return columns
