"""Regressors of the rigid arm: joint torques and base wrench, linear in the link parameters.

The wrench of every link is formed once in the base frame; joint torques are its projections on the joint
axes, the base wrench is its sum. Arrays are component-major with the samples last, so that every operation
runs over contiguous memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.kinematics import LinkMotion, cross, link_motions, rotate
from identify.robot import Robot
from identify.rotations import FloatArray


@dataclass(frozen=True)
class RigidColumns:
    """Columns of the rigid model for N samples.

    Attributes:
        internal: joint torques per link parameter [SI], shape (n, 10 n, N).
        external: base wrench per link parameter in the plate's frame, shape (6, 10 n, N).
        rotor_internal: joint torques per rotor inertia, shape (n, n, N).
        rotor_external: base wrench per rotor inertia, shape (6, n, N).
    """

    internal: FloatArray | None
    external: FloatArray | None
    rotor_internal: FloatArray | None
    rotor_external: FloatArray | None


def link_wrench_columns(motion: LinkMotion, gravity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give one link's inertia force and its moment about the base origin, per link parameter.

    Args:
        motion: the link's motion.
        gravity: acceleration of free fall [m/s2], shape (3,).

    Returns:
        Force columns of (m, mx, my, mz), shape (3, 4, N); moment columns of all ten, shape (3, 10, N).

    Source:
        Newton-Euler about the moving joint frame: f = m a + alpha x c + w x (w x c),
        n = c x a + I alpha + w x I w, with c the first moment and a = acceleration - gravity.
    """
    count = motion.omega.shape[1]
    a = motion.acceleration - gravity[:, None]
    force, moment = np.empty((3, 4, count)), np.empty((3, 10, count))
    force[:, 0], moment[:, 0] = a, cross(motion.origin_m, a)
    axes = motion.rotation
    _apply(_first_moment_matrix(motion.omega, motion.alpha), axes, force[:, 1:])
    for k in range(3):
        moment[:, 1 + k] = cross(axes[:, k], a)
        moment[:, 1 + k] += cross(motion.origin_m, force[:, 1 + k])
    _apply(axes, _inertia_columns(_in_link(axes, motion.omega), _in_link(axes, motion.alpha)), moment[:, 4:])
    return force, moment


def _apply(matrix: FloatArray, columns: FloatArray, out: FloatArray) -> None:
    """Multiply (3, 3, N) by columns (3, k, N) into ``out`` (3, k, N)."""
    for row in range(3):
        np.multiply(matrix[row, 0], columns[0], out=out[row])
        out[row] += matrix[row, 1] * columns[1]
        out[row] += matrix[row, 2] * columns[2]


def _dot(vector: FloatArray, columns: FloatArray, out: FloatArray) -> FloatArray:
    """Scalar products of (3, N) with columns (3, k, N), written into ``out`` (k, N)."""
    np.multiply(vector[0], columns[0], out=out)
    out += vector[1] * columns[1]
    out += vector[2] * columns[2]
    return out


def _first_moment_matrix(w: FloatArray, al: FloatArray) -> FloatArray:
    """Matrix S with S c = alpha x c + w x (w x c), shape (3, 3, N)."""
    xx, yy, zz = w * w
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return np.array(
        [
            [-yy - zz, xy - al[2], xz + al[1]],
            [xy + al[2], -xx - zz, yz - al[0]],
            [xz - al[1], yz + al[0], -xx - yy],
        ]
    )


def _in_link(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    return rotation[0] * vector[0] + rotation[1] * vector[1] + rotation[2] * vector[2]


def _inertia_columns(w: FloatArray, al: FloatArray) -> FloatArray:
    """Moments I alpha + w x I w of unit inertia components xx, xy, xz, yy, yz, zz, shape (3, 6, N)."""
    xx, yy, zz = w * w
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return np.array(
        [
            [al[0], al[1] - xz, al[2] + xy, -yz, yy - zz, yz],
            [xz, al[0] + yz, zz - xx, al[1], al[2] - xy, -xz],
            [-xy, xx - yy, al[0] - yz, xy, al[1] + xz, al[2]],
        ]
    )


def rigid_columns(
    robot: Robot,
    q: FloatArray,
    qd: FloatArray,
    qdd: FloatArray,
    *,
    internal: bool = True,
    external: bool = True,
    gravity: FloatArray | None = None,
) -> RigidColumns:
    """Evaluate the regressors Psi_i (5) and Psi_e (6) of links and rotors.

    Args:
        robot: the chain.
        q: joint positions, shape (n, N).
        qd: joint velocities, shape (n, N).
        qdd: joint accelerations, shape (n, N).
        internal: whether the joint torques are wanted.
        external: whether the base wrench is wanted.
        gravity: free fall to use instead of the robot's [m/s2], shape (3,).

    Returns:
        The columns; those not wanted are None.

    Source:
        Verdonck, Swevers, Samin 2001, Eqs. (5), (6), (8)-(13).
    """
    n, count = q.shape
    fall = robot.gravity if gravity is None else gravity
    motions = link_motions(robot, q, qd, qdd)
    result_i = np.zeros((n, 10 * n, count)) if internal else None
    result_e = np.empty((6, 10 * n, count)) if external else None
    for link, motion in enumerate(motions):
        force, moment = link_wrench_columns(motion, fall)
        columns = slice(10 * link, 10 * link + 10)
        if result_i is not None:
            for joint in range(link + 1):
                _project(robot, motions[joint], joint, force, moment, result_i[joint, columns])
        if result_e is not None:
            _place_on_plate(robot, force, moment, result_e[:, columns])
    rotor_i, rotor_e = _rotor_columns(robot, motions, qd, qdd, internal, external)
    return RigidColumns(result_i, result_e, rotor_i, rotor_e)


def _project(
    robot: Robot, motion: LinkMotion, joint: int, force: FloatArray, moment: FloatArray, out: FloatArray
) -> None:
    """Project a distal link's wrench on a joint's axis: z . M + (p x z) . F, or z . F when it slides."""
    if robot.joints[joint].prismatic:
        _dot(motion.axis, force, out[:4])
        return
    _dot(motion.axis, moment, out)
    out[:4] += _dot(cross(motion.origin_m, motion.axis), force, np.empty_like(force[0]))


def _place_on_plate(robot: Robot, force: FloatArray, moment: FloatArray, out: FloatArray) -> None:
    """Express a wrench about the base origin in the plate's frame about the plate's origin."""
    out[:3, 4:] = 0.0
    plate = robot.plate
    if plate is None or (not plate.translation_m.any() and (plate.rotation == np.eye(3)).all()):
        out[:3, :4], out[3:] = force, moment
        return
    shifted = moment.copy()
    arm = plate.translation_m
    for column in range(4):
        shifted[:, column] -= np.cross(arm, force[:, column], axisb=0, axisc=0)
    out[:3, :4] = np.einsum("ji,jkn->ikn", plate.rotation, force)
    out[3:] = np.einsum("ji,jkn->ikn", plate.rotation, shifted)


def _rotor_columns(
    robot: Robot,
    motions: list[LinkMotion],
    qd: FloatArray,
    qdd: FloatArray,
    internal: bool,
    external: bool,
) -> tuple[FloatArray | None, FloatArray | None]:
    """Torques and base wrench of the rotors' spin momentum, from h = Im s e.

    The kinetic energy is Im (s^2 / 2 + s w.e); the part carried with the stator, Im (w.e)^2 / 2 and
    the rotor's mass, belongs to the carrier link. Hence the drive sees Im (ds/dt + alpha.e), every joint
    that moves the carrier sees dh/dt about its axis, and so does the base: Eqs. (8)-(13).
    """
    n, count = qd.shape
    result_i = np.zeros((n, n, count)) if internal else None
    result_e = np.zeros((6, n, count)) if external else None
    motor = robot.motor_matrix
    for index, joint in enumerate(robot.joints):
        drive = joint.drive
        if not drive.has_rotor:
            continue
        spin, spin_rate = motor[index] @ qd, motor[index] @ qdd
        carrier = motions[drive.rotor_carrier] if drive.rotor_carrier >= 0 else None
        momentum_rate, along = _momentum_rate(drive.rotor_axis, carrier, spin, spin_rate)
        if result_i is not None:
            result_i[:, index] = motor[index][:, None] * along
            for moved in range(drive.rotor_carrier + 1):
                if not robot.joints[moved].prismatic:
                    result_i[moved, index] += np.sum(motions[moved].axis * momentum_rate, axis=0)
        if result_e is not None:
            plate = robot.plate
            result_e[3:, index] = momentum_rate if plate is None else plate.rotation.T @ momentum_rate
    return result_i, result_e


def _momentum_rate(
    axis: FloatArray, carrier: LinkMotion | None, spin: FloatArray, spin_rate: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rate of the spin momentum per unit rotor inertia (3, N), and the spin-up the motor feels (N,)."""
    if carrier is None:
        return axis[:, None] * spin_rate, spin_rate
    e = rotate(carrier.rotation, axis)
    rate = e * spin_rate + cross(carrier.omega, e) * spin
    return rate, spin_rate + np.sum(e * carrier.alpha, axis=0)
