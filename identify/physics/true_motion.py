"""Arms that move otherwise than their encoders say, motors and all."""

from __future__ import annotations

import numpy as np

from identify.physics.scene import Scene
from identify.rotations import FloatArray


def rows_by_motion(scene: Scene, joint: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of all rows by one joint's true angle, speed and acceleration; they serve every shape.

    Args:
        scene: the scene.
        joint: its index.

    Returns:
        Three of shape (rows, B).
    """
    store = scene.__dict__.setdefault("_rows_by_motion", {})  # as cached_property does, one entry a joint
    if joint not in store:
        unit = np.zeros_like(scene.q)
        unit[joint] = 1.0
        none = np.zeros_like(unit)
        store[joint] = (
            scene.along(unit, none, none),
            scene.along(none, unit, none),
            scene.along(none, none, unit),
        )
    return store[joint]
