"""An encoder disk that turns off its centre."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, every_revolute
from identify.physics.scene import Scene
from identify.physics.true_motion import rows_by_motion
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    at_q, at_qd, at_qdd = rows_by_motion(scene, joint)
    sine, cosine = np.sin(scene.q[joint]), np.cos(scene.q[joint])
    rate, pull = scene.qd[joint], scene.qdd[joint]
    by_sine = at_q * sine + at_qd * cosine * rate + at_qdd * (cosine * pull - sine * rate**2)
    by_cosine = at_q * cosine - at_qd * sine * rate - at_qdd * (sine * pull + cosine * rate**2)
    return -np.stack([by_sine, by_cosine], axis=1)


EFFECT = Effect(
    name="encoder_eccentricity",
    where="S",
    parity="E",
    coefficients=(Coefficient("sine", "rad"), Coefficient("cosine", "rad")),
    columns=_columns,
    places=every_revolute,
    sentence=(
        "{place}'s encoder disk is off its centre: it reads {sine} in the sine and {cosine} in the "
        "cosine of its angle too much."
    ),
    reference="reading = q + e sin(q + phi): e cos(phi) in sine, e sin(phi) in cosine",
)
