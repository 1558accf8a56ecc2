"""Points and unit forces on the last link, for what acts on the arm from outside."""

from __future__ import annotations

import numpy as np

from identify.kinematics import rotate
from identify.physics.scene import Scene
from identify.robot import Robot
from identify.rotations import FloatArray


def distal_axes(robot: Robot) -> FloatArray:
    """Axes of the last link to place a tool point by: outwards, then two across; columns, (3, 3).

    Outwards is how the chain came to it: the last segment with a length, seen from the last link at zero
    pose; a robot without any length uses its last axis.
    """
    turn, outward = np.eye(3), None
    for joint in reversed(robot.joints):
        turn = turn @ joint.rotation.T
        length = np.linalg.norm(joint.translation_m)
        if length > 1e-6:
            outward = turn @ joint.translation_m / length
            break
    outward = robot.joints[-1].axis if outward is None else outward
    across = np.eye(3)[int(np.argmin(np.abs(outward)))]
    first = across - outward * (outward @ across)
    first = first / np.linalg.norm(first)
    return np.stack([outward, first, np.cross(outward, first)], axis=1)


def tip_m(scene: Scene, offset_m: tuple[float, float, float]) -> FloatArray:
    """A point of the last link in the base frame.

    Args:
        scene: the scene.
        offset_m: from the link's frame outwards and across.

    Returns:
        Shape (3, B).
    """
    last = scene.links[-1]
    return last.origin_m + rotate(last.rotation, distal_axes(scene.robot) @ np.asarray(offset_m))


def tip_forces(scene: Scene, offset_m: tuple[float, float, float]) -> FloatArray:
    """Rows per unit force along the base's x, y, z at a point of the last link.

    Args:
        scene: the scene.
        offset_m: the point, see :func:`tip_m`.

    Returns:
        Shape (rows, 3, B).
    """
    point, last = tip_m(scene, offset_m), scene.robot.n - 1
    ones = np.ones(point.shape[1])
    return np.stack([scene.force_rows(point, np.outer(axis, ones), last) for axis in np.eye(3)], axis=1)
