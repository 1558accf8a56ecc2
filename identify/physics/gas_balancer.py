"""A gas cylinder that balances a joint: a spring that lags because its gas warms when compressed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.drives import revolute_drives
from identify.physics.effect import Coefficient, Effect, Place, Shape, only_joint
from identify.physics.responses import lagging
from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    q = scene.q[place.joint]
    pushed_in = 1.0 - np.cos(q - shape["phi"])
    loop = np.sin(q - shape["phi"]) * (pushed_in - lagging(scene, pushed_in, shape["heat_time"]))
    waves = [np.cos(q), np.sin(q), np.cos(2.0 * q), np.sin(2.0 * q)]
    return only_joint(scene, place.joint, np.stack([loop, *waves]))


EFFECT = Effect(
    name="gas_balancer",
    where="I",
    parity="X",
    coefficients=(
        Coefficient("loop", "N.m", +1),
        Coefficient("cos_1", "N.m"),
        Coefficient("sin_1", "N.m"),
        Coefficient("cos_2", "N.m"),
        Coefficient("sin_2", "N.m"),
    ),
    columns=_columns,
    places=revolute_drives,
    sentence=(
        "{place} is balanced by a gas spring: its force lags the stroke ({loop} that fades with the gas's "
        "heat in {heat_time}), on a spring of {sin_1} in the sine and {cos_1} in the cosine of its angle."
    ),
    reference=(
        "p0 (V0/(V0 - A x))^n A: n = 1 when slow, 1.4 when fast; the difference, high-passed by the gas's "
        "heat exchange, is a passive loop"
    ),
    shapes=(
        Shape("heat_time", "s", (0.2, 0.6, 2.0, 6.0, 20.0)),
        Shape("phi", "rad", (-0.8, 0.0, 0.8)),
    ),
    # without a loop it is a plain spring
    constraint=lambda scene, place, values, shape: bool(values[0] > 0.0),
)
