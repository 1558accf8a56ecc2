"""Waves locked to a motor's angle."""

from __future__ import annotations

import numpy as np

from identify.physics.effect import Shape
from identify.physics.scene import Scene
from identify.rotations import FloatArray

# orders a turn of the motor: eccentricity and imbalance 1, harmonic drive 2, pole pairs and their multiples
ORDERS = Shape("k", "1", (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0), continuous=False)


def waves(scene: Scene, joint: int, order: float) -> FloatArray:
    """Cosine and sine of an order of a motor's angle, shape (2, B)."""
    angle = order * scene.motor_angle_rad[joint]
    return np.stack([np.cos(angle), np.sin(angle)])
