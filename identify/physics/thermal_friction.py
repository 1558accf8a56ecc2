"""Friction that changes while the joint warms up."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    return only_joint(scene, joint, np.stack([scene.speed[joint], scene.direction[joint]]))


EFFECT = Effect(
    name="thermal_friction",
    where="I",
    parity="O",
    coefficients=(Coefficient("viscous_change", "N.m.s/rad"), Coefficient("coulomb_change", "N.m")),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place}'s friction changes during the run, as it does while grease warms: viscous by "
        "{viscous_change}, Coulomb by {coulomb_change}."
    ),
    reference="Raviola et al., Robotics 10(3) 2021: fv (and fc) approach a steady state over the run",
    progressive=True,
    size_of=lambda values, shape: float(abs(values[0])),
)
