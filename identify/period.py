"""Find the periodic part of a recording, and refuse a period that is not there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.dataset import Dataset, Signal
from identify.errors import NotPeriodicError
from identify.rotations import FloatArray

# a joint whose whole travel is below this does not move [rad or m]: encoders resolve 1e-5 and better
_STILL = 2e-4
# steady periods of a controlled arm repeat to a few encoder counts; beyond this share of the travel they do not
_REPEATABILITY = 0.01


@dataclass(frozen=True)
class PeriodWindow:
    """The steady periodic part of a run.

    Attributes:
        period_s: duration of one period [s].
        start_s: beginning of the first period used [s].
        periods: whole periods used.
        inferred: True where the period was found in the data rather than stated in the log.
    """

    period_s: float
    start_s: float
    periods: int
    inferred: bool

    @property
    def stop_s(self) -> float:
        """End of the last period used [s]."""
        return self.start_s + self.periods * self.period_s

    def bins_of(self, t_s: FloatArray, bins: int) -> tuple[FloatArray, FloatArray]:
        """Sort instants into bins of the period, each bin centred on the samples' common phase.

        Args:
            t_s: instants [s], shape (N,).
            bins: number of bins a period.

        Returns:
            Period and bin of every instant, each shape (N,).
        """
        phase = (t_s - self.start_s) / self.period_s * bins
        shift = np.angle(np.mean(np.exp(2j * np.pi * phase))) / (2.0 * np.pi)
        period, place = np.divmod(np.round(phase - shift).astype(int), bins)
        return period, place

    @property
    def fundamental_hz(self) -> float:
        """Fundamental frequency [Hz]."""
        return 1.0 / self.period_s


def travel(position: Signal) -> FloatArray:
    """Peak-to-peak travel of every joint, shape (n,)."""
    return np.ptp(position.values, axis=1)


def moving_joints(position: Signal) -> FloatArray:
    """Indices of the joints that move."""
    return np.flatnonzero(travel(position) > _STILL)


def _difference(position: Signal, period_s: float, step_s: float) -> tuple[FloatArray, FloatArray]:
    """|q(t + T) - q(t)| over the travel, on a grid: instants (K,), differences (joints, K)."""
    t0, t1 = position.t_s[0], position.t_s[-1]
    grid = np.arange(t0, t1 - period_s, step_s)
    joints = moving_joints(position)
    scale = travel(position)[joints]
    values = [
        np.abs(np.interp(grid + period_s, position.t_s, position.values[j]) - np.interp(grid, position.t_s, position.values[j]))
        for j in joints
    ]
    return grid, np.array(values).reshape(len(joints), len(grid)) / scale[:, None]


def _steady_stretch(position: Signal, period_s: float) -> tuple[float, float]:
    """Longest stretch [start, stop) over which the motion repeats after one period."""
    step = max(period_s / 400.0, 0.5 / position.rate_hz)
    grid, difference = _difference(position, period_s, step)
    if grid.size == 0:
        return 0.0, 0.0
    repeats = (difference < _REPEATABILITY).all(axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], repeats.astype(int), [0]])))
    if edges.size == 0:
        return 0.0, 0.0
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    return float(grid[starts[longest]]), float(grid[stops[longest] - 1] + step + period_s)


def repeating_joints(position: Signal, period_s: float) -> FloatArray:
    """Tell which of the moving joints repeat after ``period_s`` over most of the recording."""
    _, difference = _difference(position, period_s, max(period_s / 400.0, 0.5 / position.rate_hz))
    if difference.shape[1] == 0:
        return np.zeros(len(difference), dtype=bool)
    return np.quantile(difference, 0.7, axis=1) < _REPEATABILITY


def infer_period(position: Signal) -> float | None:
    """Find the shortest period that all moving joints share.

    Args:
        position: joint positions.

    Returns:
        The period [s], or None where no common one exists.
    """
    joints = moving_joints(position)
    duration = position.t_s[-1] - position.t_s[0]
    if joints.size == 0 or duration <= 0:
        return None
    rate = min(position.rate_hz, 200.0)
    grid = np.arange(position.t_s[0], position.t_s[-1], 1.0 / rate)
    scaled = np.array([np.interp(grid, position.t_s, position.values[j]) for j in joints]) / travel(position)[joints][:, None]
    for lag in _candidate_lags(scaled, rate):
        period = _refine(position, lag / rate, 2.0 / rate)
        start, stop = _steady_stretch(position, period)
        if stop - start >= 2.0 * period * (1.0 - 1e-3):
            return period
    return None


def _candidate_lags(scaled: FloatArray, rate: float) -> list[int]:
    """Lags at which the mean squared difference of all joints dips, shortest first."""
    count = scaled.shape[1]
    half = count // 2
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(scaled - scaled.mean(axis=1, keepdims=True), size)) ** 2
    correlation = np.fft.irfft(spectrum, size)[:, :half]
    centred = scaled - scaled.mean(axis=1, keepdims=True)
    energy = np.cumsum(centred**2, axis=1)
    lags = np.arange(half)
    head = energy[:, count - 1 - lags]
    tail = energy[:, -1:] - np.concatenate([np.zeros((len(scaled), 1)), energy[:, : half - 1]], axis=1)
    worst = ((head + tail - 2.0 * correlation) / (head + tail)).max(axis=0)
    start = int(np.argmax(worst > 0.1))  # leave the peak around lag zero
    dips = [
        int(k)
        for k in range(max(start, int(0.2 * rate)), half - 1)
        if worst[k] < 0.05 and worst[k] <= worst[k - 1] and worst[k] <= worst[k + 1]
    ]
    return dips[:20]


def _refine(position: Signal, guess_s: float, span_s: float) -> float:
    """Refine a period by minimising the difference of the motion after one period."""
    from scipy.optimize import minimize_scalar

    repeats = max(1, int((position.t_s[-1] - position.t_s[0]) / guess_s) - 1)

    def cost(period: float) -> float:
        step = max(period / 400.0, 0.5 / position.rate_hz)
        _, near = _difference(position, period, step)
        return float(np.sum(np.median(near**2, axis=1)))

    result = minimize_scalar(cost, bounds=(guess_s - span_s, guess_s + span_s), method="bounded", options={"xatol": 1e-6})
    best = float(result.x)
    # over many periods a small error of the period adds up: refine on the longest whole multiple too
    def far(period: float) -> float:
        _, difference = _difference(position, repeats * period, max(period / 400.0, 0.5 / position.rate_hz))
        return float(np.sum(np.median(difference**2, axis=1))) if difference.size else 0.0

    if repeats > 1:
        width = 0.5 / position.rate_hz
        best = float(minimize_scalar(far, bounds=(best - width, best + width), method="bounded", options={"xatol": 1e-7}).x)
    return best


def find_window(data: Dataset, joint_names: tuple[str, ...]) -> PeriodWindow:
    """Locate the steady whole periods of a run.

    Args:
        data: the run; its facts are checked, never trusted.
        joint_names: for messages.

    Returns:
        The window of whole steady periods.

    Raises:
        NotPeriodicError: the claimed period is not in the data, or no period is common to all joints,
            or fewer than two periods are there.
    """
    position = data.position
    stated = data.facts.fundamental_hz
    period = 1.0 / stated if stated else infer_period(position)
    if period is None:
        raise NotPeriodicError(_why_no_period(data, joint_names))
    start, stop = _steady_stretch(position, period)
    if stated and stop - start < 1.5 * period:
        _refuse_stated(data, period, joint_names)
    if stop - start < 2.0 * period - 2.0 / position.rate_hz:
        raise NotPeriodicError(
            f"{data.source} holds {max(stop - start, 0.0) / period:.2f} steady periods of {period:.6g} s, but at least two whole "
            "ones are needed to tell noise from signal; record more periods."
        )
    return _place_window(data, period, start, stop)


def _place_window(data: Dataset, period: float, start: float, stop: float) -> PeriodWindow:
    tolerance = 1.5 / data.position.rate_hz
    whole = int(np.floor((stop - start + tolerance) / period))
    transient = data.facts.transient_periods or 0
    wanted = data.facts.periods or max(whole - transient, 2)
    skip = min(transient, max(whole - wanted, 0))
    # the first difference that repeats may still carry a decaying transient: use the last periods
    used = min(wanted, whole - skip)
    first = start + skip * period
    return PeriodWindow(period, first, used, data.facts.fundamental_hz is None)


def _refuse_stated(data: Dataset, period: float, joint_names: tuple[str, ...]) -> None:
    found = infer_period(data.position)
    held = data.position.t_s[-1] - data.position.t_s[0]
    if held < 2.0 * period:
        raise NotPeriodicError(
            f"{data.source} lasts {held:.3g} s, less than two periods of the stated {period:.6g} s "
            f"(fundamental_hz = {1 / period:.6g}); record more periods."
        )
    hint = f"it repeats every {found:.6g} s (fundamental_hz = {1 / found:.6g})" if found else "no common period was found"
    raise NotPeriodicError(
        f"{data.source} states fundamental_hz = {1 / period:.6g}, but the joints do not repeat after {period:.6g} s; "
        f"{hint}; correct the log's metadata or identify it as non-periodic."
    )


def _why_no_period(data: Dataset, joint_names: tuple[str, ...]) -> str:
    position = data.position
    joints = moving_joints(position)
    if joints.size == 0:
        return f"{data.source}: no joint moves, so nothing can be identified; record a run with motion."
    partial = _partly_repeating(position, joints)
    if partial is not None:
        period, yes = partial
        return (
            f"{data.source}: joints {', '.join(joint_names[j] for j in joints[yes])} repeat after {period:.4g} s, but "
            f"{', '.join(joint_names[j] for j in joints[~yes])} do not, so no period is inferred; the run is treated as non-periodic."
        )
    return f"{data.source} has no period common to all moving joints; it is treated as non-periodic."


def _partly_repeating(position: Signal, joints: FloatArray) -> tuple[float, FloatArray] | None:
    for k, j in enumerate(joints):
        period = infer_period(Signal(position.t_s, position.values[j : j + 1]))
        if period is not None:
            yes = repeating_joints(position, period)
            yes[k] = True
            return period, yes
    return None
