"""Motions that go with an excitation: its reversed twin, a slow copy, points with full stops, sweeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from identify.excitation.errors import DesignError
from identify.excitation.limits import MotionLimits
from identify.excitation.ramp import Ramp
from identify.excitation.series import FourierSeries
from identify.rotations import FloatArray

_PEAK_SLOPE = 1.875  # greatest slope of the quintic blend
_DRAWS_PER_POINT = 200


def reversed_twin(series: FourierSeries) -> FourierSeries:
    """Run the same path backwards: q(-t), the sines negated; what is conservative is even, friction odd."""
    return replace(series, sine=-series.sine)


def slow_copy(series: FourierSeries, factor: float = 4.0) -> FourierSeries:
    """Run the same path slower: dynamics shrink by the square of the factor, gravity and friction stay."""
    if not factor > 1.0:
        raise DesignError(f"The slow copy's factor is {factor:g}, but it must exceed 1.")
    return replace(series, fundamental_hz=series.fundamental_hz / factor)


@dataclass(frozen=True)
class Moves:
    """Straight moves in joint space from rest to rest, with a pause after each.

    Each move speeds up over its blend, runs at constant speed and slows down over its blend; speed follows
    the quintic blend, so acceleration is continuous. A blend of half the duration leaves no constant part.

    Attributes:
        points: positions, shape (m + 1, n); the arm starts at the first.
        duration_s: of each move, shape (m,).
        blend_s: of each move, at most half the duration, shape (m,).
        pause_s: rest after each move, and before the first.
    """

    points: FloatArray
    duration_s: FloatArray
    blend_s: FloatArray
    pause_s: float

    @property
    def total_s(self) -> float:
        """Duration of everything [s]."""
        return float(self.duration_s.sum() + self.pause_s * (len(self.duration_s) + 1))

    def evaluate(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Evaluate position, velocity and acceleration at instants (N,), each (n, N)."""
        begins = self.pause_s + np.concatenate([[0.0], np.cumsum(self.duration_s + self.pause_s)[:-1]])
        move = np.clip(np.searchsorted(begins, t_s, side="right") - 1, 0, len(begins) - 1)
        share, rate, slope = _profile(t_s - begins[move], self.duration_s[move], self.blend_s[move])
        first, step = self.points[move].T, (self.points[move + 1] - self.points[move]).T
        return first + step * share, step * rate, step * slope


def _profile(
    t_s: FloatArray, duration_s: FloatArray, blend_s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Share of the way (0 to 1), its rate [1/s] and acceleration [1/s2]."""
    t = np.clip(t_s, 0.0, duration_s)
    late = t > 0.5 * duration_s
    early = np.where(late, duration_s - t, t)  # the second half mirrors the first
    phase, rate, slope = _blend(early, blend_s)
    top = 1.0 / (duration_s - blend_s)
    share = phase * top
    return np.where(late, 1.0 - share, share), rate * top, np.where(late, -slope, slope) * top


def _blend(t_s: FloatArray, blend_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    unit = Ramp(1.0)
    phase, rate, slope = unit.phase_speed(t_s / blend_s)
    beyond = np.maximum(t_s - blend_s, 0.0)
    return (phase + 0.5) * blend_s + beyond, rate, slope / blend_s


def quickest_move(limits: MotionLimits, step: FloatArray, share: float = 0.9) -> tuple[float, float]:
    """Duration and blend of a move without constant part, inside velocity and acceleration limits.

    Args:
        limits: of the joints.
        step: displacement, shape (n,).
        share: part of the limits that is used.

    Returns:
        Duration and blend [s].
    """
    # with a blend of half the duration the top speed is 2 step / T, the top acceleration 7.5 step / T^2
    far = np.abs(step)
    by_speed = np.max(2.0 * far / (share * np.where(np.isfinite(limits.velocity), limits.velocity, 1.0)))
    by_effort = np.sqrt(np.max(4.0 * _PEAK_SLOPE * far / (share * limits.acceleration)))
    duration = max(float(by_speed), float(by_effort), 0.5)
    return duration, 0.5 * duration


def random_points(
    limits: MotionLimits,
    seed: int,
    count: int = 20,
    pause_s: float = 0.5,
    allowed: Callable[[Moves], bool] | None = None,
    home: FloatArray | None = None,
) -> Moves:
    """Visit random points with full stops: the validation run of the source, or static poses by a long pause.

    Args:
        limits: of the joints.
        seed: of the points.
        count: number of points.
        pause_s: rest at each.
        allowed: tells whether a single move is free of collisions and overload; None allows all.
        home: where it starts, shape (n,); the position nearest zero by default.

    Returns:
        The moves.

    Raises:
        DesignError: no allowed point is found.

    Source:
        Verdonck, Swevers, Samin 2001, section 6 (validation on 20 random points).
    """
    rng = np.random.default_rng([seed, 20])
    points = [np.clip(0.0, limits.lower, limits.upper) if home is None else home]
    middle, half = limits.middle, 0.48 * (limits.upper - limits.lower)
    times: list[tuple[float, float]] = []
    while len(times) < count:
        for _ in range(_DRAWS_PER_POINT):
            target = np.round(middle + half * rng.uniform(-1.0, 1.0, len(middle)), 9)
            time = quickest_move(limits, target - points[-1])
            one = Moves(np.array([points[-1], target]), np.array([time[0]]), np.array([time[1]]), 0.0)
            if allowed is None or allowed(one):
                break
        else:
            raise DesignError(
                f"None of {_DRAWS_PER_POINT} random points can be reached from point "
                f"{len(times)} without touching "
                "something or exceeding a torque limit; loosen the workspace."
            )
        points.append(target)
        times.append(time)
    duration, blend = np.array(times).T
    return Moves(np.array(points), duration, blend, pause_s)


def constant_speed_sweeps(
    limits: MotionLimits,
    joint: int,
    speeds: int = 5,
    pause_s: float = 0.5,
    pose: FloatArray | None = None,
) -> Moves:
    """Sweep one joint to and fro at constant speeds, geometrically spaced up to 80 % of its limit.

    Args:
        limits: of the joints.
        joint: index of the joint.
        speeds: number of speeds, each in both directions.
        pause_s: rest between sweeps.
        pose: where the other joints stand, shape (n,); the middle of their limits by default.

    Returns:
        The moves; friction against speed shows in their constant parts.
    """
    rest = limits.middle.copy() if pose is None else pose.copy()
    span = 0.9 * (limits.upper[joint] - limits.lower[joint])
    top = limits.velocity[joint] if np.isfinite(limits.velocity[joint]) else span
    hard = limits.acceleration[joint] if np.isfinite(limits.acceleration[joint]) else 5.0 * top
    # at most a quarter of the way goes into each blend, so that half of it is at constant speed
    top = min(0.8 * top, np.sqrt(0.5 * span * 0.8 * hard / _PEAK_SLOPE))
    rates = np.geomspace(0.05, 1.0, speeds) * top
    points, duration, blend = [rest.copy()], [], []
    ends = limits.middle[joint] + 0.5 * span * np.array([-1.0, 1.0])
    rest[joint] = ends[0]
    points.append(rest.copy())
    time = quickest_move(limits, points[1] - points[0])
    duration.append(time[0])
    blend.append(time[1])
    for rate in rates:
        speed_up = max(_PEAK_SLOPE * rate / (0.8 * hard), 0.05)
        for end in (ends[1], ends[0]):
            rest[joint] = end
            points.append(rest.copy())
            blend.append(speed_up)
            duration.append(span / rate + speed_up)
    return Moves(np.array(points), np.array(duration), np.array(blend), pause_s)


def joined(parts: list[Moves], limits: MotionLimits) -> Moves:
    """String moves together, going from the end of each to the beginning of the next.

    Args:
        parts: with the same pause.
        limits: for the moves in between.

    Returns:
        One sequence.
    """
    points, duration, blend = [parts[0].points], [parts[0].duration_s], [parts[0].blend_s]
    for part in parts[1:]:
        time = quickest_move(limits, part.points[0] - points[-1][-1])
        points.append(part.points)
        duration += [np.array([time[0]]), part.duration_s]
        blend += [np.array([time[1]]), part.blend_s]
    return Moves(np.vstack(points), np.concatenate(duration), np.concatenate(blend), parts[0].pause_s)
