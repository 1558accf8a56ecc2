"""A motor whose torque constant is not the robot file's."""

from __future__ import annotations

from collections.abc import Mapping

from identify.physics.drives import every_drive
from identify.physics.effect import Coefficient, Effect, Place, only_joint
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return only_joint(scene, place.joint, scene.torque[place.joint])


def _places(scene: Scene) -> list[Place]:
    """Joints whose constant the fit took as exact (scale 1); the others show in their estimate."""
    return [place for place in every_drive(scene) if scene.scale[place.joint] == 1.0]


EFFECT = Effect(
    name="torque_constant_error",
    where="I",
    parity="X",
    coefficients=(Coefficient("current_excess", "1"),),
    columns=_columns,
    places=_places,
    sentence=(
        "{place}'s motor draws {current_excess} more current than its nominal torque constant explains, so the true "
        "constant is lower by about that share."
    ),
    reference=(
        "Gautier & Briot, JDSMC 136(5) 2014: one torque row times 1 + current_excess = K_nominal / K"
    ),
    constraint=lambda scene, place, values, shape: bool(1.0 + values[0] > 0.0),
)
