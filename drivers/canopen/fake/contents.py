"""What stands in a fake drive's object dictionary."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.canopen.fake.dictionary import Dictionary, Slot, key

_CONSTANT = Slot("I")
_U8, _U16, _U32 = Slot("B", True), Slot("H", True), Slot("I", True)
_INVALID = 1 << 31
_WINDOW_RAD = 0.05  # following error window at the joint


@dataclass(frozen=True)
class DriveData:
    """Nameplate and behaviour of a fake drive.

    Args:
        polarity: 607Eh; bit 7 turns positions and bit 6 velocities, both or neither here.
        latency_ns: from SYNC to its PDOs being ready [ns].
        quick_stop_rad_s2: deceleration of the quick stop at the joint [rad/s2].
        refuses_modes_aloud: answers an unsupported mode with an abort; else 6061h just does not change.
    """

    node: int
    gear_ratio: float = 100.0
    encoder_counts: int = 131072
    rated_current_ma: int = 5000
    rated_torque_mnm: int = 1000
    polarity: int = 0
    vendor: int = 0x5EED
    product: int = 0x402
    serial: int = 1
    device_name: str = "simulated drive"
    modes: tuple[int, ...] = (1, 7, 8)
    refuses_modes_aloud: bool = False
    latency_ns: int = 150_000
    quick_stop_rad_s2: float = 20.0

    @property
    def rad_per_count(self) -> float:
        """Joint angle of one count as the drive reports it [rad], polarity included."""
        sign = -1 if self.polarity & 0x80 else 1
        return sign * math.tau / (self.encoder_counts * self.gear_ratio)


def build_dictionary(data: DriveData) -> Dictionary:
    """A dictionary with the objects of CiA 301 and CiA 402 that a drive of this kind has."""
    dictionary = Dictionary()
    _add_communication(dictionary, data)
    _add_pdos(dictionary, data.node)
    _add_drive(dictionary, data)
    dictionary.texts[key(0x1008)] = data.device_name.encode("ascii")
    return dictionary


def _add_communication(dictionary: Dictionary, data: DriveData) -> None:
    add = dictionary.add
    add(0x1000, 0, _CONSTANT, 0x00020192)
    add(0x1001, 0, Slot("B"), 0)
    add(0x1006, 0, _U32, 0)
    add(0x1016, 0, Slot("B"), 1)
    add(0x1016, 1, _U32, 0)
    add(0x1017, 0, _U16, 0)
    add(0x1018, 0, Slot("B"), 4)
    for sub, value in enumerate((data.vendor, data.product, 1, data.serial), start=1):
        add(0x1018, sub, _CONSTANT, value)


def _add_pdos(dictionary: Dictionary, node: int) -> None:
    for number in range(4):
        for first, identifier in ((0x1400, 0x200), (0x1800, 0x180)):
            # The first two of each direction are on by default, as in many drives.
            off = _INVALID if number > 1 else 0
            dictionary.add(first + number, 1, _U32, identifier + 0x100 * number + node | off)
            dictionary.add(first + number, 2, _U8, 255)
            dictionary.add(first + number + 0x200, 0, _U8, 0)
            for sub in range(1, 9):
                dictionary.add(first + number + 0x200, sub, _U32, 0)


def _add_drive(dictionary: Dictionary, data: DriveData) -> None:
    add = dictionary.add
    add(0x6007, 0, Slot("h", True), 1)
    add(0x603F, 0, Slot("H", mappable=True))
    add(0x6040, 0, Slot("H", True, True))
    add(0x6041, 0, Slot("H", mappable=True))
    add(0x605A, 0, Slot("h", True), 6)
    add(0x6060, 0, Slot("b", True, True), 0)
    add(0x6061, 0, Slot("b", mappable=True), 0)
    for index in (0x6062, 0x6064, 0x606C):
        add(index, 0, Slot("i", mappable=True))
    add(0x6065, 0, _U32, round(_WINDOW_RAD / abs(data.rad_per_count)))
    add(0x6075, 0, _U32, data.rated_current_ma)
    add(0x6076, 0, _U32, data.rated_torque_mnm)
    add(0x6078, 0, Slot("h", mappable=True))
    add(0x607A, 0, Slot("i", True, True))
    add(0x607E, 0, _U8, data.polarity)
    for index, first, second in ((0x608F, data.encoder_counts, 1), (0x6091, 1, 1)):
        add(index, 1, _U32, first)
        add(index, 2, _U32, second)
    add(0x60C1, 1, Slot("i", True, True))
    add(0x60C2, 1, _U8, 1)
    add(0x60C2, 2, Slot("b", True), -3)
