"""One channel of the plate leaks into another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, only_wrench
from identify.physics.plate_channels import every_pair, row_of
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    source, sink = (row_of(word) for word in (place.channel or "").split("->"))
    column = np.zeros_like(scene.wrench)
    column[sink] = scene.wrench[source]
    return only_wrench(scene, column)


EFFECT = Effect(
    name="plate_crosstalk",
    where="P",
    parity="E",
    coefficients=(Coefficient("c", "SI unit per SI unit"),),
    columns=_columns,
    places=every_pair,
    sentence="The plate's channels leak, {place}: {c}.",
    reference="w_to + c w_from",
)
