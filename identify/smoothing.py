"""Velocity and acceleration of a motion that does not repeat: zero-phase filtering with a stated bandwidth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import interpolate, signal

from identify.dataset import Signal
from identify.errors import UnusableDataError
from identify.rotations import FloatArray

_ORDER = 4  # Butterworth, run forth and back: zero phase, twice the slope
_GAP = 5.0  # sampling intervals: a longer hole in the stamps is a gap that no spline may bridge
_FASTEST_HZ = 100.0  # no arm moves its links faster; quantised encoders have a floor that fools the spectrum
# the filter halves the amplitude at its cut-off and starts to bend well below: put it above where the motion ends
_HEADROOM = 1.45
_SHORTEST = 60  # samples: less cannot settle the filter's ends


@dataclass(frozen=True)
class SmoothMotion:
    """Joint motion on a uniform grid.

    Attributes:
        t_s: grid instants [s], shape (N,).
        q: positions, shape (n, N).
        qd: velocities, shape (n, N).
        qdd: accelerations, shape (n, N).
        bandwidth_hz: cut-off of the zero-phase filter.
        noise_std: encoder noise per sample as seen above the bandwidth, shape (n,).
        valid: False near gaps and at the ends, shape (N,).
    """

    t_s: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    bandwidth_hz: float
    noise_std: FloatArray
    valid: FloatArray

    @property
    def rate_hz(self) -> float:
        """Grid rate."""
        return float(1.0 / (self.t_s[1] - self.t_s[0]))

    @property
    def velocity_std(self) -> FloatArray:
        """Std of the velocity: white encoder noise through the derivative of the filter, shape (n,)."""
        w = 2.0 * np.pi * self.bandwidth_hz
        return self.noise_std * w * np.sqrt(2.0 * self.bandwidth_hz / (3.0 * self.rate_hz))

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Evaluate between the grid points by cubic splines: q, qd, qdd, each (n, K)."""
        return tuple(interpolate.CubicSpline(self.t_s, x, axis=1)(t_s) for x in (self.q, self.qd, self.qdd))  # type: ignore[return-value]

    def valid_at(self, t_s: FloatArray) -> FloatArray:
        """Tell which instants lie in valid stretches, shape (K,)."""
        inside = (t_s >= self.t_s[0]) & (t_s <= self.t_s[-1])
        index = np.clip(np.round((t_s - self.t_s[0]) * self.rate_hz).astype(int), 0, len(self.t_s) - 1)
        return inside & self.valid[index]


def choose_bandwidth(uniform: FloatArray, rate_hz: float) -> float:
    """Find where the motion sinks into the encoder noise: the cut-off with the least acceleration error.

    Args:
        uniform: positions on a uniform grid, shape (n, N).
        rate_hz: grid rate.

    Returns:
        Cut-off [Hz]: beyond it the spectrum stays below twice its floor, so that a wider band would pass
        more noise than motion.
    """
    length = min(uniform.shape[1], 1 << int(np.log2(max(uniform.shape[1] / 6, 32))))
    frequency, power = signal.welch(np.diff(uniform, axis=1), rate_hz, nperseg=length, axis=1)
    # differences weigh the spectrum by its frequency, which keeps leakage of slow motion out of the floor
    weight = np.maximum(2.0 - 2.0 * np.cos(2.0 * np.pi * frequency / rate_hz), 1e-12)
    power = power / weight
    top = (frequency > 0.55 * rate_hz / 2) & (frequency < 0.95 * rate_hz / 2)
    floor = np.median(power[:, top], axis=1, keepdims=True) / 0.8
    above = (power > 2.0 * floor) & (frequency < 0.8 * rate_hz / 2)
    last = [np.flatnonzero(row)[-1] if row.any() else 1 for row in _persistent(above)]
    return float(np.clip(_HEADROOM * frequency[max(last)], 8.0 * frequency[1], min(0.4 * rate_hz, _FASTEST_HZ)))


def _persistent(above: FloatArray) -> FloatArray:
    """Drop lone bins above the floor: noise exceeds it now and then."""
    padded = np.pad(above.astype(int), ((0, 0), (1, 1)))
    return above & ((padded[:, :-2] + padded[:, 2:]) > 0)


def differentiate(series: FloatArray, rate_hz: float) -> FloatArray:
    """Differentiate a uniform series (n, N) by central differences of sixth order.

    The plain ones lose (w dt)^2 / 6 of a line: half a per cent of an acceleration at 3 Hz and 150 Hz.

    Args:
        series: samples, shape (n, N).
        rate_hz: sampling rate.

    Returns:
        Derivatives, shape (n, N); of second order for the three samples at either end.
    """
    result = np.gradient(series, 1.0 / rate_hz, axis=1)
    total = np.zeros_like(series[:, 3:-3])
    for reach, weight in ((1, 45.0), (2, -9.0), (3, 1.0)):
        ahead = series[:, 3 + reach : series.shape[1] - 3 + reach]
        total += weight * (ahead - series[:, 3 - reach : series.shape[1] - 3 - reach])
    result[:, 3:-3] = total * rate_hz / 60.0
    return result


def smooth(position: Signal, bandwidth_hz: float | None = None) -> SmoothMotion:
    """Differentiate a non-periodic motion.

    Args:
        position: joint positions at their own, possibly irregular, instants.
        bandwidth_hz: cut-off; chosen from the spectrum when not given.

    Returns:
        The motion on a uniform grid at the stream's median rate.

    Raises:
        UnusableDataError: too few samples, or a bandwidth above the Nyquist frequency.
    """
    rate = position.rate_hz
    if len(position.t_s) < _SHORTEST:
        raise UnusableDataError(
            f"The recording has {len(position.t_s)} position samples, but at least {_SHORTEST} are needed to "
            "differentiate; record longer."
        )
    grid = np.arange(position.t_s[0], position.t_s[-1], 1.0 / rate)
    uniform = interpolate.CubicSpline(position.t_s, position.values, axis=1)(grid)
    cutoff = bandwidth_hz if bandwidth_hz is not None else choose_bandwidth(uniform, rate)
    if not 0.0 < cutoff < 0.5 * rate:
        raise UnusableDataError(
            f"A bandwidth of {cutoff:.4g} Hz is not between 0 and half the sampling rate ({0.5 * rate:.4g} Hz); choose one inside."
        )
    sections = signal.butter(_ORDER, cutoff, fs=rate, output="sos")
    q = signal.sosfiltfilt(sections, uniform, axis=1)
    rest = (uniform - q)[:, 10:-10]
    passed = cutoff / (0.5 * rate)
    noise = np.sqrt(np.mean(rest**2, axis=1) / max(1.0 - passed, 0.1))
    qd = differentiate(q, rate)
    qdd = differentiate(qd, rate)
    return SmoothMotion(grid, q, qd, qdd, cutoff, noise, _valid(position.t_s, grid, rate, cutoff))


def _valid(t: FloatArray, grid: FloatArray, rate: float, cutoff: float) -> FloatArray:
    """Mark what is far enough from gaps and ends for the filter to have settled."""
    margin = 0.5 / cutoff + 2.0 / rate
    valid = (grid > grid[0] + margin) & (grid < grid[-1] - margin)
    for k in np.flatnonzero(np.diff(t) > _GAP / rate):
        valid &= (grid < t[k] - margin) | (grid > t[k + 1] + margin)
    return valid
