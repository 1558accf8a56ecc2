"""A bearing that rubs more the harder the arm tilts it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.kinematics import cross
from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _tilting_moment(scene: Scene) -> FloatArray:
    """Moment across the first joint's axis [N.m], shape (B,).

    The base stands still, so what the plate supplies is what the first bearing carries. A tared plate hides a
    constant weight; on a first axis along gravity that weight passes through the bearing without tilting it.
    """
    plate, link = scene.robot.plate, scene.links[0]
    assert plate is not None
    force, moment = plate.rotation @ scene.wrench[:3], plate.rotation @ scene.wrench[3:]
    about = moment + cross(plate.translation_m[:, None] - link.origin_m, force)
    across = about - link.axis * np.sum(link.axis * about, axis=0)
    return np.sqrt(np.sum(across**2, axis=0))


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_joint(scene, 0, _tilting_moment(scene) * scene.direction[0])


def _places(scene: Scene) -> list[Place]:
    """The first joint, where a plate tells what it carries; no base parameter fixes what later ones carry."""
    seen = scene.has_wrench and not scene.robot.joints[0].prismatic
    return every_drive(scene)[:1] if seen else []


EFFECT = Effect(
    name="bearing_moment_friction",
    where="I",
    parity="O",
    coefficients=(Coefficient("mu_b", "1", +1),),
    columns=_columns,
    places=_places,
    sentence="{place}'s bearing rubs more when the arm tilts it: {mu_b} of the moment across its axis.",
    reference="Nevmerzhitskiy et al. 2019: mu_b |moment perpendicular to the axis| sgn v",
)
