"""The encoders' stamps are late or early against drives and plate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import fitted
from identify.physics.effect import Coefficient, Effect, Place, Shape, whole_robot
from identify.physics.responses import delayed
from identify.physics.scene import Scene
from identify.rotations import FloatArray

# dense, because which samples lie between a true and a read reversal changes every tenth of a millisecond
_LATE_S = (1e-4, 2e-4, 3.5e-4, *(float(x) for x in np.arange(5e-4, 6.6e-3, 2.5e-4)), 8e-3)
_EARLY_S = (-8e-3, -4e-3, -2e-3, -1e-3, -5e-4, -2e-4)


def _coulomb(scene: Scene) -> FloatArray:
    return np.array([fitted(scene, k, "coulomb") for k in range(scene.robot.n)])


def _steps(scene: Scene, speed: FloatArray) -> FloatArray:
    """Coulomb torque of all drives in the directions of given speeds (n, B), no wrench; shape (rows, B)."""
    steps = _coulomb(scene)[:, None] * np.sign(speed)
    return np.concatenate([steps, np.zeros((scene.rows - scene.robot.n, speed.shape[1]))])


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    """Rate of the smooth rows, and the samples between a true and a read reversal, whose friction turns."""
    now = _steps(scene, scene.speed)
    turned = _steps(scene, delayed(scene, scene.speed, -shape["late"])) - now
    return np.stack([scene.ddt(scene.prediction - now), turned], axis=1)


def _agrees(scene: Scene, place: Place, values: FloatArray, shape: Mapping[str, float]) -> bool:
    """Friction must turn by about its whole self, and the smooth rows not move the other way."""
    turns = 0.6 < values[1] < 1.4 or not _coulomb(scene).any()
    return bool(turns and -0.5 < values[0] / (shape["late"] or 1e-6) < 4.0)


EFFECT = Effect(
    name="encoder_time_skew",
    where="S",
    parity="O",
    coefficients=(Coefficient("T", "s"), Coefficient("turned", "1", +1)),
    columns=_columns,
    places=whole_robot,
    sentence="The encoders' samples lag drives and plate alike by {T} (by {late} where friction turns).",
    reference="reading(t) = q(t - T): all rows are those of the reading T later; one T for drives and plate",
    shapes=(Shape("late", "s", (*_EARLY_S, *_LATE_S)),),
    constraint=_agrees,
)
