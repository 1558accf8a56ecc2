"""A gear that does not transmit the motor's angle evenly, so that the link shakes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, Shape
from identify.physics.loose_links import links_along
from identify.physics.motor_orders import waves
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint, order = place.joint, shape["k"]
    cosine, sine = waves(scene, joint, order)
    rate = order * (scene.robot.motor_matrix[joint] @ scene.qd)
    pull = order * (scene.robot.motor_matrix[joint] @ scene.qdd)
    ahead = links_along(scene, joint, cosine, -sine * rate, -sine * pull - cosine * rate**2)
    behind = links_along(scene, joint, sine, cosine * rate, cosine * pull - sine * rate**2)
    return np.stack([ahead, behind], axis=1)


EFFECT = Effect(
    name="transmission_error",
    where="B",
    parity="E",
    coefficients=(Coefficient("a", "rad"), Coefficient("b", "rad")),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place}'s gear does not turn evenly: its link swings {k} times a motor turn by {a} in cosine "
        "and {b} in sine, and the plate feels it."
    ),
    reference=(
        "Tuttle & Seering 1996; Ghorbel et al. 2001: link = motor + a cos(k th) + b sin(k th), order 2 "
        "in harmonic drives"
    ),
    shapes=(Shape("k", "1", (1.0, 2.0, 3.0, 4.0), continuous=False),),
)
