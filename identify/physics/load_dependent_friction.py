"""A gear that rubs more the more torque it carries."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    return only_joint(scene, joint, np.abs(scene.load[joint]) * scene.direction[joint])


EFFECT = Effect(
    name="load_dependent_friction",
    where="I",
    parity="O",
    coefficients=(Coefficient("mu", "1", +1),),
    columns=_columns,
    places=every_drive,
    sentence="{place} rubs more under load: {mu} of the torque its gear carries is lost to friction.",
    reference="Hamon, Gautier, Garrec 2010-11; Duclusaud et al., ICRA 2025: mu |tau_l| sgn v, 0 <= mu < 1",
    constraint=lambda scene, place, values, shape: bool(values[0] < 1.0),
)
