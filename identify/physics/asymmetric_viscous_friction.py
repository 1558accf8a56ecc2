"""Viscous friction that differs between the two directions of turning."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive, fitted
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_joint(scene, place.joint, np.abs(scene.speed[place.joint]))


def _places(scene: Scene) -> list[Place]:
    known = [k for k, joint in enumerate(scene.robot.joints) if "asymmetric_viscous" in joint.drive.friction]
    return [place for place in every_drive(scene) if place.joint not in known]


def _both_resist(scene: Scene, place: Place, values: FloatArray, shape: Mapping[str, float]) -> bool:
    return bool(abs(values[0]) <= max(fitted(scene, place.joint, "viscous"), 0.0))


EFFECT = Effect(
    name="asymmetric_viscous_friction",
    where="I",
    parity="E",
    coefficients=(Coefficient("d", "N.m.s/rad"),),
    columns=_columns,
    places=_places,
    sentence=(
        "{place} has viscous friction that differs between the directions: it is higher by {d} forwards "
        "and lower by as much backwards."
    ),
    reference=(
        "d |v|, viscous friction fv + d forwards and fv - d backwards, both positive; asymmetric Coulomb"
        " friction is an offset"
    ),
    constraint=_both_resist,
)
