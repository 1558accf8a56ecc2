"""The plate's clock runs at another rate than the joints', uncorrected."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.effect import Coefficient, Effect, Place, only_wrench, whole_plate
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_wrench(scene, -scene.ddt(scene.wrench))


EFFECT = Effect(
    name="clock_drift",
    where="S",
    parity="O",
    coefficients=(Coefficient("T", "s"),),
    columns=_columns,
    places=whole_plate,
    sentence="The plate's samples lag the joints' more and more through the run, by {T}.",
    reference="w(t - r t): T grows in time, r in s/s (1e-6 is 1 ppm)",
    progressive=True,
)
