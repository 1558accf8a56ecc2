"""The plate's moments are about another point than the robot file says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, only_wrench, whole_plate
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    x, y, z = scene.wrench[:3]
    none, zero = np.zeros((3, 3, len(x))), np.zeros_like(x)
    # unit vectors times the force, one a column
    moment = np.stack([[zero, z, -y], [-z, zero, x], [y, -x, zero]])
    return only_wrench(scene, np.concatenate([none, moment]))


EFFECT = Effect(
    name="plate_origin_offset",
    where="P",
    parity="E",
    coefficients=(Coefficient("rx", "m"), Coefficient("ry", "m"), Coefficient("rz", "m")),
    columns=_columns,
    places=whole_plate,
    sentence=(
        "The plate's moments are about a point {rx}, {ry} and {rz} (x, y, z) from where the robot "
        "file puts its origin, as seen from that point."
    ),
    reference="M + r x F; shifting the robot on the plate is the same",
)
