"""One channel of the plate drifts through the run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, only_wrench
from identify.physics.plate_channels import every_channel, row_of
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    column = np.zeros((6, scene.q.shape[1]))
    column[row_of(place.channel)] = 1.0
    return only_wrench(scene, column)


EFFECT = Effect(
    name="plate_drift",
    where="P",
    parity="E",
    coefficients=(Coefficient("drift", "N or N.m"),),
    columns=_columns,
    places=every_channel,
    sentence="The plate's channel {place} drifts by {drift}.",
    reference="c0 + c1 t; a charge amplifier's leakage, below 10 mN/s in good ones",
    progressive=True,
)
