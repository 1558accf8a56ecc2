"""A gear that gives way under load."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place
from identify.physics.loose_links import links_along
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    twist = -scene.load[joint]
    rate = scene.ddt(twist)
    return links_along(scene, joint, twist, rate, scene.ddt(rate))[:, None]


EFFECT = Effect(
    name="joint_elasticity",
    where="B",
    parity="E",
    coefficients=(Coefficient("compliance", "rad/(N.m)", +1),),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place}'s gear gives way under load by {compliance}, so that its link is not where the encoder "
        "says."
    ),
    reference="Spong 1987: link = motor - tau_l / K, first order in 1/K, valid well below the resonance",
)
