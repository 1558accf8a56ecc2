"""Objects of CiA 301 and CiA 402 that a session reads and writes, and how PDOs carry them."""

from __future__ import annotations

import struct
from dataclasses import dataclass

_SIGNED = "bhi"


@dataclass(frozen=True)
class Entry:
    """One entry of the object dictionary: its address and its number format (a `struct` letter)."""

    index: int
    sub: int
    format: str
    name: str

    @property
    def size(self) -> int:
        """Length in bytes."""
        return struct.calcsize("<" + self.format)

    @property
    def mapping(self) -> int:
        """The word that maps this entry into a PDO (index, sub-index, bits)."""
        return self.index << 16 | self.sub << 8 | self.size * 8

    @property
    def address(self) -> str:
        """The address as drive manuals print it."""
        return f"{self.index:04X}h:{self.sub}"

    def pack(self, value: int) -> bytes:
        """Bytes of `value` on the wire, little-endian."""
        return struct.pack("<" + self.format, value)

    def unpack(self, data: bytes) -> int:
        """The number in `data`; a drive that answers with more or fewer bytes is still read by its sign."""
        return int.from_bytes(data[: self.size], "little", signed=self.format in _SIGNED)


DEVICE_TYPE = Entry(0x1000, 0, "I", "device type")
CYCLE_PERIOD = Entry(0x1006, 0, "I", "communication cycle period")
HEARTBEAT_CONSUMER = Entry(0x1016, 1, "I", "heartbeat consumer time")
HEARTBEAT_PRODUCER = Entry(0x1017, 0, "H", "heartbeat producer time")
VENDOR = Entry(0x1018, 1, "I", "vendor")
PRODUCT = Entry(0x1018, 2, "I", "product code")
REVISION = Entry(0x1018, 3, "I", "revision")
SERIAL = Entry(0x1018, 4, "I", "serial number")

ABORT_OPTION = Entry(0x6007, 0, "h", "abort connection option code")
ERROR_CODE = Entry(0x603F, 0, "H", "error code")
CONTROL_WORD = Entry(0x6040, 0, "H", "control word")
STATUS_WORD = Entry(0x6041, 0, "H", "status word")
QUICK_STOP_OPTION = Entry(0x605A, 0, "h", "quick stop option code")
MODE = Entry(0x6060, 0, "b", "mode of operation")
MODE_DISPLAY = Entry(0x6061, 0, "b", "mode of operation display")
DEMAND = Entry(0x6062, 0, "i", "position demand value")
POSITION = Entry(0x6064, 0, "i", "position actual value")
VELOCITY = Entry(0x606C, 0, "i", "velocity actual value")
RATED_CURRENT = Entry(0x6075, 0, "I", "motor rated current")
RATED_TORQUE = Entry(0x6076, 0, "I", "motor rated torque")
CURRENT = Entry(0x6078, 0, "h", "current actual value")
TARGET = Entry(0x607A, 0, "i", "target position")
POLARITY = Entry(0x607E, 0, "B", "polarity")
ENCODER_INCREMENTS = Entry(0x608F, 1, "I", "encoder increments")
ENCODER_REVOLUTIONS = Entry(0x608F, 2, "I", "encoder motor revolutions")
GEAR_MOTOR = Entry(0x6091, 1, "I", "gear motor revolutions")
GEAR_SHAFT = Entry(0x6091, 2, "I", "gear shaft revolutions")
FEED = Entry(0x6092, 1, "I", "feed")
FEED_SHAFT = Entry(0x6092, 2, "I", "feed shaft revolutions")
INTERPOLATION_DATA = Entry(0x60C1, 1, "i", "interpolation data record")
INTERPOLATION_VALUE = Entry(0x60C2, 1, "B", "interpolation time value")
INTERPOLATION_EXPONENT = Entry(0x60C2, 2, "b", "interpolation time exponent")

CYCLIC_SYNCHRONOUS_POSITION = 8
INTERPOLATED_POSITION = 7


@dataclass(frozen=True)
class PdoMap:
    """One PDO: where its parameters live, its identifier without the node, and what it carries."""

    name: str
    parameter_index: int
    mapping_index: int
    identifier: int
    entries: tuple[Entry, ...]

    @property
    def layout(self) -> struct.Struct:
        """Binary layout of the payload."""
        return struct.Struct("<" + "".join(entry.format for entry in self.entries))


def receive_map(mode: int) -> PdoMap:
    """RPDO1: control word and the set point that `mode` follows (607Ah, or 60C1h:1 when interpolated)."""
    point = INTERPOLATION_DATA if mode == INTERPOLATED_POSITION else TARGET
    return PdoMap("RPDO1", 0x1400, 0x1600, 0x200, (CONTROL_WORD, point))


STATUS_MAP = PdoMap("TPDO1", 0x1800, 0x1A00, 0x180, (STATUS_WORD, POSITION, CURRENT))
MOTION_MAP = PdoMap("TPDO2", 0x1801, 0x1A01, 0x280, (DEMAND, VELOCITY))
