"""The arm touches something in one part of a joint's travel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, Shape, every_joint
from identify.physics.outside import tip_forces
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _push(scene: Scene, joint: int, centre: float, width: float) -> FloatArray:
    """A soft bump of the joint's position, 0 to 1, never negative: it pushes one way only, shape (B,)."""
    q = scene.q[joint]
    low, high = float(q.min()), float(q.max())
    away = (q - low - centre * (high - low)) / width
    return np.maximum(1.0 - away**2, 0.0) ** 2


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    push = _push(scene, place.joint, shape["centre"], shape["width"])
    return tip_forces(scene, (shape["reach"], 0.0, 0.0)) * push


EFFECT = Effect(
    name="external_contact",
    where="B",
    parity="E",
    coefficients=(Coefficient("fx", "N"), Coefficient("fy", "N"), Coefficient("fz", "N")),
    columns=_columns,
    places=every_joint,
    sentence=(
        "The last link is pushed by something from outside while {place} is within {width} of {centre} of "
        "its travel: {fx}, {fy} and {fz} along the base's axes at most."
    ),
    reference="one-sided push of one direction, local in a joint's position; drives (J'f) and plate (X f)",
    shapes=(
        Shape("centre", "of the travel", (0.02, 0.14, 0.26, 0.38, 0.5, 0.62, 0.74, 0.86, 0.98)),
        Shape("width", "rad", (0.06, 0.2)),
        Shape("reach", "m", (0.1, 0.5)),
    ),
)
