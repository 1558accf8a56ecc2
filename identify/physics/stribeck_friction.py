"""More friction at low speed than Coulomb's law says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, Shape, every_joint, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    k = place.joint
    return only_joint(scene, k, np.exp(-((scene.speed[k] / shape["vs"]) ** 2)) * scene.direction[k])


EFFECT = Effect(
    name="stribeck_friction",
    where="I",
    parity="O",
    coefficients=(Coefficient("fs_minus_fc", "N.m", +1),),
    columns=_columns,
    places=every_joint,
    sentence="{place} sticks more at low speed than Coulomb friction says: {fs_minus_fc} more as it comes to rest, fading over {vs}.",
    reference="Armstrong, Dupont, Canudas de Wit, Automatica 30(7) 1994: (fs - fc) exp(-(|v|/vs)^2) sgn v",
    shapes=(Shape("vs", "rad/s", (0.005, 0.01, 0.02, 0.035, 0.06, 0.1, 0.16, 0.25)),),
)
