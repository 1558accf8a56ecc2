"""Straight moves from rest to rest, and a point-to-point motion for validation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from daq.excitation import Motion

# Peaks of the quintic blend over a move of unit distance and unit time.
_SPEED_PEAK = 1.875
_ACCELERATION_PEAK = 5.7735

_SHORTEST_S = 0.4
_DEFAULT_ACCELERATION = 2.0  # rad/s2, where the robot file names no limit: gentle for any arm
_DEFAULT_SPEED = 0.5  # rad/s, likewise


@dataclass(frozen=True)
class Move:
    """A quintic move along a straight line in joint space: at rest, without acceleration, at both ends."""

    start: np.ndarray
    goal: np.ndarray
    duration_s: float

    def evaluate(self, t_s: np.ndarray) -> Motion:
        """Position, velocity and acceleration (n, k) at instants (n,) since the start."""
        u = np.clip(np.asarray(t_s) / self.duration_s, 0.0, 1.0)[:, None]
        way, duration_s = self.goal - self.start, self.duration_s
        q = self.start + way * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        qd = way / duration_s * 30.0 * u**2 * (1.0 - u) ** 2
        qdd = way / duration_s**2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
        return q, qd, qdd


def move_between(
    start: np.ndarray, goal: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, share: float = 0.5
) -> Move:
    """The move that uses at most a share of every joint's limits.

    Args:
        start: (k,) rad or m.
        goal: (k,).
        velocity: (k,) limits, inf where there is none.
        acceleration: (k,) limits, inf where there is none.
        share: of the limits.
    """
    way = np.abs(goal - start)
    speed = share * np.where(np.isfinite(velocity), velocity, 2.0 * _DEFAULT_SPEED)
    rise = share * np.where(np.isfinite(acceleration), acceleration, 2.0 * _DEFAULT_ACCELERATION)
    by_speed = _SPEED_PEAK * way / speed
    by_acceleration = np.sqrt(_ACCELERATION_PEAK * way / rise)
    return Move(start, goal, float(max(_SHORTEST_S, by_speed.max(), by_acceleration.max())))


def validation_points(low: np.ndarray, high: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Points (count, k) spread evenly over a box, the same for the same seed.

    Source:
        Additive recurrence by the generalised golden ratio (Roberts 2018), shifted at random.
    """
    width = len(low)
    ratio = 2.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (width + 1))
    steps = ratio ** -np.arange(1.0, width + 1.0)
    shift = np.random.default_rng(seed).random(width)
    share = (shift + np.outer(np.arange(1, count + 1), steps)) % 1.0
    return low + share * (high - low)
