"""The motor's torque constant ripples with its angle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.motor_orders import ORDERS, waves
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    return only_joint(scene, joint, scene.torque[joint] * waves(scene, joint, shape["k"]))


EFFECT = Effect(
    name="torque_ripple",
    where="I",
    parity="E",
    coefficients=(Coefficient("a", "1"), Coefficient("b", "1")),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place}'s motor needs a current that ripples in proportion to its torque: {k} waves a motor "
        "turn, shares {a} in cosine and {b} in sine."
    ),
    reference="i (a cos(k th) + b sin(k th)): vanishes without current, unlike cogging",
    shapes=(ORDERS,),
    constraint=lambda scene, place, values, shape: bool(np.linalg.norm(values) < 1.0),
)
