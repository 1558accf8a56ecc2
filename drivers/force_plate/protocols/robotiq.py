"""Robotiq FT 300 in data stream mode.

16 bytes: 20 4E, six int16 little-endian (N/100, then N.m/1000), CRC-16/Modbus of the 14 bytes before it.
No counter: losses show only in the host's time.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from drivers.force_plate.checksums import crc16_modbus
from drivers.force_plate.framing import FrameFormat
from drivers.force_plate.protocols.protocol import Exchange
from drivers.force_plate.sample import Reading

_HEADER = b"\x20\x4e"
_COUNTS = struct.Struct("<6h")
_CRC = struct.Struct("<H")
_LENGTH = 16
_SCALE = (100.0, 100.0, 100.0, 1000.0, 1000.0, 1000.0)
_FULL_COUNT = 32767
_STOP = b"\xff" * 50
"""Some fifty bytes FF end the stream, FT 300 manual, section data stream."""

_STREAM_ON = bytes.fromhex("0910019a0001020200")
_STREAM_ON_ANSWER = bytes.fromhex("0910019a0001")
"""Modbus: slave 9 writes 0x0200 to register 410, FT 300 manual."""


def _with_crc(message: bytes) -> bytes:
    return message + _CRC.pack(crc16_modbus(message))


def _is_intact(frame: bytes) -> bool:
    return crc16_modbus(frame[:-2]) == _CRC.unpack_from(frame, 14)[0]


@dataclass(frozen=True)
class RobotiqFt300:
    """Protocol of a Robotiq FT 300."""

    baud: int = 19200
    rate_hz: float = 100.0
    name: str = "robotiq_ft300"
    counter_format: None = None

    @cached_property
    def frame_format(self) -> FrameFormat:
        """Two header bytes and CRC-16/Modbus."""
        return FrameFormat(_LENGTH, _HEADER, 0, _is_intact, is_strong=True)

    @property
    def startup(self) -> tuple[Exchange, ...]:
        """Leave stream mode, then enter it."""
        return (Exchange(_STOP), Exchange(_with_crc(_STREAM_ON), _with_crc(_STREAM_ON_ANSWER)))

    @property
    def shutdown(self) -> tuple[Exchange, ...]:
        """Leave stream mode."""
        return (Exchange(_STOP),)

    def decode(self, frame: bytes) -> Reading:
        """Return the counts of an intact frame and their wrench."""
        counts = _COUNTS.unpack_from(frame, 2)
        wrench = tuple(count / scale for count, scale in zip(counts, _SCALE, strict=True))
        return Reading(counts, wrench, is_overloaded=any(abs(count) >= _FULL_COUNT for count in counts))

    def encode(self, wrench: Sequence[float], index: int, *, is_overloaded: bool = False) -> bytes:
        """Return a frame; the device clips at +-327.67 N and +-32.767 N.m."""
        counts = [
            max(-_FULL_COUNT, min(_FULL_COUNT, round(value * scale)))
            for value, scale in zip(wrench, _SCALE, strict=True)
        ]
        if is_overloaded:
            counts[2] = _FULL_COUNT
        return _with_crc(_HEADER + _COUNTS.pack(*counts))
