"""Units a map file may name, as factors to SI."""

from __future__ import annotations

import math

from daq.errors import UsageError

# counts have no unit of their own: the map must give their scale
_ANGLE = {"rad": 1.0, "deg": math.pi / 180, "rev": 2 * math.pi, "m": 1.0, "mm": 1e-3, "counts": 1.0}
_SPEED = {"rad/s": 1.0, "deg/s": math.pi / 180, "rpm": math.pi / 30, "m/s": 1.0, "mm/s": 1e-3, "counts": 1.0}
_TORQUE = {"N.m": 1.0, "N.mm": 1e-3, "mN.m": 1e-3, "kN.m": 1e3, "counts": 1.0}
_FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "counts": 1.0}

UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "position": _ANGLE,
    "velocity": _SPEED,
    "effort": {**_TORQUE, **_FORCE},
    "current": {"A": 1.0, "mA": 1e-3, "counts": 1.0},
    "setpoint": _ANGLE,
    "force": _FORCE,
    "torque": _TORQUE,
}
DEFAULTS = {"time": "s", "position": "rad", "velocity": "rad/s", "effort": "N.m", "current": "A",
            "setpoint": "rad", "force": "N", "torque": "N.m"}


def factor(quantity: str, unit: str, where: str) -> float:
    """What a number in ``unit`` is multiplied by to become SI.

    Raises:
        UsageError: the quantity is not measured in that unit.
    """
    known = UNITS[quantity]
    if unit not in known:
        raise UsageError(f"{where}: [{quantity}] unit {unit!r} is unknown; choose one of {', '.join(known)}.")
    return known[unit]
