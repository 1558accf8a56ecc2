"""What a run needs of drives, plate and clock; real hardware and fakes look alike from here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Clock(Protocol):
    """The host's time."""

    def now_ns(self) -> int:
        """Monotonic time, on which everything is stamped [ns]."""
        ...

    def wall_ns(self) -> int:
        """Time of day, which may be stepped at any moment [ns since 1970]."""
        ...


class AxisUnits(Protocol):
    """Factors from a drive's counts to SI units at the joint; what an axis of a boot report carries."""

    rad_per_count: float
    rad_s_per_unit: float
    ampere_per_unit: float


class BootedAxis(Protocol):
    """One drive as found and configured."""

    name: str
    units: AxisUnits
    position: int


class BootReport(Protocol):
    """All drives, and the SYNC period they agreed on [ns]."""

    axes: Sequence[BootedAxis]
    period_ns: int


class CycleSample(Protocol):
    """What one cycle brought, in axis order; None where a frame is missing."""

    cycle: int
    sync: int
    sync_ns: int
    status_word: Sequence[int | None]
    position: Sequence[int | None]
    current: Sequence[int | None]
    demand: Sequence[int | None]
    velocity: Sequence[int | None]
    stamp_ns: Sequence[int | None]
    flags: Sequence[int]
    target: Sequence[int]
    late_sync: bool


class Entry(Protocol):
    """One axis in one cycle that lacks something."""

    cycle: int
    axis: str


class Cause(Protocol):
    """Why the drives stopped."""

    sentence: str


class DriveReport(Protocol):
    """How the drives' session went."""

    outcome: str
    cycles: int
    missing: Sequence[Entry]
    torn: Sequence[Entry]
    irregular: Sequence[Entry]
    late_syncs: Sequence[int]
    causes: Sequence[Cause]
    unconfirmed: Sequence[str]
    tail: Sequence[CycleSample]
    restore_failures: Sequence[str]


class Drives(Protocol):
    """All drives of the robot."""

    names: tuple[str, ...]

    def boot(self) -> BootReport:
        """Find, identify and configure every drive; nothing moves."""
        ...

    def enable(self) -> CycleSample:
        """Lead every power stage to operation while holding position."""
        ...

    def cycle(self, targets_rad: Sequence[float]) -> CycleSample:
        """Send set points, return what was sampled at the SYNC before them."""
        ...

    def stop(self, reason: str | None = None) -> DriveReport:
        """End the motion: as planned, or by the stop ladder where there is a reason."""
        ...

    def halt(self) -> None:
        """Stop at once, without waiting for any confirmation."""
        ...

    def close(self) -> DriveReport:
        """Put every changed setting back and release the bus."""
        ...

    def report(self) -> DriveReport:
        """The session so far."""
        ...


class PlateSample(Protocol):
    """One sample of the plate as it came."""

    raw: Sequence[float]
    wrench: Sequence[float]
    counter: int | None
    ticks: int
    segment: int
    lost: int
    status: int
    is_overloaded: bool
    is_valid: bool
    temperature_c: float | None
    read_ns: int


@dataclass(frozen=True)
class PlateStream:
    """The plate's samples on the host's monotonic clock.

    Attributes:
        stamp_ns: (n,) sampling instants.
        uncertainty_s: (n,) bound of their error.
        sequence: (n,) sample numbers as the device counted; a hole is a lost sample.
        wrench: (n, 6) what the plate exerts on the robot [N, N.m].
        lost: samples missing between the first and the last.
        method: how the instants were found.
    """

    stamp_ns: np.ndarray
    uncertainty_s: np.ndarray
    sequence: np.ndarray
    wrench: np.ndarray
    lost: int
    method: str


@dataclass(frozen=True)
class PlateRest:
    """Mean and scatter of the plate while nothing moves, six channels each [N, N.m]."""

    mean: tuple[float, ...]
    std: tuple[float, ...]
    count: int


class Plate(Protocol):
    """The force plate."""

    def start(self) -> Sequence[str]:
        """Bring it to streaming; return warnings for the user."""
        ...

    def rest(self) -> PlateRest:
        """Average it while nothing moves."""
        ...

    def poll(self) -> Sequence[PlateSample]:
        """The samples that arrived since the last call, at once."""
        ...

    def stream(self, samples: Sequence[PlateSample]) -> PlateStream:
        """Put samples on the host's clock."""
        ...

    def live(self, sample: PlateSample) -> tuple[int, float]:
        """Instant [ns] and uncertainty [s] of a sample as known when it arrived."""
        ...

    def drift(self, before: PlateRest, after: PlateRest) -> str:
        """What moved between two rests, in words; empty where nothing did."""
        ...

    def facts(self) -> Mapping[str, str]:
        """What the log must say of it, so that its raw samples can be understood later."""
        ...

    def stop(self) -> None:
        """End the stream and release the port; never fails."""
        ...
