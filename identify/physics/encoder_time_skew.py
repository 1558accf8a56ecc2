"""The encoders' stamps are late or early against drives and plate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import fitted
from identify.physics.effect import Coefficient, Effect, Place, Shape, whole_robot
from identify.physics.responses import delayed
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _steps(scene: Scene, speed: FloatArray) -> FloatArray:
    """Coulomb torque of all drives in the directions of given speeds (n, B), no wrench; shape (rows, B)."""
    coulomb = np.array([fitted(scene, k, "coulomb") for k in range(scene.robot.n)])
    steps = coulomb[:, None] * np.sign(speed)
    return np.concatenate([steps, np.zeros((scene.rows - scene.robot.n, speed.shape[1]))])


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    """Difference to all rows one lag ahead; friction's steps move by it and are not smeared over samples."""
    late = shape["late"] if abs(shape["late"]) > 1e-6 else 1e-6
    now = _steps(scene, scene.speed)
    ahead = delayed(scene, scene.prediction - now, -late) + _steps(scene, delayed(scene, scene.speed, -late))
    return ((ahead - scene.prediction) / late)[:, None]


EFFECT = Effect(
    name="encoder_time_skew",
    where="S",
    parity="O",
    coefficients=(Coefficient("T", "s"),),
    columns=_columns,
    places=whole_robot,
    sentence="The encoders' samples lag drives and plate alike by {T}.",
    reference="reading(t) = q(t - T): all rows are those of the reading T later; one T for drives and plate",
    shapes=(Shape("late", "s", (-8e-3, -2e-3, -5e-4, 5e-4, 2e-3, 8e-3)),),
    # the size must agree with the shift that shapes the pulses at friction's steps, else it is no skew
    constraint=lambda scene, place, values, shape: bool(0.4 < values[0] / (shape["late"] or np.inf) < 2.5),
)
