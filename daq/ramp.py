"""From rest onto a periodic orbit and back: the phase speeds up smoothly, the path stays the orbit's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from daq.errors import UsageError
from daq.excitation import Excitation, Motion

_SHARES = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0)  # of a period: durations tried, shortest first


@dataclass(frozen=True)
class Ramp:
    """Transition between rest and the orbit, C2 at both ends; the phase advances by half its duration.

    Source:
        Quintic blend u^3 (10 - 15 u + 6 u^2) of the phase's rate: the rate's first two derivatives vanish
        where the ramp meets rest and orbit.
    """

    duration_s: float

    def into(self, orbit: Excitation, t_s: np.ndarray) -> Motion:
        """Motion (n, k) from rest at t = 0 to the orbit at phase zero at t = duration."""
        phase, rate, slope = self._phase(t_s)
        q, first, second = orbit.evaluate(phase)
        return q, first * rate[:, None], second * rate[:, None] ** 2 + first * slope[:, None]

    def out_of(self, orbit: Excitation, t_s: np.ndarray) -> Motion:
        """Motion (n, k) from the orbit at phase zero at t = 0 to rest at t = duration."""
        phase, rate, slope = self._phase(self.duration_s - t_s)
        q, first, second = orbit.evaluate(-phase)
        return q, first * rate[:, None], second * rate[:, None] ** 2 - first * slope[:, None]

    def _phase(self, t_s: np.ndarray) -> Motion:
        """Phase [s], its rate [-] and acceleration [1/s] after leaving rest."""
        u = np.clip(t_s / self.duration_s, 0.0, 1.0)
        rate = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        travelled = u**4 * (2.5 - 3.0 * u + u**2) * self.duration_s
        slope = 30.0 * u**2 * (1.0 - u) ** 2 / self.duration_s
        return travelled - 0.5 * self.duration_s, rate, slope


def shortest_ramp(orbit: Excitation, acceleration: np.ndarray, step_s: float) -> Ramp:
    """The file's own ramp where it keeps the limits, else the shortest one that does.

    Args:
        orbit: the periodic motion.
        acceleration: (k,) limits, inf where there is none [rad/s2].
        step_s: spacing of the instants checked.

    Raises:
        UsageError: not even a ramp of four periods keeps them.
    """
    orbital = np.abs(orbit.evaluate(np.arange(0.0, orbit.period_s, step_s))[2]).max(axis=0)
    allowed = np.maximum(acceleration, orbital)  # what the orbit itself exceeds is another check's business
    tried = [orbit.ramp_s] if orbit.ramp_s else []
    for duration_s in (*tried, *(share * orbit.period_s for share in _SHARES)):
        ramp = Ramp(duration_s)
        t_s = np.arange(0.0, duration_s, step_s)
        peak = max_abs(ramp.into(orbit, t_s)[2], ramp.out_of(orbit, t_s)[2])
        if (peak <= allowed * (1.0 + 1e-9)).all():
            return ramp
    worst = int(np.argmax(peak / allowed))
    raise UsageError(
        f"Starting from rest within {ramp.duration_s:g} s would accelerate {orbit.joints[worst]} by "
        f"{peak[worst]:.3g} rad/s2, beyond its limit {allowed[worst]:.3g}; design a slower excitation."
    )


def max_abs(*parts: np.ndarray) -> np.ndarray:
    """Largest magnitude (k,) over all rows of all parts."""
    return np.max([np.abs(part).max(axis=0) for part in parts if len(part)], axis=0)
