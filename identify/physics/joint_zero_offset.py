"""A joint's zero is not where the robot file says."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.effect import Coefficient, Effect, Place, every_joint
from identify.physics.scene import Scene
from identify.physics.true_motion import rows_by_motion
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return -rows_by_motion(scene, place.joint)[0][:, None]


EFFECT = Effect(
    name="joint_zero_offset",
    where="B",
    parity="E",
    coefficients=(Coefficient("d", "rad"),),
    columns=_columns,
    places=every_joint,
    sentence="{place}'s encoder reads {d} more than the angle of its link.",
    reference="reading = q + d: the arm stands at q = reading - d",
)
