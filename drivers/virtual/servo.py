"""The drives' position loops: how the joints follow their setpoints, and when they stand still.

A stiff industrial position loop with a disturbance observer imposes the motion: what it leaves is a small,
band-limited tracking error that lags the acceleration and answers the friction. The motion is therefore
computed first, smooth to its second derivative at every instant, and the torque is what it needs, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.virtual.history import History
from drivers.virtual.linear_filter import PoleFilter, smooth_poles
from drivers.virtual.plant_file import PlantSpec

_SPLINE = (
    np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6.0
)  # uniform cubic B-spline
_STILL_RAD_S = 1e-9


@dataclass(frozen=True)
class Moments:
    """The motion at some instants: joint coordinates (n, k) as motors and encoders have them."""

    t_s: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    direction: np.ndarray
    """(n, k) sign of the friction force: sign(qd) in motion, what stiction holds (-1 to 1) at rest."""
    tick: np.ndarray
    fraction: np.ndarray


class Servo:
    """All position loops of the robot; setpoints go in one interpolation period at a time."""

    def __init__(
        self, spec: PlantSpec, start_q: np.ndarray, start_s: float, period_s: float, keep_s: float
    ) -> None:
        self.spec, self._loop = spec, spec.servo
        self.ticks_per_period = max(1, int(np.ceil(period_s / spec.servo.tick_s - 1e-9)))
        self.step_s = period_s / self.ticks_per_period
        self.history = History(self.step_s, start_s, keep_s)
        self._knots = np.tile(np.asarray(start_q, dtype=float), (3, 1))
        self._coulomb = np.array([joint.coulomb_nm for joint in spec.joints])
        self._viscous = np.array([joint.viscous_nm_s for joint in spec.joints])
        self._error = PoleFilter(smooth_poles(self._loop.bandwidth_hz), self.step_s, len(spec.joints))
        self._weights = _spline_weights(self.ticks_per_period, period_s)
        self._pull = np.zeros(len(spec.joints))
        self._run = np.zeros((2, len(spec.joints)))  # sign of the last motion, time since it ended
        self.end_s = start_s
        self._store(self._knots[:1], np.zeros((1, len(spec.joints))), np.zeros((1, len(spec.joints))))

    def follow(self, setpoints: np.ndarray) -> Moments:
        """Take the next setpoints (m, k), one a period, and move; return the new ticks."""
        knots = np.vstack([self._knots, setpoints])
        self._knots = knots[-3:]
        origin = knots[:-3]
        windows = np.stack([knots[i : len(knots) - 3 + i] - origin for i in range(4)], axis=1)
        parts = self._weights @ windows  # (m, 3 * ticks, k)
        ticks, shape = self.ticks_per_period, (-1, knots.shape[1])
        q = (parts[:, :ticks] + origin[:, None]).reshape(shape)
        return self._store(
            q, parts[:, ticks : 2 * ticks].reshape(shape), parts[:, 2 * ticks :].reshape(shape)
        )

    def at(self, t_s: np.ndarray) -> Moments:
        """Return the motion at any instants so far."""
        history = self.history
        tick, fraction = history.locate(t_s)
        q, qd, qdd = history.smooth("q", tick, fraction)
        held = history.series("held")[tick]
        direction = np.where(np.isnan(held), np.sign(qd), held)
        return Moments(np.asarray(t_s, dtype=float), q, qd, qdd, direction, tick, fraction)

    def _store(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> Moments:
        error = self._error.advance(self._disturbance(qd, qdd))
        q, moving, qdd = q + error[0], qd + error[1], qdd + error[2]
        held = self._stiction(moving, np.abs(qd) < _STILL_RAD_S)
        self.history.append(q=q, q_d=moving, q_dd=qdd, held=held)
        count = len(q)
        t_s = self.end_s + self.step_s * np.arange(1, count + 1)
        first = len(self.history.series("q")) - count
        if first == 0:
            t_s = np.array([self.end_s])
        self.end_s = float(t_s[-1])
        direction = np.where(np.isnan(held), np.sign(moving), held)
        return Moments(t_s, q, moving, qdd, direction, first + np.arange(count), np.zeros(count))

    def _disturbance(self, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Error (n, k) the loop would settle at: acceleration lag, friction over stiffness."""
        change = np.abs(qdd) * self.step_s / 2.0 + 1e-300
        mean_sign = np.minimum(np.maximum(qd / change, -1.0), 1.0)  # over a tick
        side = np.where(np.abs(qd) < _STILL_RAD_S, np.nan, mean_sign)
        side = _carry_forward(side, self._pull)
        self._pull = side[-1].copy()
        friction = self._coulomb * side + self._viscous * qd
        return np.asarray(-self._loop.acceleration_lag_s2 * qdd - friction / self._loop.stiffness_nm_rad)

    def _stiction(self, qd: np.ndarray, commanded_still: np.ndarray) -> np.ndarray:
        """Share (n, k) of the break-away friction that holds a stopped joint; NaN where the joint moves."""
        still = commanded_still & (np.abs(qd) < self._loop.stick_speed_rad_s)
        if not still.any():
            self._run = np.array([np.sign(qd[-1]), np.zeros(qd.shape[1])])
            return np.full(qd.shape, np.nan)
        side = _carry_forward(np.where(still, np.nan, np.sign(qd)), self._run[0])
        tick = np.arange(1.0, len(qd) + 1.0)[:, None]
        moved = _carry_forward(np.where(still, np.nan, tick), -self._run[1] / self.step_s)
        rest_s = (tick - moved) * self.step_s
        self._run = np.array([side[-1], rest_s[-1]])
        return np.where(still, side * np.exp(-rest_s / self._loop.hold_relaxation_s), np.nan)


def _spline_weights(ticks: int, period_s: float) -> np.ndarray:
    """Weights (3 ticks, 4) of four setpoints: values, slopes and bends of the B-spline at the ticks."""
    u = np.arange(1, ticks + 1) / ticks
    none, one = np.zeros(ticks), np.ones(ticks)
    value = np.array([one, u, u**2, u**3]).T
    slope = np.array([none, one, 2.0 * u, 3.0 * u**2]).T / period_s
    bend = np.array([none, none, 2.0 * one, 6.0 * u]).T / period_s**2
    return np.asarray(np.vstack([value, slope, bend]) @ _SPLINE)


def _carry_forward(values: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Replace every NaN (n, k) by the last number above it, `before` (k,) at the top."""
    if not np.isnan(values).any():
        return values
    stacked = np.vstack([np.broadcast_to(before, (1, values.shape[1])), values])
    row = np.where(np.isnan(stacked), 0, np.arange(len(stacked))[:, None])
    row = np.maximum.accumulate(row, axis=0)
    return np.asarray(np.take_along_axis(stacked, row, axis=0)[1:])
