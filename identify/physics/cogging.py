"""The motor's magnets pull towards its teeth, whatever the current."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.motor_orders import ORDERS, waves
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_joint(scene, place.joint, waves(scene, place.joint, shape["k"]))


EFFECT = Effect(
    name="cogging",
    where="I",
    parity="E",
    coefficients=(Coefficient("a", "N.m"), Coefficient("b", "N.m")),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place}'s motor cogs: {k} waves a motor turn, {a} in cosine and {b} in sine at the joint, "
        "whatever the current."
    ),
    reference="a cos(k th) + b sin(k th) of the motor's angle th, independent of the current",
    shapes=(ORDERS,),
)
