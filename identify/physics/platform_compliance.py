"""The platform between robot and plate swings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, only_wrench, whole_plate
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    rate = scene.ddt(scene.wrench)
    return only_wrench(scene, np.stack([-scene.ddt(rate), -rate], axis=1))


EFFECT = Effect(
    name="platform_compliance",
    where="P",
    parity="X",
    coefficients=(Coefficient("inverse_square", "s2", +1), Coefficient("lag", "s", +1)),
    columns=_columns,
    places=whole_plate,
    sentence=(
        "The platform swings on the plate: the wrench is amplified with the square of frequency, "
        "{inverse_square} = 1/(2 pi f)^2, and lags by {lag}."
    ),
    reference="w - w''/w0^2 - (2 damping/w0) w': a resonance at w0 = 2 pi f well above the motion",
    # more lag than a damping of 0.5 gives is timing, not a resonance; no compliance at all is timing too
    constraint=lambda scene, place, values, shape: bool(0.0 <= values[1] <= np.sqrt(max(values[0], 0.0))),
)
