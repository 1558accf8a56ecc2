"""A hose or cable from outside pulls at the last link."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, Shape, whole_robot
from identify.physics.outside import tip_forces, tip_m
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    offset = (shape["reach"], shape["aside"], shape["across"])
    axes = tip_forces(scene, offset)
    point = tip_m(scene, offset)
    moved = point - point.mean(axis=1, keepdims=True)
    pull = -np.einsum("rkn,kn->rn", axes, moved)
    return np.concatenate([pull[:, None], axes], axis=1)


EFFECT = Effect(
    name="external_hose",
    where="B",
    parity="E",
    coefficients=(
        Coefficient("K", "N/m", +1),
        Coefficient("fx", "N"),
        Coefficient("fy", "N"),
        Coefficient("fz", "N"),
    ),
    columns=_columns,
    places=whole_robot,
    sentence=(
        "Something from outside, such as a hose, pulls at the last link {reach} out: stiffness {K}, on "
        "average {fx}, {fy} and {fz} along the base's axes."
    ),
    reference="f = -K (p - p0) + T0 at one point; one force explains drives (J'f) and plate (X f)",
    shapes=(
        Shape("reach", "m", (0.0, 0.15, 0.35, 0.7)),
        Shape("aside", "m", (-0.15, 0.15)),
        Shape("across", "m", (-0.15, 0.15)),
    ),
)
