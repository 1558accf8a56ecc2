"""What every plate's serial protocol offers: its frame, its line settings and its commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.force_plate.framing import FrameFormat
from drivers.force_plate.sample import Reading


@dataclass(frozen=True)
class Exchange:
    """One command and the bytes that must appear in its answer (empty: no answer is waited for)."""

    send: bytes
    expect: bytes = b""
    timeout_s: float = 1.0


@dataclass(frozen=True)
class CounterFormat:
    """A device's own counter: it wraps at ``modulus`` and advances ``step`` ticks of ``tick_s`` a sample."""

    modulus: int
    step: float
    tick_s: float


class PlateProtocol(Protocol):
    """One device family's way of speaking; implementations are frozen dataclasses."""

    @property
    def name(self) -> str:
        """Name used in configuration files."""

    @property
    def baud(self) -> int:
        """Line speed [bit/s], 8N1."""

    @property
    def rate_hz(self) -> float:
        """Nominal sample rate."""

    @property
    def frame_format(self) -> FrameFormat:
        """Length, anchor and check of a frame."""

    @property
    def counter_format(self) -> CounterFormat | None:
        """The device's own counter, None where it sends none."""

    @property
    def startup(self) -> tuple[Exchange, ...]:
        """Commands that bring the device from any state to streaming."""

    @property
    def shutdown(self) -> tuple[Exchange, ...]:
        """Commands that end the stream."""

    def decode(self, frame: bytes) -> Reading:
        """Return what an intact frame says."""

    def encode(self, wrench: Sequence[float], index: int, *, is_overloaded: bool = False) -> bytes:
        """Return the frame a device would send as its ``index``-th sample.

        Args:
            wrench: force [N] and torque [N.m], six values.
            index: sample number since the device was switched on.
            is_overloaded: let the device report a channel beyond its range.
        """


def wire_time_s(protocol: PlateProtocol) -> float:
    """Return how long a frame occupies the line: ten bits a byte at 8N1."""
    return 10.0 * protocol.frame_format.length / protocol.baud


def tick_s(protocol: PlateProtocol) -> float:
    """Return the nominal length of one unit of ``PlateSample.ticks`` [s]."""
    counter = protocol.counter_format
    return counter.tick_s if counter is not None else 1.0 / protocol.rate_hz


def sample_period_s(protocol: PlateProtocol) -> float:
    """Return the nominal time between two samples [s]."""
    counter = protocol.counter_format
    return counter.step * counter.tick_s if counter is not None else 1.0 / protocol.rate_hz
