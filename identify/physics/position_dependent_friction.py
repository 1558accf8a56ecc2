"""Friction that changes along a joint's turn, as a bent shaft or an uneven gear makes it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import friction_beside, revolute_drives
from identify.physics.effect import Coefficient, Effect, Place, Shape, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _waves(scene: Scene, joint: int, order: float) -> FloatArray:
    return np.stack([np.cos(order * scene.q[joint]), np.sin(order * scene.q[joint])])


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    return only_joint(scene, joint, _waves(scene, joint, shape["m"]) * scene.direction[joint])


def _resists(scene: Scene, place: Place, values: FloatArray, shape: Mapping[str, float]) -> bool:
    joint = place.joint
    extra = values @ _waves(scene, joint, shape["m"])
    coulomb, _ = friction_beside(scene, joint, extra * scene.direction[joint])
    return bool(np.quantile(coulomb + extra, 0.02) >= 0.0)


EFFECT = Effect(
    name="position_dependent_friction",
    where="I",
    parity="O",
    coefficients=(Coefficient("a", "N.m"), Coefficient("b", "N.m")),
    columns=_columns,
    places=revolute_drives,
    sentence=(
        "{place} has friction that changes along its travel, {m} waves a turn: {a} in cosine, {b} in "
        "sine."
    ),
    reference="(a cos m q + b sin m q) sgn v; friction as a whole never drives",
    shapes=(Shape("m", "1", (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0), continuous=False),),
    constraint=_resists,
)
