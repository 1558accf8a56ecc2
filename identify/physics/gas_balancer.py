"""A gas cylinder that balances a joint: a spring that lags because its gas warms when compressed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.physics.crank import rod
from identify.physics.drives import revolute_drives
from identify.physics.effect import Coefficient, Effect, Place, Shape, only_joint
from identify.physics.responses import lagging
from identify.physics.scene import Scene
from identify.rotations import FloatArray

_ADIABATIC = 1.4  # two-atomic gases
# length of the gas at rest over the crank's hypotenuse: strokes take up to half of it
_GAS_LENGTH = 0.6


def _columns(scene: Scene, place: Place, shape: Mapping[str, float]) -> FloatArray:
    """Gas at the wall's temperature, then what its own temperature adds, which fades with its heat."""
    stroke, lever = rod(scene.q[place.joint] - shape["phi"])
    compression = -np.log(1.0 - stroke / _GAS_LENGTH)
    slow = lever * np.exp(compression)
    warmth = (_ADIABATIC - 1.0) * (compression - lagging(scene, compression, shape["heat_time"]))
    return only_joint(scene, place.joint, np.stack([slow * np.exp(warmth), lever]))


EFFECT = Effect(
    name="gas_balancer",
    where="I",
    parity="X",
    # gas pressure, and the pressure of the air outside with a parallel spring's, of either sign
    coefficients=(Coefficient("pressure", "N.m", +1), Coefficient("constant", "N.m")),
    columns=_columns,
    places=revolute_drives,
    sentence=(
        "{place} is balanced by a gas spring with its dead centre at {phi}: {pressure} at rest and "
        "{constant} from the air outside, lagging the stroke as its gas warms and cools within {heat_time}."
    ),
    reference=(
        "p0 (V0/(V0 - A x))^n A: n = 1 when slow, 1.4 when fast; between them the heat exchange makes a "
        "passive loop"
    ),
    shapes=(
        Shape("heat_time", "s", (0.4, 1.2, 2.5, 6.0, 15.0)),
        Shape("phi", "rad", (-2.0, -1.0, 0.0, 1.0, 2.0, 3.14)),
    ),
    # without gas it is a plain spring
    constraint=lambda scene, place, values, shape: bool(values[0] > 0.0),
)
