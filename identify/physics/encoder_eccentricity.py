"""An encoder disk that turns off its centre."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place, Shape, every_revolute
from identify.physics.scene import Scene
from identify.physics.true_motion import rows_by_motion
from identify.rotations import FloatArray


def _disk(scene: Scene, joint: int, turns: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angle of the encoder's disk and two derivatives: the joint's own, or whole turns of its motor."""
    if turns == 0.0:
        return scene.q[joint], scene.qd[joint], scene.qdd[joint]
    gear = turns * scene.robot.motor_matrix[joint]
    return gear @ scene.q, gear @ scene.qd, gear @ scene.qdd


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    at_q, at_qd, at_qdd = rows_by_motion(scene, joint)
    angle, rate, pull = _disk(scene, joint, shape["turns"])
    sine, cosine = np.sin(angle), np.cos(angle)
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
        "{place}'s encoder disk is off its centre: it reads {sine} in the sine and {cosine} in the cosine of "
        "its angle too much ({turns} a turn of the motor; 0: once a turn of the joint)."
    ),
    reference="reading = q + e sin(angle + phi), joint's or motor's: e cos(phi) and e sin(phi)",
    shapes=(Shape("turns", "times", (0.0, 1.0, 2.0), continuous=False),),
)
