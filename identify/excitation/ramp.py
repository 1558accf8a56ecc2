"""Start and stop at rest without leaving the orbit: the phase speeds up smoothly, the path stays the same.

Because the arm never leaves the closed path of the periodic motion, angles and distances are those of the
period; speeds are at most the period's; only accelerations and torques need their own check.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.excitation.errors import DesignError
from identify.excitation.limits import MotionLimits
from identify.excitation.series import FourierSeries
from identify.rotations import FloatArray

_SHARES = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0)  # of a period: durations tried, shortest first
_POINTS = 2048


@dataclass(frozen=True)
class Ramp:
    """Transition between rest and the periodic motion.

    Attributes:
        duration_s: [s]; the phase advances by half of it.
    """

    duration_s: float

    def phase_speed(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Phase time, its rate and its acceleration t_s after the start of the ramp in.

        Args:
            t_s: instants, 0 at rest, ``duration_s`` on the orbit at phase zero [s], shape (N,).

        Returns:
            Phase time [s], rate [-], acceleration [1/s], each shape (N,).

        Source:
            Quintic blend u^3 (10 - 15 u + 6 u^2): rate and its slope vanish at rest, rate one and slope zero
            on the orbit, so that position, velocity and acceleration are continuous.
        """
        u = np.clip(t_s / self.duration_s, 0.0, 1.0)
        rate = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        travelled = u**4 * (2.5 - 3.0 * u + u**2) * self.duration_s
        slope = 30.0 * u**2 * (1.0 - u) ** 2 / self.duration_s
        return travelled - 0.5 * self.duration_s, rate, slope

    def evaluate(self, series: FourierSeries, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Motion of the ramp in, that ends at phase zero; the ramp out is its mirror in time.

        Args:
            series: the periodic motion.
            t_s: instants from rest [s], shape (N,).

        Returns:
            q, qd, qdd, each shape (n, N).
        """
        phase, rate, slope = self.phase_speed(t_s)
        q, first, second = series.evaluate(phase)
        return q, first * rate, second * rate**2 + first * slope

    def evaluate_out(
        self, series: FourierSeries, t_s: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Motion of the ramp out, that begins at phase zero and ends at rest after ``duration_s``."""
        phase, rate, slope = self.phase_speed(self.duration_s - t_s)
        q, first, second = series.evaluate(-phase)
        return q, first * rate, second * rate**2 - first * slope


def ramp_acceleration(series: FourierSeries, ramp: Ramp) -> FloatArray:
    """Bound the acceleration during both ramps, shape (n,)."""
    t_s = np.linspace(0.0, ramp.duration_s, _POINTS)
    step = t_s[1]
    both = [ramp.evaluate(series, t_s)[2], ramp.evaluate_out(series, t_s)[2]]
    values = np.concatenate(both, axis=1)
    # |d qdd/dt| <= |q'''| + 3 |q''| |slope| + |q'| |curvature|; slope <= 1.875 / T, curvature <= 5.7736 / T^2
    t = ramp.duration_s
    jerk = series.amplitude(3) + 3.0 * series.amplitude(2) * 1.875 / t + series.amplitude(1) * 5.7736 / t**2
    return np.abs(values).max(axis=1) + 0.5 * step * jerk


def shortest_ramp(series: FourierSeries, limits: MotionLimits) -> Ramp:
    """Find the shortest ramp whose accelerations keep their limits.

    Args:
        series: the periodic motion.
        limits: of the joints.

    Returns:
        The ramp.

    Raises:
        DesignError: even a ramp of four periods exceeds an acceleration limit.
    """
    for share in _SHARES:
        ramp = Ramp(share * series.period_s)
        peak = ramp_acceleration(series, ramp)
        if (peak <= limits.acceleration).all():
            return ramp
    worst = int(np.argmax(peak / limits.acceleration))
    raise DesignError(
        f"Starting from rest within {ramp.duration_s:g} s would accelerate joint "
        f"{worst + 1} by {peak[worst]:.4g}, above its "
        f"limit {limits.acceleration[worst]:.4g}; leave the limits a smaller share."
    )
