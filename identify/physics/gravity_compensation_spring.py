"""A balancing spring that the robot file does not know."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import revolute_drives
from identify.physics.effect import Coefficient, Effect, Place, Shape, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    q = scene.q[place.joint]
    second = 1.0 if shape["harmonics"] > 1.5 else 0.0
    waves = np.stack([np.cos(q), np.sin(q), second * np.cos(2.0 * q), second * np.sin(2.0 * q)])
    return only_joint(scene, place.joint, waves)


def _places(scene: Scene) -> list[Place]:
    """Revolute joints without a stated compensation: where there is one, the fit holds it already."""
    joints = scene.robot.joints
    return [place for place in revolute_drives(scene) if joints[place.joint].drive.gravity_harmonics == 0]


EFFECT = Effect(
    name="gravity_compensation_spring",
    where="I",
    parity="E",
    coefficients=(
        Coefficient("cos_1", "N.m"),
        Coefficient("sin_1", "N.m"),
        Coefficient("cos_2", "N.m"),
        Coefficient("sin_2", "N.m"),
    ),
    columns=_columns,
    places=_places,
    sentence=(
        "{place} is balanced by a spring that the robot file does not state: {sin_1} in the sine and {cos_1} "
        "in the cosine of its angle ({sin_2} and {cos_2} in those of twice its angle)."
    ),
    reference="k A B sin(q - phi) (1 - l0 / l), expanded in the joint's angle; conservative, inside the arm",
    shapes=(Shape("harmonics", "1", (1.0, 2.0), continuous=False),),
)
