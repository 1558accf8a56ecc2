"""How good one stream is: its rate, its losses, its clock and its channels."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from daq.checks import interval_ns, unwrapped
from daq.recording import Stream

_REGULAR = 0.2  # of an interval: stamps that scatter less are on a clock
OUTAGE_S = 1.0
STUCK_S = 0.5  # a measured channel that does not change by one bit for so long is not measuring
_STUCK_SAMPLES = 25
_DRIFT_LIMIT_PPM = 5000.0  # beyond, two rates are different rates and not drifting clocks


@dataclass(frozen=True)
class Gap:
    """A stretch without samples."""

    row: int
    start_s: float
    length_s: float
    missing: int


@dataclass(frozen=True)
class StreamQuality:
    """One stream's sampling and channels.

    Attributes:
        topic: which stream.
        samples: how many.
        duration_s: first to last stamp.
        rate_hz: by its own clock fit.
        lost: samples that the log lacks, by the device's count and by the stamps.
        holes: those of them that the device's own count proves.
        in_outages: those of them lost in gaps longer than a second.
        gaps: the longest stretches without samples, longest first, at most five.
        gap_count: how many there are.
        jitter_std_s: scatter of the stamps about a uniform clock.
        jitter_max_s: largest deviation from it.
        drift_ppm: how much faster the stream's clock runs than the joint states', None for the latter.
        phase_s: its sampling instants behind those of the joint states, None for the latter.
        saturated: channels whose extreme value is a flat top.
        frozen: channels that never change.
        stuck: channels that stand still to the last bit for a while.
        bad_rows: samples with NaN, infinite or absurd numbers.
    """

    topic: str
    samples: int
    duration_s: float
    rate_hz: float
    lost: int
    holes: int
    in_outages: int
    gaps: tuple[Gap, ...]
    gap_count: int
    jitter_std_s: float
    jitter_max_s: float
    drift_ppm: float | None
    phase_s: float | None
    saturated: tuple[str, ...]
    frozen: tuple[str, ...]
    stuck: tuple[str, ...]
    bad_rows: int

    @property
    def loss_share(self) -> float:
        """Samples lost here and there over all that should be there; whole outages are another matter."""
        scattered = self.lost - self.in_outages
        return scattered / max(1, self.samples + scattered)


@dataclass(frozen=True)
class ClockFit:
    """Stamps as a line over sample numbers."""

    start_ns: float
    interval_ns: float
    residual_s: np.ndarray


def sample_numbers(stream: Stream, counted: bool) -> np.ndarray:
    """(n,) which sample of the device each one is.

    The device's own count is the proof of a loss; where the stamps are regular, a hole in them counts too,
    since many loggers number only what arrived.
    """
    steps = np.diff(stream.stamp_ns) / max(interval_ns(stream), 1.0)
    whole = np.maximum(np.round(steps), 1)
    regular = np.median(np.abs(steps - whole)) < _REGULAR
    by_count = np.diff(unwrapped(stream.sequence)) if counted else np.ones(len(steps), np.int64)
    counted_numbers = np.concatenate([[0], np.cumsum(np.maximum(by_count, 1))]).astype(np.int64)
    if not regular:
        return counted_numbers
    reckoned = np.concatenate([[0], np.cumsum(np.maximum(by_count, whole))]).astype(np.int64)
    # a late stamp that the next ones catch up with is no loss: then the plain count fits the clock better
    offset = (stream.stamp_ns - stream.stamp_ns[0]).astype(float)
    return min((counted_numbers, reckoned), key=lambda numbers: float(np.std(_line(numbers, offset)[2])))


def fit_clock(stream: Stream, counted: bool) -> ClockFit:
    """Regression of the stamps on the sample numbers."""
    offset = (stream.stamp_ns - stream.stamp_ns[0]).astype(float)
    start, slope, residual = _line(sample_numbers(stream, counted), offset)
    return ClockFit(start, slope, residual * 1e-9)


def _line(number: np.ndarray, offset: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Start, slope and residual of the least-squares line of offset over number."""
    x = number - number.mean()
    spread = float((x**2).sum())
    slope = float((x * (offset - offset.mean())).sum()) / spread if spread else 0.0
    start = float(offset.mean() - slope * number.mean())
    return start, slope, offset - start - slope * number


def stream_quality(
    stream: Stream, counted: bool, reference: Stream | None = None, reference_counted: bool = True
) -> StreamQuality:
    """Judge one stream, its clock against that of ``reference`` where given."""
    clock = fit_clock(stream, counted)
    gaps = _gaps(stream, sample_numbers(stream, counted))
    channels = _channels(stream)
    measured = {name: column for name, column in channels.items() if not name.startswith("position")}
    drift, phase = None, None
    if reference is not None:
        drift, phase = _against(stream, clock, reference, reference_counted)
    stuck = max(_STUCK_SAMPLES, STUCK_S * 1e9 / max(clock.interval_ns, 1.0))
    frozen = tuple(name for name, column in measured.items() if np.ptp(column) == 0)
    table = np.column_stack(list(channels.values()))
    with np.errstate(invalid="ignore"):
        bad = int((~(np.abs(table) < 1e100)).any(axis=1).sum())
    return StreamQuality(
        topic=stream.topic,
        samples=len(stream),
        duration_s=float(stream.stamp_ns[-1] - stream.stamp_ns[0]) * 1e-9,
        rate_hz=1e9 / clock.interval_ns if clock.interval_ns else 0.0,
        lost=sum(gap.missing for gap in gaps),
        holes=sum(max(0, int(step) - 1) for step in np.diff(unwrapped(stream.sequence))) if counted else 0,
        in_outages=sum(gap.missing for gap in gaps if gap.length_s > OUTAGE_S),
        gaps=tuple(gaps[:5]),
        gap_count=len(gaps),
        jitter_std_s=float(clock.residual_s.std()),
        jitter_max_s=float(np.abs(clock.residual_s).max()),
        drift_ppm=drift,
        phase_s=phase,
        saturated=tuple(name for name, column in measured.items() if is_saturated(column)),
        frozen=frozen,
        stuck=tuple(name for name, column in measured.items()
                    if name not in frozen and longest_run(column) >= stuck),
        bad_rows=bad,
    )


def _gaps(stream: Stream, numbers: np.ndarray) -> list[Gap]:
    """The stretches without samples, longest first."""
    steps, missing = np.diff(stream.stamp_ns), np.diff(numbers) - 1
    found = [
        Gap(int(row) + 1, float(stream.stamp_ns[row] - stream.stamp_ns[0]) * 1e-9, float(steps[row]) * 1e-9,
            int(missing[row]))
        for row in np.flatnonzero(missing > 0)
    ]
    return sorted(found, key=lambda gap: -gap.length_s)


def _channels(stream: Stream) -> dict[str, np.ndarray]:
    """Every column by name: ``current joint_1``, ``force x``."""
    names = stream.names or ("x", "y", "z")
    return {f"{key} {name}": column for key, values in stream.data.items()
            for name, column in zip(names, values.T, strict=True)}


def _against(
    stream: Stream, clock: ClockFit, reference: Stream, counted: bool
) -> tuple[float | None, float | None]:
    """Clock drift [ppm] beyond the nearest simple ratio of the rates, phase [s] at the start."""
    base = fit_clock(reference, counted)
    if not base.interval_ns or not clock.interval_ns:
        return None, None
    ratio = base.interval_ns / clock.interval_ns
    simple = Fraction(ratio).limit_denominator(20)
    drift = (ratio / float(simple) - 1) * 1e6 if simple else np.inf
    lag = stream.stamp_ns[0] + clock.start_ns - (reference.stamp_ns[0] + base.start_ns)
    phase = (lag + base.interval_ns / 2) % base.interval_ns - base.interval_ns / 2
    return (float(drift) if abs(drift) < _DRIFT_LIMIT_PPM else None), float(phase) * 1e-9


def longest_run(column: np.ndarray) -> int:
    """Length of the longest stretch of identical values."""
    edges = np.flatnonzero(np.concatenate([[True], np.diff(column) != 0, [True]]))
    return int(np.diff(edges).max())


def is_saturated(column: np.ndarray) -> bool:
    """Whether the largest or smallest value is a flat top rather than a peak.

    A peak's levels thin out towards its tip; a clipped signal piles up on its last one.
    """
    return any(_flat_top(side) for side in (column, -column))


def _flat_top(column: np.ndarray) -> bool:
    finite = column[np.isfinite(column)]
    if len(finite) < 20 or np.ptp(finite) == 0:
        return False
    levels, counts = np.unique(finite, return_counts=True)
    at_top = column == levels[-1]
    below = counts[-11:-1].mean()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at_top.astype(int), [0]])))
    run = int((edges[1::2] - edges[::2]).max())
    return bool(counts[-1] >= 5 and run >= 3 and counts[-1] > 5 * below)
