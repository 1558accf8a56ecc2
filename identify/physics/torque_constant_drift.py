"""A motor whose magnets weaken as they warm up."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_joint(scene, place.joint, scene.torque[place.joint])


EFFECT = Effect(
    name="torque_constant_drift",
    where="I",
    parity="X",
    coefficients=(Coefficient("loss", "1", +1),),
    columns=_columns,
    places=every_drive,
    sentence=(
        "{place}'s torque constant falls during the run by {loss}, as it does while magnets warm: all of"
        " its current grows by that share."
    ),
    reference=(
        "K(t) falls by 0.1 (NdFeB) to 0.2 (ferrite) %/K, so the nominal torque rises in proportion to "
        "itself"
    ),
    constraint=lambda scene, place, values, shape: bool(values[0] < 1.0),
    progressive=True,
)
