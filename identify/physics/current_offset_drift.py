"""A current sensor whose zero creeps during the run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_joint(scene, place.joint, np.ones_like(scene.t_s))


EFFECT = Effect(
    name="current_offset_drift",
    where="I",
    parity="E",
    coefficients=(Coefficient("creep", "N.m"),),
    columns=_columns,
    places=every_drive,
    sentence="{place}'s current zero creeps during the run by what {creep} of torque would need.",
    reference="c1 t on one current; a constant zero error is the joint's offset",
    progressive=True,
)
