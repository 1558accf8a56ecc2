"""One time base: a device's clock mapped to the host's by the delays that no arrival can undercut.

A sample that the device took at d is read by the host at h = offset + rate d + wire time + latency, and
latency is never less than a floor. The samples that came through without waiting lie on a straight line
below all others: the lower convex hull of h - d finds it, whatever the other samples waited for.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from daq.errors import DataError
from daq.lower_hull import supporting_line

STAMP_DRIFT = 500e-6
"""Bound of the rate difference of two quartz clocks (consumer quartz: 100 ppm each, with a margin)."""

COUNTER_DRIFT = 0.02
"""Bound of the error of a nominal sample rate, for devices that count samples instead of time."""

WINDOW_S = 120.0
"""Length over which a clock's rate is taken as constant; quartz wanders some 0.1 ppm in that time."""

_SLOWEST_BEAT = 2e-6
"""Least rate difference of two crystals that is counted on (one pair in 25 is closer, at +-50 ppm)."""

_ORDER = 15
"""The how-manieth smallest residual of a third of a window bounds the line there; see `_spread`."""

_JUMP_S = 0.5
"""Device and host parting by this between two samples is a clock reset, not a delay."""

_CATCH_UP_S = 8.0
"""Time within which a host that fell behind has read its backlog."""

_LOCKED_SHARE = 0.25
"""Delays that cover less than this share of the transport's period are taken as locked to it."""


@dataclass(frozen=True)
class Transport:
    """What is known of the way from the device's last bit to the host's read.

    Attributes:
        name: for reports.
        floor_min_s: least latency of a sample that never waited, lower bound.
        floor_max_s: the same, upper bound; the middle is subtracted, the half width is uncertainty.
        period_s: period of a timer on the way; should the samples be locked to it, none passes without
            waiting, and the uncertainty must say so.
        poll_s: period at which the host collects from that timer; the two clocks beat, and until the beat
            has passed through a period once, part of it may be hidden (125 us: xHCI; 1 ms: UHCI hosts).
    """

    name: str
    floor_min_s: float = 20e-6
    floor_max_s: float = 150e-6
    period_s: float = 0.0
    poll_s: float = 0.0

    @property
    def floor_s(self) -> float:
        """The latency that is subtracted."""
        return (self.floor_min_s + self.floor_max_s) / 2

    @property
    def floor_uncertainty_s(self) -> float:
        """Half the width of what is not known of it."""
        return (self.floor_max_s - self.floor_min_s) / 2


USB_CDC = Transport("USB CDC", period_s=125e-6)
FTDI_1_MS = Transport("FTDI, latency timer 1 ms", period_s=1e-3, poll_s=125e-6)
FTDI_16_MS = Transport("FTDI, latency timer 16 ms", period_s=16e-3, poll_s=125e-6)
NATIVE_UART = Transport("native UART", floor_min_s=10e-6, floor_max_s=100e-6)


@dataclass(frozen=True)
class ClockSegment:
    """A stretch of one device clock between two resets.

    Attributes:
        first: index of its first sample.
        stop: index after its last.
        rate: host seconds per device second, over the whole stretch.
        uncertainty_s: largest uncertainty of an instant in it.
    """

    first: int
    stop: int
    rate: float
    uncertainty_s: float


@dataclass(frozen=True)
class TimeBase:
    """Sampling instants on the host's clock.

    Attributes:
        stamp_ns: (n,) int64 sampling instants.
        uncertainty_s: (n,) bound of |error| of each, by the method's own account.
        segments: stretches between clock resets.
        method: what was done, in words.
    """

    stamp_ns: np.ndarray
    uncertainty_s: np.ndarray
    segments: tuple[ClockSegment, ...]
    method: str


def map_to_host(
    ticks: np.ndarray,
    read_ns: np.ndarray,
    *,
    tick_s: float,
    wire_s: float,
    transport: Transport = USB_CDC,
    segment: np.ndarray | None = None,
    largest_drift: float = STAMP_DRIFT,
) -> TimeBase:
    """Return the host instants at which a device took its samples.

    Args:
        ticks: (n,) int64 unwrapped device stamps or sample counts.
        read_ns: (n,) int64 host monotonic instants at which the samples were read.
        tick_s: nominal length of a tick [s]; for a sample counter, the nominal sample period.
        wire_s: time that a frame occupies the line [s], subtracted.
        transport: what else lies between.
        segment: (n,) number of the device clock's stretch, where the driver saw resets.
        largest_drift: bound of the relative rate error; `COUNTER_DRIFT` for sample counters.

    Raises:
        DataError: no samples, or lengths differ.
    """
    ticks, read_ns = np.asarray(ticks, dtype=np.int64), np.asarray(read_ns, dtype=np.int64)
    if len(ticks) == 0 or len(ticks) != len(read_ns):
        raise DataError(
            f"Device stamps cannot be mapped to host time: {len(ticks)} stamps against {len(read_ns)} "
            "read instants; both streams must hold the same samples."
        )
    stamp_ns = np.empty(len(ticks), dtype=np.int64)
    uncertainty_s = np.empty(len(ticks))
    segments = []
    bounds = _segment_bounds(ticks, read_ns, tick_s, segment, largest_drift)
    for first, stop in pairwise(bounds):
        part = slice(int(first), int(stop))
        stamp_ns[part], uncertainty_s[part], rate = _map_segment(
            ticks[part], read_ns[part], tick_s, wire_s, transport, largest_drift
        )
        segments.append(ClockSegment(int(first), int(stop), rate, float(np.max(uncertainty_s[part]))))
    return TimeBase(stamp_ns, uncertainty_s, tuple(segments), _method(wire_s, transport))


def _method(wire_s: float, transport: Transport) -> str:
    return (
        "lower convex hull of host minus device time (Zhang, Liu, Xia 2002) in half-overlapping windows of "
        f"{WINDOW_S:g} s, less {wire_s * 1e6:.0f} us on the wire and {transport.floor_s * 1e6:.0f} +- "
        f"{transport.floor_uncertainty_s * 1e6:.0f} us through {transport.name}"
    )


def _segment_bounds(
    ticks: np.ndarray, read_ns: np.ndarray, tick_s: float, segment: np.ndarray | None, largest_drift: float
) -> np.ndarray:
    """Return the first indices of the stretches, and n."""
    device_steps, host_steps = np.diff(ticks) * tick_s, np.diff(read_ns) * 1e-9
    has_jumped = np.abs(host_steps - device_steps) > _JUMP_S + largest_drift * np.abs(device_steps)
    delay_s = (read_ns - read_ns[0]) * 1e-9 - (ticks - ticks[0]) * tick_s
    is_reset = device_steps < 0
    for index in np.flatnonzero(has_jumped & ~is_reset):
        is_reset[index] = _stays_apart(delay_s, read_ns, int(index))
    if segment is not None:
        is_reset |= np.diff(segment) != 0
    return np.concatenate(([0], np.flatnonzero(is_reset) + 1, [len(ticks)]))


def _stays_apart(delay_s: np.ndarray, read_ns: np.ndarray, index: int) -> bool:
    """Whether the least delays before and after a step differ for good.

    A host that slept and then reads a backlog at once falls behind and catches up: no reset.
    """
    reach_ns = round(_CATCH_UP_S * 1e9)
    low = int(np.searchsorted(read_ns, read_ns[index] - reach_ns))
    high = int(np.searchsorted(read_ns, read_ns[index + 1] + reach_ns))
    before, after = delay_s[low : index + 1].min(), delay_s[index + 1 : high + 1].min()
    return bool(abs(after - before) > _JUMP_S / 2)


def _map_segment(
    ticks: np.ndarray,
    read_ns: np.ndarray,
    tick_s: float,
    wire_s: float,
    transport: Transport,
    largest_drift: float,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return stamps, uncertainties and the clock's rate of one stretch."""
    device_s = (ticks - ticks[0]) * tick_s
    delay_s = (read_ns - read_ns[0]) * 1e-9 - device_s
    offset_s, spread_s = _blend_windows(device_s, delay_s, transport, largest_drift)
    host_s = device_s + offset_s - wire_s - transport.floor_s
    stamp_ns = read_ns[0] + np.rint(host_s * 1e9).astype(np.int64)
    span_s = device_s[-1] - device_s[0]
    rate = 1.0 + (offset_s[-1] - offset_s[0]) / span_s if span_s > 0 else 1.0
    return stamp_ns, spread_s + transport.floor_uncertainty_s, float(rate)


def _blend_windows(
    device_s: np.ndarray, delay_s: np.ndarray, transport: Transport, largest_drift: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the hull's height and its uncertainty at every sample, lines blended across windows."""
    centres = _window_centres(device_s[-1])
    offset_s, spread_s, weight = (np.zeros(len(device_s)) for _ in range(3))
    half = WINDOW_S / 2 if len(centres) > 1 else np.inf
    for centre in centres:
        low, high = np.searchsorted(device_s, (centre - half, centre + half))
        if high - low < 2 and len(centres) > 1:
            continue
        part = slice(int(low), int(high))
        line = supporting_line(device_s[part], delay_s[part], largest_drift)
        residual = delay_s[part] - line.at(device_s[part])
        share = _hat(device_s[part], centre, half)
        offset_s[part] += share * line.at(device_s[part])
        spread_s[part] += share * _spread(device_s[part], residual, transport)
        weight[part] += share
    return offset_s / weight, spread_s / weight


def _window_centres(span_s: float) -> np.ndarray:
    if span_s <= 1.5 * WINDOW_S:
        return np.array([span_s / 2])
    count = int(np.ceil(2 * span_s / WINDOW_S)) + 1
    return np.linspace(0.0, span_s, count)[1:-1]


def _hat(x: np.ndarray, centre: float, half: float) -> np.ndarray:
    """Triangular weight of a window, never quite zero so that the ends of a run are covered."""
    if not np.isfinite(half):
        return np.ones(len(x))
    return np.maximum(1.0 - np.abs(x - centre) / half, 1e-6)


def _spread(device_s: np.ndarray, residual_s: np.ndarray, transport: Transport) -> float:
    """Return a bound of the line's distance to the true floor.

    The line lies below all arrivals, as does the floor; in each third of the window a handful of arrivals
    come close to both. The `_ORDER`-th smallest residual there exceeds the smallest delay's own excess
    over the floor all but surely for delays spread evenly from the floor on, and still
    bounds it where they thin out towards it. Samples locked to a timer's phase show no such thing: their
    delays hardly differ, and the timer's whole period stays possible.
    """
    worst = 0.0
    edges = np.linspace(device_s[0], device_s[-1], 4)
    for low, high in pairwise(edges):
        part = residual_s[(device_s >= low) & (device_s <= high)]
        if len(part):
            worst = max(worst, float(np.partition(part, min(_ORDER, len(part)) - 1)[:_ORDER].max()))
    range_s, span_s = float(np.quantile(residual_s, 0.99)), float(device_s[-1] - device_s[0])
    return worst + hidden_s(range_s, span_s, transport)


def hidden_s(range_s: float, span_s: float, transport: Transport) -> float:
    """Return the waiting time that every sample may share unseen.

    Args:
        range_s: spread of the delays that were seen.
        span_s: time over which they were seen.
        transport: the timer and the poll on the way.
    """
    locked = transport.period_s - range_s if range_s < _LOCKED_SHARE * transport.period_s else 0.0
    return locked + max(transport.poll_s - _SLOWEST_BEAT * span_s, 0.0)
