"""Wacoh-Tech DynPick in continuous mode.

27 ASCII bytes: a decimal digit that counts samples modulo ten, six channels of four hexadecimal digits,
carriage return, line feed. No checksum: a flipped bit that leaves a hexadecimal digit goes unseen.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from drivers.force_plate.framing import FrameFormat
from drivers.force_plate.protocols.protocol import CounterFormat, Exchange
from drivers.force_plate.sample import Reading

_LENGTH = 27
_SYNTAX = re.compile(rb"[0-9][0-9A-Fa-f]{24}\r\n")
_ZERO = 8192
"""Count at no load, DynPick manual."""
_FULL = 16383
"""The converter has 14 bits."""


def _is_intact(frame: bytes) -> bool:
    return _SYNTAX.fullmatch(frame) is not None


@dataclass(frozen=True)
class DynPick:
    """Protocol of a DynPick.

    Attributes:
        sensitivity: counts per N (three) and per N.m (three), from the sensor's calibration sheet.
        rate_hz: rate the device was set to, at most 1 kHz.
    """

    sensitivity: tuple[float, ...] = (65.47, 65.44, 65.08, 1638.5, 1639.25, 1640.75)
    rate_hz: float = 1000.0
    baud: int = 921600
    name: str = "dynpick"

    @cached_property
    def frame_format(self) -> FrameFormat:
        """The line end is the anchor; no other part of a frame can hold it."""
        return FrameFormat(_LENGTH, b"\r\n", 25, _is_intact, is_strong=True)

    @property
    def counter_format(self) -> CounterFormat:
        """A decimal digit."""
        return CounterFormat(10, 1.0, 1.0 / self.rate_hz)

    @property
    def startup(self) -> tuple[Exchange, ...]:
        """End whatever runs, then start the continuous output."""
        return (Exchange(b"E"), Exchange(b"S"))

    @property
    def shutdown(self) -> tuple[Exchange, ...]:
        """End the continuous output."""
        return (Exchange(b"E"),)

    def decode(self, frame: bytes) -> Reading:
        """Return the counts of an intact frame and their wrench."""
        counts = tuple(int(frame[at : at + 4], 16) for at in range(1, 25, 4))
        wrench = tuple(
            (count - _ZERO) / scale for count, scale in zip(counts, self.sensitivity, strict=True)
        )
        return Reading(
            raw=counts,
            wrench=wrench,
            counter=frame[0] - ord("0"),
            is_overloaded=any(count <= 0 or count >= _FULL for count in counts),
        )

    def encode(self, wrench: Sequence[float], index: int, *, is_overloaded: bool = False) -> bytes:
        """Return the device's ``index``-th frame; it clips at the ends of its 14 bits."""
        counts = [
            max(0, min(_FULL, _ZERO + round(value * scale)))
            for value, scale in zip(wrench, self.sensitivity, strict=True)
        ]
        if is_overloaded:
            counts[2] = _FULL
        return b"%d%04X%04X%04X%04X%04X%04X\r\n" % (index % 10, *counts)
