"""OptoForce / OnRobot HEX six-axis sensors over their USB converter.

22 bytes: AA 07 08 10, counter u16, status u16, six int16, all big-endian, and the sum of the 20 bytes
before it as u16.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from drivers.force_plate.checksums import sum16
from drivers.force_plate.errors import PlateSettingError
from drivers.force_plate.framing import FrameFormat
from drivers.force_plate.protocols.protocol import CounterFormat, Exchange
from drivers.force_plate.sample import Reading

_HEADER = b"\xaa\x07\x08\x10"
_BODY = struct.Struct(">HH6h")
_SUM = struct.Struct(">H")
_LENGTH = len(_HEADER) + _BODY.size + _SUM.size
_CONFIGURE = b"\xaa\x00\x32\x03"
_NO_FILTER, _NO_ZERO, _STOP = 0, 0, 0
_RATE_CODES = {1000.0: 1, 333.0: 3, 100.0: 10}
"""Period in ms asked for by the configuration packet, OptoForce DAQ manual."""

STATUS_OVERLOAD = 0x03F0
"""Bits 4 to 9: Tz Ty Tx Fz Fy Fx overloaded."""
STATUS_FAULT = 0xFC00
"""Bits 10 to 15: sensor and converter errors."""
_FZ_OVERLOAD = 0x0080
_FULL_COUNT = 32767


def _with_sum(message: bytes) -> bytes:
    return message + _SUM.pack(sum16(message))


def _is_intact(frame: bytes) -> bool:
    return sum16(frame[:-2]) == _SUM.unpack_from(frame, _LENGTH - 2)[0]


@dataclass(frozen=True)
class OptoForce:
    """Protocol of an OptoForce six-axis sensor.

    Attributes:
        sensitivity: counts per N (three) and per N.m (three), from the sensor's sensitivity report.
        rate_hz: 1000, 333 or 100.
    """

    sensitivity: tuple[float, ...] = (33.74, 35.61, 9.0, 587.2, 566.37, 868.35)
    rate_hz: float = 333.0
    baud: int = 1_000_000
    name: str = "optoforce"

    def __post_init__(self) -> None:
        if self.rate_hz not in _RATE_CODES:
            raise PlateSettingError(
                f"An OptoForce sensor cannot send at {self.rate_hz} Hz; choose one of "
                f"{', '.join(str(int(rate)) for rate in _RATE_CODES)} Hz."
            )

    @cached_property
    def frame_format(self) -> FrameFormat:
        """Four header bytes and a sum: 32 + 12 effective bits."""
        return FrameFormat(_LENGTH, _HEADER, 0, _is_intact, is_strong=True)

    @property
    def counter_format(self) -> CounterFormat:
        """A 16-bit count of samples; the true period of "333 Hz" is 3 ms."""
        return CounterFormat(2**16, 1.0, _RATE_CODES[self.rate_hz] * 1e-3)

    def _configure(self, rate_code: int) -> bytes:
        return _with_sum(_CONFIGURE + bytes((rate_code, _NO_FILTER, _NO_ZERO)))

    @property
    def startup(self) -> tuple[Exchange, ...]:
        """Set the rate with filter and zeroing off: both would hide what the plate measures."""
        return (Exchange(self._configure(_RATE_CODES[self.rate_hz])),)

    @property
    def shutdown(self) -> tuple[Exchange, ...]:
        """Rate zero."""
        return (Exchange(self._configure(_STOP)),)

    def decode(self, frame: bytes) -> Reading:
        """Return the counts, counter and status of an intact frame and the wrench."""
        counter, status, *counts = _BODY.unpack_from(frame, len(_HEADER))
        wrench = tuple(count / scale for count, scale in zip(counts, self.sensitivity, strict=True))
        return Reading(
            raw=tuple(counts),
            wrench=wrench,
            counter=counter,
            status=status,
            is_overloaded=bool(status & STATUS_OVERLOAD),
            is_valid=not status & STATUS_FAULT,
        )

    def encode(self, wrench: Sequence[float], index: int, *, is_overloaded: bool = False) -> bytes:
        """Return the device's ``index``-th frame; it clips at 16 bits and says so."""
        wanted = [round(value * scale) for value, scale in zip(wrench, self.sensitivity, strict=True)]
        counts = [max(-_FULL_COUNT, min(_FULL_COUNT, count)) for count in wanted]
        clipped = [abs(count) > _FULL_COUNT for count in wanted]
        status = sum(0x0200 >> axis for axis in range(6) if clipped[axis])
        status |= _FZ_OVERLOAD if is_overloaded else 0
        return _with_sum(_HEADER + _BODY.pack(index % 2**16, status, *counts))
