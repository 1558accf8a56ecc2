"""Does a motion repeat itself? Found from the joint positions at their own instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from daq.recording import Stream

MOVES_RAD = 1e-3  # a joint that stays within this is standing (encoder noise is some 1e-5 rad)
TOLERANCE = 0.01  # of a joint's motion: what a controlled axis repeats to, with room
WINDOWS = 20  # a period is judged in this many parts
_GRID = 1 << 15  # points of the coarse search
_CANDIDATES = 40
_HOPEFUL = 0.2  # of the variance: a mismatch below may become a repetition once ramps are set aside


@dataclass(frozen=True)
class Period:
    """A repetition of the joint positions.

    Attributes:
        period_s: its length.
        repeating: joints that repeat with it.
        other: moving joints that do not.
        standing: joints that do not move.
        start_s: where the repeating stretch begins, from the stream's first stamp.
        length_s: how long it lasts.
        periods: whole periods in it.
        repeatability: joint to the rms of a single period's deviation, in rad or m.
    """

    period_s: float
    repeating: tuple[str, ...]
    other: tuple[str, ...]
    standing: tuple[str, ...]
    start_s: float
    length_s: float
    periods: int
    repeatability: dict[str, float]

    @property
    def common(self) -> bool:
        """Whether every moving joint shares it: only then is it the period of the motion."""
        return bool(self.repeating) and not self.other


@dataclass(frozen=True)
class _Fit:
    """How well every moving joint repeats after one lag."""

    period_s: float
    repeats: np.ndarray  # (k,) bool
    start_s: float
    length_s: float
    rms: np.ndarray  # (k,)


def moving_joints(stream: Stream) -> np.ndarray:
    """(k,) bool: which joints move; a few outliers do not count."""
    low, high = np.percentile(stream.data["position"], [1, 99], axis=0)
    return (high - low) > MOVES_RAD


def find_period(stream: Stream, hint_hz: float | None = None) -> Period | None:
    """The shortest time after which all moving joints repeat, or, failing that, as many as possible.

    Args:
        stream: joint states with finite positions and increasing stamps.
        hint_hz: a fundamental frequency that somebody claims; it is tried and trusted no more than others.

    Returns:
        The repetition, whose ``common`` says whether it is a period of the whole motion; None where no
        joint repeats.
    """
    moves = moving_joints(stream)
    if not moves.any() or len(stream) < 50:
        return None
    t = (stream.stamp_ns - stream.stamp_ns[0]) * 1e-9
    q = stream.data["position"][:, moves]
    candidates = _candidates(t, q)
    if hint_hz:
        candidates.append((1.0 / hint_hz, np.ones(q.shape[1], bool)))
        candidates.sort(key=lambda item: item[0])
    best: _Fit | None = None
    for lag, hopeful in candidates:
        if lag > 0.8 * t[-1]:
            continue
        fit = _judge(t, q, _refine(t, q[:, hopeful], lag))
        if fit.repeats.any() and (best is None or fit.repeats.sum() > best.repeats.sum()):
            best = fit
        if best is not None and best.repeats.all():
            break
    return None if best is None else _describe(stream, moves, best, t)


def lag_difference(t: np.ndarray, values: np.ndarray, lag_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a lagged partner exists: (m,) times [s] and (m, k) values one lag later minus now."""
    inside = t + lag_s <= t[-1] + 0.5 * (t[-1] - t[0]) / len(t)
    later = np.column_stack([np.interp(t[inside] + lag_s, t, column) for column in values.T])
    return t[inside], later - values[inside]


def _candidates(t: np.ndarray, q: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Lags [s] at which the mismatch of a joint, or of all together, is low, and (k,) for which joints it is.

    Only those joints then fix the lag: one that does not repeat would pull it anywhere.
    """
    count = min(_GRID, max(1024, 2 * len(t)))
    grid = np.linspace(t[0], t[-1], count)
    even = np.column_stack([np.interp(grid, t, column) for column in q.T])
    misfit = np.column_stack([_mismatch(column) for column in even.T])
    found: dict[int, float] = {}
    for column in (misfit.mean(axis=1), *misfit.T):
        far = np.argmax(column > 0.5) or len(column)  # behind the trivial repetition at no lag
        lower = (column[1:-1] <= column[:-2]) & (column[1:-1] <= column[2:]) & (column[1:-1] < _HOPEFUL)
        for i in np.flatnonzero(lower) + 1:
            if i > far:
                found[int(i)] = min(found.get(int(i), 1.0), float(column[i]))
    best = sorted(sorted(found, key=found.__getitem__)[:_CANDIDATES])
    step = float(grid[1] - grid[0])
    return [(i * step, misfit[i] <= max(_HOPEFUL, misfit[i].min())) for i in best]


def _mismatch(column: np.ndarray) -> np.ndarray:
    """Mean squared difference to itself at every lag up to 0.8 of the length, over twice the variance."""
    x = column - column.mean()
    n = len(x)
    spectrum = np.fft.rfft(x, 2 * n)
    products = np.fft.irfft(np.abs(spectrum) ** 2)[:n]
    squares = np.concatenate([[0.0], np.cumsum(x**2)])
    lags = np.arange(int(0.8 * n))
    total = squares[n - lags] + squares[n] - squares[lags] - 2 * products[: len(lags)]
    return total / (n - lags) / (2 * x.var() + 1e-300)


def _refine(t: np.ndarray, q: np.ndarray, lag_s: float) -> float:
    """Newton steps on the lag: a small lag error shows as velocity times that error.

    The median over parts of the record keeps ramps at its ends from pulling.
    """
    scale = q.std(axis=0) + 1e-300
    velocity = np.column_stack([np.gradient(column, t) for column in (q / scale).T])
    for _ in range(4):
        instants, miss = lag_difference(t, q / scale, lag_s)
        if len(instants) < WINDOWS:
            return lag_s
        parts = np.array_split(np.arange(len(instants)), WINDOWS)
        power = [(velocity[part] ** 2).sum() for part in parts]
        steps = [(velocity[part] * miss[part]).sum() / max(p, 1e-300)
                 for part, p in zip(parts, power, strict=True)]
        lively = [step for step, p in zip(steps, power, strict=True) if p > 0.1 * np.median(power)]
        step = float(np.clip(np.median(lively), -0.02 * lag_s, 0.02 * lag_s))
        lag_s -= step
        if abs(step) < 1e-9:
            break
    return lag_s


def _judge(t: np.ndarray, q: np.ndarray, lag_s: float) -> _Fit:
    """Which joints repeat after a lag, and over which stretch they do so together."""
    instants, miss = lag_difference(t, q, lag_s)
    k = q.shape[1]
    if len(instants) < WINDOWS:
        return _Fit(lag_s, np.zeros(k, bool), 0.0, 0.0, np.zeros(k))
    width = lag_s / WINDOWS
    part = np.floor(instants / width).astype(int)
    counts = np.maximum(np.bincount(part), 1)
    mean_square = np.column_stack([np.bincount(part, column**2) / counts for column in miss.T])
    fine = np.sqrt(mean_square) < TOLERANCE * q.std(axis=0)
    spans = [_longest(column) for column in fine.T]
    # a stretch shorter than most of what could be compared, and than half a period, is chance
    needed = min(WINDOWS / 2, 0.8 * len(fine))
    repeats = np.array([stop - start >= needed for start, stop in spans])
    together = fine[:, repeats].all(axis=1) if repeats.any() else np.zeros(len(fine), bool)
    start, stop = _longest(together)
    rms = np.sqrt(mean_square[start:stop].mean(axis=0) / 2) if stop > start else np.zeros(k)
    length = float(min((stop - start) * width, instants[-1] - start * width)) + lag_s
    return _Fit(lag_s, repeats & (stop - start >= needed), start * width, length, rms)


def _longest(good: np.ndarray) -> tuple[int, int]:
    """Start and stop of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]])))
    if not len(edges):
        return 0, 0
    starts, stops = edges[::2], edges[1::2]
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best])


def _describe(stream: Stream, moves: np.ndarray, fit: _Fit, t: np.ndarray) -> Period:
    moving = [name for name, moved in zip(stream.names, moves, strict=True) if moved]
    slack = 1.5 * (t[-1] - t[0]) / len(t)  # the last sample of a period is one interval before its end
    pairs = list(zip(moving, fit.repeats, fit.rms, strict=True))
    return Period(
        period_s=fit.period_s,
        repeating=tuple(name for name, ok, _ in pairs if ok),
        other=tuple(name for name, ok, _ in pairs if not ok),
        standing=tuple(name for name, moved in zip(stream.names, moves, strict=True) if not moved),
        start_s=fit.start_s,
        length_s=fit.length_s,
        periods=int((fit.length_s + slack) / fit.period_s),
        repeatability={name: float(rms) for name, ok, rms in pairs if ok},
    )
