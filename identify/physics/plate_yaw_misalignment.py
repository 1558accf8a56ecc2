"""The plate is turned about its vertical axis against the robot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, only_wrench, whole_plate
from identify.physics.scene import Scene
from identify.rotations import FloatArray

_SMALL_RAD = 0.3  # beyond this the linear column does not hold


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    w = scene.wrench
    none = np.zeros_like(w[0])
    return only_wrench(scene, np.stack([w[1], -w[0], none, w[4], -w[3], none]))


EFFECT = Effect(
    name="plate_yaw_misalignment",
    where="P",
    parity="E",
    coefficients=(Coefficient("psi", "rad"),),
    columns=_columns,
    places=whole_plate,
    sentence="The plate is turned by {psi} about its vertical axis against the robot.",
    reference="wrench seen in axes turned by psi about z; a wrong zero of a vertical first joint is the same",
    constraint=lambda scene, place, values, shape: bool(abs(values[0]) < _SMALL_RAD),
)
