"""A motor whose iron saturates at high current."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import current_drives, torque_per_ampere
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint = place.joint
    return only_joint(scene, joint, torque_per_ampere(scene, joint) * scene.current_a[joint] ** 3)


def _still_rises(scene: Scene, place: Place, values: FloatArray, shape: Mapping[str, float]) -> bool:
    """Torque K i (1 - beta i^2) must still grow with the current over the currents seen."""
    return bool(3.0 * values[0] * np.quantile(scene.current_a[place.joint] ** 2, 0.98) < 1.0)


EFFECT = Effect(
    name="torque_constant_saturation",
    where="I",
    parity="X",
    coefficients=(Coefficient("beta", "1/A2", +1),),
    columns=_columns,
    places=current_drives,
    sentence="{place}'s motor saturates: its torque constant falls by {beta} times the current squared.",
    reference="torque = K i (1 - beta i^2), so the current is higher by beta i^3",
    constraint=_still_rises,
)
