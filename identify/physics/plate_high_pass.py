"""The plate's charge amplifiers forget slow forces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, only_wrench, whole_plate
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_wrench(scene, -scene.integral(scene.wrench))


def _settling(scene: Scene, place: Place) -> FloatArray:
    """What stood on the plate at the start is forgotten, every channel by its own amount at the same pace."""
    return only_wrench(scene, np.broadcast_to(np.eye(6)[:, :, None], (6, 6, len(scene.t_s))))


EFFECT = Effect(
    name="plate_high_pass",
    where="P",
    parity="O",
    coefficients=(Coefficient("corner", "rad/s", +1),),
    columns=_columns,
    places=whole_plate,
    sentence="The plate forgets slow forces: its channels are high-passed at {corner} (1 / time constant).",
    settling=_settling,
    reference="w - (1/T) integral w, one T for six channels; leads the lowest lines in phase",
)
