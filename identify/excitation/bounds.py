"""Rigorous bounds between the samples of a grid."""

from __future__ import annotations

import numpy as np

from identify.excitation.series import FourierSeries
from identify.rotations import FloatArray

_POINTS_PER_LINE = 256
_COARSE_PER_LINE, _NEWTON_STEPS, _NEGLIGIBLE, _TINY = 32, 4, 1e-12, 1e-100


def grid_points(series: FourierSeries) -> int:
    """Number of grid points a period at which the bounds below cost less than 1e-4 of the amplitude."""
    return _POINTS_PER_LINE * max(series.harmonics, 4)


def series_bounds(series: FourierSeries, order: int) -> tuple[FloatArray, FloatArray]:
    """Bound a derivative of the motion from below and above at every instant, not only on a grid.

    Args:
        series: the motion.
        order: 0 position, 1 velocity, 2 acceleration.

    Returns:
        Lower and upper bounds, each shape (n,).

    Source:
        Between two samples a step d apart, f leaves their range by at most d^2 / 8 max |f''|; the second
        derivative of a trigonometric polynomial is at most sum (p w)^2 |line p|.
    """
    count = grid_points(series)
    values = series.evaluate(series.grid_s(count))[order]
    slack = (series.period_s / count) ** 2 / 8.0 * series.amplitude(order + 2)
    return values.min(axis=1) - slack, values.max(axis=1) + slack


def series_extremes(series: FourierSeries, order: int) -> tuple[FloatArray, FloatArray]:
    """Find the exact extremes of a derivative of the motion from the roots of the next derivative.

    Args:
        series: the motion.
        order: 0 position, 1 velocity, 2 acceleration.

    Returns:
        Minima and maxima, each shape (n,).

    Source:
        With z = exp(i w t) a trigonometric polynomial of degree h is z^-h times a polynomial of degree 2 h.
        Its roots lose digits where the highest lines are tiny: instants of a coarse grid join them, and all
        are polished by Newton steps (an instant more can only add a value that the motion does take).
    """
    wanted, slope, bend = (series.derivative(order + k) for k in range(3))
    grid = series.grid_s(_COARSE_PER_LINE * series.harmonics)
    low, high = np.empty(len(series.offset)), np.empty(len(series.offset))
    for joint in range(len(series.offset)):
        t_s = np.concatenate([grid, _root_instants(slope, joint)])
        for _ in range(_NEWTON_STEPS):
            curvature = bend.evaluate(t_s)[0][joint]
            flat = np.abs(curvature) < _NEGLIGIBLE * bend.amplitude()[joint] + _TINY
            step = slope.evaluate(t_s)[0][joint] / np.where(flat, np.inf, curvature)
            t_s = t_s - np.clip(step, -grid[1], grid[1])
        values = wanted.evaluate(np.concatenate([grid, t_s]))[0][joint]
        low[joint], high[joint] = values.min(), values.max()
    return low, high


def _root_instants(slope: FourierSeries, joint: int) -> FloatArray:
    """Phases of the roots of one joint's slope, as instants [s]."""
    half = 0.5 * (slope.cosine[joint] - 1j * slope.sine[joint])
    peak = np.abs(half).max()
    if peak < _TINY:
        return np.zeros(1)
    half = np.where(np.abs(half) < _NEGLIGIBLE * peak, 0.0, half / peak)
    roots = np.roots(np.concatenate([half[::-1], [0.0], np.conj(half)]))
    return np.angle(roots) / (2.0 * np.pi * slope.fundamental_hz)


def sampled_peak(values: FloatArray) -> FloatArray:
    """Bound |f| of a smooth periodic function between its samples by its own second differences.

    Args:
        values: one period, evenly sampled, shape (..., N).

    Returns:
        max |f| plus an eighth of twice the largest second difference, shape (...,).

    Source:
        As :func:`series_bounds`, with the second derivative measured on the grid and doubled.
    """
    bend = np.abs(np.roll(values, 1, axis=-1) - 2.0 * values + np.roll(values, -1, axis=-1)).max(axis=-1)
    return np.abs(values).max(axis=-1) + 0.25 * bend
