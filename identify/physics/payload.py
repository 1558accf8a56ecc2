"""A load on the last link that the reference model does not hold."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.effect import Coefficient, Effect, Place
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    return np.zeros((scene.rows, 1, scene.q.shape[1]))


def _nowhere(scene: Scene) -> list[Place]:
    """No place, on purpose.

    A load adds its ten inertial parameters to those of the last link, which the rigid model estimates
    from the same run: its columns are the baseline's own, nothing of them is left once the baseline is
    refitted, and no run can tell a load from a heavier link. Only against a reference (an estimate or a
    simulation without the load) does it show, as the same shift of the last link's parameters in the
    drives and in the plate; the comparison of two estimates names it there.
    """
    return []


EFFECT = Effect(
    name="payload",
    where="B",
    parity="E",
    coefficients=(Coefficient("m", "kg", +1),),
    columns=_columns,
    places=_nowhere,
    sentence="The last link carries {m} more than in the reference.",
    reference="ten inertial parameters of the last link; only against a reference model",
)
