"""Bota Systems serial sensors (BFT-SENS, BFT-MEDS, BFT-LAXS): the reference plate.

37 bytes: AA, then 34 bytes little-endian (status u16, six float32, stamp u32 in us, temperature float32),
then CRC-16/X-25 of the 34 bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from drivers.force_plate.checksums import crc16_x25
from drivers.force_plate.framing import FrameFormat
from drivers.force_plate.protocols.protocol import CounterFormat, Exchange
from drivers.force_plate.sample import Reading

_BODY = struct.Struct("<H6fIf")
_CRC = struct.Struct("<H")
_LENGTH = 1 + _BODY.size + _CRC.size
_HEADER = b"\xaa"

SINC_TICK_S = 19.53125e-6
"""Sampling period per unit of the SINC filter length (51.2 kHz modulator), Bota serial manual."""

STATUS_TOO_LATE = 0x1
STATUS_OVERRANGE = 0x2
STATUS_INVALID = 0x4
STATUS_UNCALIBRATED = 0x8
_BOOT_S = 3.0
"""Longest time that the sensor takes from power-on to its first answer."""

_BAUD_CODES = {9600: 0, 57600: 1, 115200: 2, 230400: 3, 460800: 4}


def _is_intact(frame: bytes) -> bool:
    return crc16_x25(frame[1:-2]) == _CRC.unpack_from(frame, _LENGTH - 2)[0]


@dataclass(frozen=True)
class Bota:
    """Protocol of a Bota serial sensor.

    Attributes:
        sinc_length: length of the SINC filter; 341 gives 150.15 Hz.
        baud: line speed [bit/s].
        temperature_c: what the encoder reports as the board's temperature.
    """

    sinc_length: int = 341
    baud: int = 460800
    temperature_c: float = 31.5
    name: str = "bota"

    @property
    def rate_hz(self) -> float:
        """Nominal sample rate, set by the SINC filter."""
        return 1.0 / (SINC_TICK_S * self.sinc_length)

    @cached_property
    def frame_format(self) -> FrameFormat:
        """Header byte and CRC-16/X-25."""
        return FrameFormat(_LENGTH, _HEADER, 0, _is_intact, is_strong=True)

    @property
    def counter_format(self) -> CounterFormat:
        """A stamp in microseconds, 32 bits wide."""
        return CounterFormat(2**32, self.sinc_length * SINC_TICK_S * 1e6, 1e-6)

    @property
    def startup(self) -> tuple[Exchange, ...]:
        """Configuration mode, calibrated binary output, filter, then run mode."""
        return (
            Exchange(b"C", b"r,0,C,0", timeout_s=_BOOT_S),
            Exchange(b"c,0,1,0,%d" % _BAUD_CODES[self.baud], b"r,0,c,0"),
            Exchange(b"f,%d,0,0,1" % self.sinc_length, b"r,0,f,0"),
            Exchange(b"R", b"r,0,R,0"),
        )

    @property
    def shutdown(self) -> tuple[Exchange, ...]:
        """Configuration mode is silent."""
        return (Exchange(b"C", b"r,0,C,0"),)

    def decode(self, frame: bytes) -> Reading:
        """Return the floats, stamp, status and temperature of an intact frame."""
        status, *values, stamp_us, temperature_c = _BODY.unpack_from(frame, 1)
        wrench = tuple(values)
        return Reading(
            raw=wrench,
            wrench=wrench,
            counter=stamp_us,
            status=status,
            is_overloaded=bool(status & STATUS_OVERRANGE),
            is_valid=not status & (STATUS_INVALID | STATUS_UNCALIBRATED),
            temperature_c=temperature_c,
        )

    def encode(self, wrench: Sequence[float], index: int, *, is_overloaded: bool = False) -> bytes:
        """Return the device's ``index``-th frame."""
        stamp_us = round(index * self.sinc_length * SINC_TICK_S * 1e6) % 2**32
        status = STATUS_OVERRANGE if is_overloaded else 0
        body = _BODY.pack(status, *wrench, stamp_us, self.temperature_c)
        return _HEADER + body + _CRC.pack(crc16_x25(body))
