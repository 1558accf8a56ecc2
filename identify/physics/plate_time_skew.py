"""The plate's stamps are late or early, the same for all six channels."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.effect import Coefficient, Effect, Place, only_wrench, whole_plate
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_wrench(scene, -scene.ddt(scene.wrench))


EFFECT = Effect(
    name="plate_time_skew",
    where="S",
    parity="O",
    coefficients=(Coefficient("T", "s"),),
    columns=_columns,
    places=whole_plate,
    sentence="The plate's samples lag the joints' by {T}.",
    reference="w(t - T) = w - T dw/dt; one T for six channels",
)
