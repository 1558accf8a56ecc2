"""A whole run as one table of set points at bus rate: approach, ramp, orbit, ramp, return."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from daq.excitation import Excitation, Motion, read_excitation
from daq.limits import Limits
from daq.moves import Move, move_between, validation_points
from daq.ramp import Ramp, shortest_ramp

__all__ = ["Excitation", "Plan", "plan_excitation", "plan_validation", "read_excitation"]

_REST_S = 0.5
"""Rest between two parts: long enough for the arm to swing out."""

_APPROACH_SHARE = 0.5
"""Of the limits, on the way to the orbit and back."""

_VALIDATION_SHARE = 0.8
"""Of the limits, between the points of the validation motion."""


@dataclass(frozen=True)
class Plan:
    """The set points of a run.

    Attributes:
        joints: names in column order.
        period_s: bus period.
        q: (n, k) set points [rad or m], one a cycle.
        qd: (n, k).
        qdd: (n, k).
        first: first cycle of the part that the log's streams show.
        stop: cycle after its last.
        kind: ``excitation`` or ``validation``.
        fundamental_hz: repetition rate as commanded, None for a validation motion.
        harmonics: lines of the orbit.
        cycles_per_period: bus cycles of one period.
        periods: measured periods.
        transient_periods: periods before them, shown too.
    """

    joints: tuple[str, ...]
    period_s: float
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    first: int
    stop: int
    kind: str
    fundamental_hz: float | None = None
    harmonics: int = 0
    cycles_per_period: int = 0
    periods: int = 0
    transient_periods: int = 0

    @property
    def cycles(self) -> int:
        """Number of set points."""
        return len(self.q)

    @property
    def duration_s(self) -> float:
        """Length of the whole motion."""
        return self.cycles * self.period_s

    def metadata(self) -> dict[str, str]:
        """What the run's record says of the motion."""
        table = {"kind": self.kind, "sample_rate_hz": f"{1.0 / self.period_s:.9g}"}
        if self.fundamental_hz is not None:
            table |= {
                "fundamental_hz": f"{self.fundamental_hz:.12g}",
                "harmonics": str(self.harmonics),
                "periods": str(self.periods),
                "transient_periods": str(self.transient_periods),
            }
        return table

    def whole_periods(self, cycles: int) -> int:
        """Measured periods that are complete after so many cycles of the run."""
        if not self.cycles_per_period:
            return 0
        shown = min(cycles, self.stop) - self.first - self.transient_periods * self.cycles_per_period
        return max(0, shown // self.cycles_per_period)


def plan_excitation(
    excitation: Excitation, limits: Limits, start: np.ndarray, period_s: float,
    periods: int = 16, transient_periods: int = 1,
) -> Plan:
    """From where the arm stands onto the orbit, round it, and back.

    Args:
        excitation: the periodic motion, its joints those of the limits.
        limits: what must be kept; ramps and moves are made slow enough for them.
        start: (k,) where the arm stands.
        period_s: bus period.
        periods: measured periods.
        transient_periods: periods before them.
    """
    orbit, cycles = excitation.ordered(limits.joints).in_whole_cycles(period_s)
    ramp = shortest_ramp(orbit, limits.acceleration, period_s)
    out = _sample(lambda t: ramp.out_of(orbit, t), ramp.duration_s, period_s)
    into = _align_ramp(ramp, orbit, period_s)
    around = orbit.evaluate(np.arange(cycles) * period_s)
    count = periods + transient_periods
    approach = _approach(limits, start, into[0][0], period_s)
    home = _approach(limits, out[0][-1], start, period_s)
    begin, end = (_rest(pose, period_s) for pose in (into[0][0], out[0][-1]))
    parts = [approach, begin, into, *[around] * count, out, end, home]
    first = sum(len(part[0]) for part in parts[:3])
    q, qd, qdd = _join(parts)
    return Plan(
        limits.joints, period_s, q, qd, qdd, first, first + count * cycles, "excitation",
        orbit.fundamental_hz, orbit.harmonics, cycles, periods, transient_periods,
    )


def plan_validation(
    limits: Limits, start: np.ndarray, period_s: float, low: np.ndarray, high: np.ndarray,
    points: int = 12, seed: int = 0,
) -> Plan:
    """Moves with a full stop at each of some points of a box (k,), which the excitation has explored."""
    stops = [start, *validation_points(low, high, points, seed), start]
    parts: list[Motion] = [_rest(start, period_s)]
    for here, there in pairwise(stops):
        move = move_between(here, there, limits.velocity, limits.acceleration, _VALIDATION_SHARE)
        parts += [_sample(move.evaluate, move.duration_s, period_s), _rest(there, period_s)]
    q, qd, qdd = _join(parts)
    return Plan(limits.joints, period_s, q, qd, qdd, 0, len(q), "validation")


def plan_motion(
    limits: Limits, start: np.ndarray, period_s: float, motion: Callable[[np.ndarray], Motion],
    duration_s: float, kind: str,
) -> Plan:
    """A given motion, from rest to rest, with the way to its first pose and back.

    Args:
        limits: what must be kept.
        start: (k,) where the arm stands.
        period_s: bus period.
        motion: instants (n,) to q, qd, qdd (n, k).
        duration_s: of the motion.
        kind: ``validation`` or ``free``.
    """
    middle = _sample(motion, duration_s, period_s)
    begin, end = (_rest(pose, period_s) for pose in (middle[0][0], middle[0][-1]))
    approach = _approach(limits, start, begin[0][0], period_s)
    home = _approach(limits, end[0][0], start, period_s)
    q, qd, qdd = _join([approach, begin, middle, end, home])
    first = len(approach[0]) + len(begin[0])
    return Plan(limits.joints, period_s, q, qd, qdd, first, first + len(middle[0]), kind)


def _align_ramp(ramp: Ramp, orbit: Excitation, period_s: float) -> Motion:
    """The ramp in, sampled so that the orbit's phase zero falls on the next cycle."""
    count = int(np.ceil(ramp.duration_s / period_s))
    return ramp.into(orbit, ramp.duration_s - period_s * np.arange(count, 0, -1))


def _sample(evaluate: Callable[[np.ndarray], Motion], duration_s: float, period_s: float) -> Motion:
    return evaluate(np.arange(int(np.ceil(duration_s / period_s)) + 1) * period_s)


def _approach(limits: Limits, start: np.ndarray, goal: np.ndarray, period_s: float) -> Motion:
    move: Move = move_between(start, goal, limits.velocity, limits.acceleration, _APPROACH_SHARE)
    return _sample(move.evaluate, move.duration_s, period_s)


def _rest(pose: np.ndarray, period_s: float) -> Motion:
    count = round(_REST_S / period_s)
    still = np.zeros((count, len(pose)))
    return np.tile(pose, (count, 1)), still, still


def _join(parts: list[Motion]) -> Motion:
    q, qd, qdd = (np.concatenate([part[i] for part in parts]) for i in range(3))
    return q, qd, qdd
