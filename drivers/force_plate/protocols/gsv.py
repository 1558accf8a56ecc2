"""ME-Systeme GSV-6 and GSV-8 amplifiers with eight float channels, behind a Kistler plate.

36 bytes: AA, 17 (a measured-value frame on the serial interface, low digit: channels - 1), status, eight
float32 big-endian, 85. No checksum and no counter: a flipped bit inside a float goes unseen unless it
makes the value impossible, and losses show only in the host's time.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from drivers.force_plate.framing import FrameFormat
from drivers.force_plate.kistler import KistlerGeometry
from drivers.force_plate.protocols.protocol import Exchange
from drivers.force_plate.sample import Reading

_HEADER = b"\xaa\x17"
_TRAILER = 0x85
_VALUES = struct.Struct(">8f")
_LENGTH = 36
_STOP = bytes.fromhex("aa902385")
_START = bytes.fromhex("aa902485")
_DONE = bytes.fromhex("aa500085")
"""Commands 0x23 stop and 0x24 start transmission and the error-free answer, GSVcom manual."""
_IMPOSSIBLE = 1.2
"""A channel beyond this multiple of its full scale is no measurement."""


@dataclass(frozen=True)
class Gsv8:
    """Protocol of an eight-channel GSV amplifier on a Kistler plate.

    Attributes:
        newton_per_unit: N per unit of the amplifier's output, eight channels.
        full_scale_n: range of the channels, eight values [N]; at it a channel counts as overloaded.
        geometry: pillars of the plate.
        rate_hz: data rate the amplifier was set to.
    """

    newton_per_unit: tuple[float, ...] = (1.0,) * 8
    full_scale_n: tuple[float, ...] = (10_000.0,) * 4 + (20_000.0,) * 4
    geometry: KistlerGeometry = field(default_factory=KistlerGeometry)
    rate_hz: float = 150.0
    baud: int = 230400
    name: str = "gsv8"
    counter_format: None = None

    @cached_property
    def frame_format(self) -> FrameFormat:
        """Two header bytes, a trailer byte and eight possible values."""
        return FrameFormat(_LENGTH, _HEADER, 0, self._is_intact, is_strong=False)

    def _is_intact(self, frame: bytes) -> bool:
        if frame[-1] != _TRAILER:
            return False
        return all(
            math.isfinite(force) and abs(force) <= _IMPOSSIBLE * full
            for force, full in zip(self._channels(frame), self.full_scale_n, strict=True)
        )

    def _channels(self, frame: bytes) -> tuple[float, ...]:
        values = _VALUES.unpack_from(frame, 3)
        return tuple(value * scale for value, scale in zip(values, self.newton_per_unit, strict=True))

    @property
    def startup(self) -> tuple[Exchange, ...]:
        """Stop, then start the transmission."""
        return (Exchange(_STOP, _DONE), Exchange(_START, _DONE))

    @property
    def shutdown(self) -> tuple[Exchange, ...]:
        """Stop the transmission."""
        return (Exchange(_STOP, _DONE),)

    def decode(self, frame: bytes) -> Reading:
        """Return the eight floats of an intact frame and their wrench about the top plate."""
        channels = self._channels(frame)
        pairs = zip(channels, self.full_scale_n, strict=True)
        return Reading(
            raw=_VALUES.unpack_from(frame, 3),
            wrench=self.geometry.wrench(channels),
            status=frame[2],
            is_overloaded=any(abs(force) >= full for force, full in pairs),
        )

    def encode(self, wrench: Sequence[float], index: int, *, is_overloaded: bool = False) -> bytes:
        """Return a frame whose channels make up ``wrench``; they clip at full scale."""
        forces = list(self.geometry.channels(wrench))
        if is_overloaded:
            forces[4] = self.full_scale_n[4]
        clipped = [max(-full, min(full, n)) for n, full in zip(forces, self.full_scale_n, strict=True)]
        values = [n / scale for n, scale in zip(clipped, self.newton_per_unit, strict=True)]
        return _HEADER + b"\x00" + _VALUES.pack(*values) + bytes((_TRAILER,))
