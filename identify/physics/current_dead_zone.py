"""A drive that needs a little current before the motor feels any."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import current_drives, torque_per_ampere
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    return only_joint(scene, joint, torque_per_ampere(scene, joint) * np.sign(scene.current_a[joint]))


EFFECT = Effect(
    name="current_dead_zone",
    where="I",
    parity="X",
    coefficients=(Coefficient("d", "A", +1),),
    columns=_columns,
    places=current_drives,
    sentence=(
        "{place}'s drive loses {d} of current around zero: it jumps where the current changes sign, not "
        "where the joint turns."
    ),
    reference="d sgn(i) on the current, n K d sgn(i) in torque",
)
