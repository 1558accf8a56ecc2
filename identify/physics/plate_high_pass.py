"""The plate's charge amplifiers forget slow forces."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.effect import Coefficient, Effect, Place, only_wrench, whole_plate
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_wrench(scene, -scene.integral(scene.wrench))


EFFECT = Effect(
    name="plate_high_pass",
    where="P",
    parity="O",
    coefficients=(Coefficient("corner", "rad/s", +1),),
    columns=_columns,
    places=whole_plate,
    sentence="The plate forgets slow forces: its channels are high-passed at {corner} (1 / time constant).",
    reference="w - (1/T) integral w, one T for six channels; leads the lowest lines in phase",
)
