"""A link swings at its own frequency when it is accelerated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, Shape
from identify.physics.loose_links import links_along
from identify.physics.responses import resonant
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    natural = 2.0 * np.pi * shape["f0"]
    swing = -resonant(scene, scene.qdd[joint], shape["f0"], shape["damping"]) / natural**2
    rate = scene.ddt(swing)
    return links_along(scene, joint, swing, rate, scene.ddt(rate))[:, None]


EFFECT = Effect(
    name="link_vibration",
    where="B",
    parity="X",
    coefficients=(Coefficient("share", "1", +1),),
    columns=_columns,
    places=every_drive,
    sentence="{place}'s link swings at {f0} after every acceleration (share {share}, damping {damping}).",
    reference="x'' + 2 z w x' + w^2 x = -share qdd; link = motor + x",
    # a link takes part in its joint's acceleration once at most; the rest is room for noise
    constraint=lambda scene, place, values, shape: bool(values[0] < 2.0),
    shapes=(Shape("f0", "Hz", (8.0, 11.0, 15.0, 20.0, 28.0, 40.0)), Shape("damping", "1", (0.02, 0.15))),
)
