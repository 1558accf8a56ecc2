"""Motion of every link of a chain, vectorised over samples (component-major arrays, samples last)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.robot import Robot
from identify.rotations import FloatArray, axis_rotation


@dataclass(frozen=True)
class LinkMotion:
    """Motion of one link's frame, expressed in the base frame.

    Attributes:
        rotation: the frame's axes, shape (3, 3, N).
        origin_m: position of its origin, shape (3, N).
        omega: angular velocity [rad/s], shape (3, N).
        alpha: angular acceleration [rad/s2], shape (3, N).
        acceleration: of the origin [m/s2], shape (3, N).
        axis: the joint's axis, shape (3, N).
    """

    rotation: FloatArray
    origin_m: FloatArray
    omega: FloatArray
    alpha: FloatArray
    acceleration: FloatArray
    axis: FloatArray


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of component-major vectors, shapes (3, N); np.cross is several times slower here."""
    result = np.empty_like(a)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(a[i], b[j], out=result[k])
        result[k] -= a[j] * b[i]
    return result


def rotate(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    """Apply rotations (3, 3, N) to vectors (3, N) or to one vector (3,)."""
    if vector.ndim == 1:
        return rotation[:, 0] * vector[0] + rotation[:, 1] * vector[1] + rotation[:, 2] * vector[2]
    return rotation[:, 0] * vector[0] + rotation[:, 1] * vector[1] + rotation[:, 2] * vector[2]


def _compose(parent: FloatArray, fixed: FloatArray, turn: FloatArray | None) -> FloatArray:
    # most frames are not turned at zero
    placed = parent if np.array_equal(fixed, np.eye(3)) else np.einsum("ijn,jk->ikn", parent, fixed)
    if turn is None:
        return placed
    return np.stack([rotate(placed, turn[:, column]) for column in range(3)], axis=1)


def link_motions(robot: Robot, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> list[LinkMotion]:
    """Propagate position, velocity and acceleration from the base to the tip.

    Args:
        robot: the chain.
        q: joint positions [rad or m], shape (n, N).
        qd: joint velocities, shape (n, N).
        qdd: joint accelerations, shape (n, N).

    Returns:
        One motion a link, base to tip; the base itself stands still.
    """
    count = q.shape[1]
    zero = np.zeros((3, count))
    rotation = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, count))
    origin, omega, alpha, acceleration = zero, zero, zero, zero
    motions = []
    for index, joint in enumerate(robot.joints):
        arm = rotate(rotation, joint.translation_m)
        turn = None if joint.prismatic else axis_rotation(joint.axis, q[index])
        acceleration = acceleration + cross(alpha, arm) + cross(omega, cross(omega, arm))
        origin = origin + arm
        rotation = _compose(rotation, joint.rotation, turn)
        axis = rotate(rotation, joint.axis)
        if joint.prismatic:
            slide = axis * q[index]
            origin = origin + slide
            acceleration = (
                acceleration
                + cross(alpha, slide)
                + cross(omega, cross(omega, slide))
                + 2.0 * cross(omega, axis * qd[index])
                + axis * qdd[index]
            )
        else:
            spin = axis * qd[index]
            alpha = alpha + axis * qdd[index] + cross(omega, spin)
            omega = omega + spin
        motions.append(LinkMotion(rotation, origin, omega, alpha, acceleration, axis))
    return motions
