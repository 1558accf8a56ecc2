"""A cable or hose bundle along the arm pulls a joint towards its rest position."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import revolute_drives
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    q = scene.q[place.joint]
    return only_joint(scene, place.joint, np.stack([q, q**3]))


EFFECT = Effect(
    name="cable_stiffness",
    where="I",
    parity="E",
    coefficients=(Coefficient("k", "N.m/rad"), Coefficient("k3", "N.m/rad3")),
    columns=_columns,
    places=revolute_drives,
    sentence="{place} is pulled back by a cable-like stiffness of {k} (cubic part {k3}).",
    reference="k (q - q0) + k3 (q - q0)^3; k q0 is part of the offset",
    constraint=lambda scene, place, values, shape: bool(
        (values[0] + 3.0 * values[1] * np.quantile(scene.q[place.joint] ** 2, [0.25, 0.9]) > 0).all()
    ),
)
