"""One channel of the plate reads too much or too little."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, only_wrench
from identify.physics.plate_channels import every_channel, row_of
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    column, row = np.zeros_like(scene.wrench), row_of(place.channel)
    column[row] = scene.wrench[row]
    return only_wrench(scene, column)


EFFECT = Effect(
    name="plate_gain_error",
    where="P",
    parity="E",
    coefficients=(Coefficient("g", "1"),),
    columns=_columns,
    places=every_channel,
    sentence="The plate's channel {place} reads too much by a share of {g}.",
    reference="(1 + g) w_c",
    constraint=lambda scene, place, values, shape: bool(values[0] > -1.0),
)
