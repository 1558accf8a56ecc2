"""A motor that turns with two joints: its friction acts on both and turns round with neither."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import revolute_drives
from identify.physics.effect import Coefficient, Effect, Place, Shape
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    joint, partner, ratio = place.joint, place.partner, shape["c"]
    speed = scene.qd[joint] + ratio * scene.qd[partner]
    friction = np.stack([np.sign(speed), speed])
    result = np.zeros((scene.rows, *friction.shape))
    result[joint], result[partner] = friction, ratio * friction  # one loss, felt through both joints
    return result


def _places(scene: Scene) -> list[Place]:
    """Ordered pairs: c from j to k is 1/c from k to j. Stated couplings already rub in motor space."""
    joints = [] if scene.robot.coupling is not None else [p.joint for p in revolute_drives(scene)]
    return [Place(joint=j, partner=k) for j in joints for k in joints if j != k]


EFFECT = Effect(
    name="coupled_transmission_friction",
    where="I",
    parity="O",
    coefficients=(Coefficient("fc", "N.m", +1), Coefficient("fv", "N.m.s/rad", +1)),
    columns=_columns,
    places=_places,
    sentence=(
        "{place} have friction in a motor that turns with both, at {c} of the second joint's speed: "
        "Coulomb {fc}, viscous {fv}."
    ),
    reference="fc sgn(qd_j + c qd_k) + fv (qd_j + c qd_k) on joint j and c times that on joint k, |c| <= 1",
    shapes=(Shape("c", "1", (-1.0, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 1.0)),),
    size_of=lambda values, shape: float(values[0]),
)
