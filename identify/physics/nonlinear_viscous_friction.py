"""Viscous friction that is no straight line in speed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive, friction_beside
from identify.physics.effect import Coefficient, Effect, Place, Shape, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _law(scene: Scene, joint: int, power: float) -> FloatArray:
    return np.abs(scene.speed[joint]) ** power * scene.direction[joint]


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_joint(scene, place.joint, _law(scene, place.joint, shape["p"]))


def _grows(scene: Scene, place: Place, values: FloatArray, shape: Mapping[str, float]) -> bool:
    joint = place.joint
    _, viscous = friction_beside(scene, joint, values[0] * _law(scene, joint, shape["p"]))
    seen = np.quantile(np.abs(scene.speed[joint]), [0.05, 0.95])
    slope = viscous + values[0] * shape["p"] * seen ** (shape["p"] - 1.0)
    return bool((slope >= 0.0).all())


EFFECT = Effect(
    name="nonlinear_viscous_friction",
    where="I",
    parity="O",
    coefficients=(Coefficient("c", "N.m.(s/rad)^p"),),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place} has friction that does not grow in proportion to its speed: {c} times the speed to the "
        "power {p}."
    ),
    reference="c |v|^p sgn v beside Coulomb and viscous friction; the total never falls with speed",
    shapes=(Shape("p", "1", (1.4, 1.7, 2.0, 2.3, 2.6, 3.0, 3.5)),),
    constraint=_grows,
)
