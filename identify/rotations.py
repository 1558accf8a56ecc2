"""Rotation matrices of the URDF conventions."""

from __future__ import annotations

import numpy as np

FloatArray = np.ndarray


def rotation_from_rpy(rpy_rad: FloatArray | tuple[float, float, float]) -> FloatArray:
    """Rotate about the fixed x, then y, then z axis.

    Args:
        rpy_rad: roll, pitch, yaw [rad], shape (3,).

    Returns:
        Rotation matrix, shape (3, 3).

    Source:
        The URDF convention of ``origin rpy``: R = Rz(yaw) Ry(pitch) Rx(roll).
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy_rad), np.sin(rpy_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(rotation: FloatArray) -> FloatArray:
    """Invert :func:`rotation_from_rpy` (pitch in [-pi/2, pi/2]).

    Args:
        rotation: rotation matrix, shape (3, 3).

    Returns:
        Roll, pitch, yaw [rad], shape (3,).
    """
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    if np.hypot(rotation[0, 0], rotation[1, 0]) < 1e-12:  # gimbal lock: the yaw is free, take zero
        return np.array([np.arctan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
    return np.array(
        [np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])]
    )


def skew(vector: FloatArray) -> FloatArray:
    """Give the matrix of the cross product ``vector x``.

    Args:
        vector: shape (3,).

    Returns:
        Antisymmetric matrix, shape (3, 3).
    """
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def axis_rotation(axis: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Rotate about a fixed unit axis by many angles (Rodrigues).

    Args:
        axis: unit vector, shape (3,).
        angle_rad: angles [rad], shape (N,).

    Returns:
        Rotation matrices, component-major, shape (3, 3, N).
    """
    k = skew(axis)
    return (
        np.eye(3)[:, :, None]
        + np.sin(angle_rad) * k[:, :, None]
        + (1.0 - np.cos(angle_rad)) * (k @ k)[:, :, None]
    )
