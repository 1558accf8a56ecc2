"""One file a protocol; `protocol_named` finds it by the name in a configuration file."""

from __future__ import annotations

from typing import Any

from drivers.force_plate.errors import PlateSettingError
from drivers.force_plate.protocols.bota import Bota
from drivers.force_plate.protocols.dynpick import DynPick
from drivers.force_plate.protocols.gsv import Gsv8
from drivers.force_plate.protocols.optoforce import OptoForce
from drivers.force_plate.protocols.protocol import PlateProtocol
from drivers.force_plate.protocols.robotiq import RobotiqFt300

PROTOCOLS: dict[str, type] = {
    "bota": Bota,
    "robotiq_ft300": RobotiqFt300,
    "dynpick": DynPick,
    "gsv8": Gsv8,
    "optoforce": OptoForce,
}


def protocol_named(name: str, **settings: Any) -> PlateProtocol:
    """Return the protocol called ``name`` with its settings, such as ``rate_hz`` or ``sensitivity``.

    Raises:
        PlateSettingError: no such protocol, or no such setting.
    """
    if name not in PROTOCOLS:
        raise PlateSettingError(
            f"There is no force plate protocol '{name}'; choose one of {', '.join(PROTOCOLS)}."
        )
    try:
        return PROTOCOLS[name](**settings)
    except TypeError as error:
        raise PlateSettingError(f"The force plate protocol '{name}' refuses a setting: {error}.") from error
