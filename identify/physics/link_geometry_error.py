"""A link is longer or shorter than the robot file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray

_STEP_M = 1e-4


def _moved(scene: Scene, joint: int, axis: int, by_m: float) -> FloatArray:
    joints = list(scene.robot.joints)
    translation = joints[joint].translation_m + by_m * np.eye(3)[axis]
    joints[joint] = replace(joints[joint], translation_m=translation)
    return scene.with_robot(replace(scene.robot, joints=tuple(joints)))


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    ahead = [_moved(scene, place.joint, axis, _STEP_M) for axis in range(3)]
    behind = [_moved(scene, place.joint, axis, -_STEP_M) for axis in range(3)]
    return (np.stack(ahead, axis=1) - np.stack(behind, axis=1)) / (2.0 * _STEP_M)


def _after_the_first(scene: Scene) -> list[Place]:
    """Origins of all joints but the first, whose shift only moves the plate's origin."""
    return [Place(joint=k) for k in range(1, scene.robot.n)]


EFFECT = Effect(
    name="link_geometry_error",
    where="B",
    parity="E",
    coefficients=(Coefficient("x", "m"), Coefficient("y", "m"), Coefficient("z", "m")),
    columns=_columns,
    places=_after_the_first,
    sentence=(
        "{place} sits elsewhere on its parent link than the robot file says: by {x}, {y} and {z} along the "
        "parent's axes (directions that cannot be seen stay at 0)."
    ),
    reference="d regressor / d length; true origin = stated origin + (x, y, z)",
)
