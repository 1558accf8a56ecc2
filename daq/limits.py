"""The envelope a motion must keep: checked on every set point beforehand, and on every measurement."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq.errors import UsageError

_RECENT = 6
"""Set points against which a measurement is compared: drives act one to four cycles late."""

_SPEED_MARGIN = 1.3
"""After a late SYNC the next ones follow at 0.8 of the period; measured speeds are noisy besides."""

_SPEED_CYCLES = 8
"""Cycles over which a measured speed is taken."""


@dataclass(frozen=True)
class Limits:
    """What the joints may do, ``inf`` where nothing binds.

    Attributes:
        joints: names.
        lower: (k,) positions [rad or m].
        upper: (k,).
        velocity: (k,) [1/s].
        acceleration: (k,) [1/s2].
        following: (k,) largest distance of the measured position from its recent set points.
        envelope: (k,) how far a measured position may lie outside ``lower`` to ``upper``.
    """

    joints: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    following: np.ndarray
    envelope: np.ndarray


@dataclass(frozen=True)
class Peak:
    """The largest use of one limit by one joint.

    Attributes:
        joint: its name.
        quantity: ``position``, ``velocity`` or ``acceleration``.
        value: the extreme reached.
        limit: the bound nearest to it.
        is_kept: whether it is inside.
    """

    joint: str
    quantity: str
    value: float
    limit: float
    is_kept: bool

    @property
    def sentence(self) -> str:
        """The peak in words."""
        verb = "keeps" if self.is_kept else "exceeds"
        reached = f"{self.joint} reaches the {self.quantity} {self.value:.4g}"
        return f"{reached}, which {verb} its limit {self.limit:.4g}"


def peaks(limits: Limits, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> tuple[Peak, ...]:
    """Compare a commanded motion (n, k) with the limits; four entries a joint."""
    found = []
    for j, joint in enumerate(limits.joints):
        low, high = float(q[:, j].min()), float(q[:, j].max())
        lower, upper = float(limits.lower[j]), float(limits.upper[j])
        found.append(Peak(joint, "position", low, lower, low >= lower))
        found.append(Peak(joint, "position", high, upper, high <= upper))
        rates = (("velocity", qd, limits.velocity), ("acceleration", qdd, limits.acceleration))
        for name, values, bound in rates:
            value = float(np.abs(values[:, j]).max())
            found.append(Peak(joint, name, value, float(bound[j]), bool(value <= bound[j] * (1.0 + 1e-6))))
    return tuple(found)


def check_set_points(limits: Limits, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> None:
    """Refuse a commanded motion that leaves the limits.

    Raises:
        UsageError: names the first excess.
    """
    for peak in peaks(limits, q, qd, qdd):
        if not peak.is_kept:
            raise UsageError(f"The motion is refused: {peak.sentence}; design it within the limits.")


class Watch:
    """Judges measured positions, cycle by cycle.

    Args:
        limits: the envelope.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._lower = (limits.lower - limits.envelope).tolist()
        self._upper = (limits.upper + limits.envelope).tolist()
        self._speed = (_SPEED_MARGIN * limits.velocity).tolist()
        self._following = limits.following.tolist()
        self._recent: deque[Sequence[float]] = deque(maxlen=_RECENT)
        self._past: deque[tuple[Sequence[float | None], int]] = deque(maxlen=_SPEED_CYCLES + 1)

    def commanded(self, target: Sequence[float]) -> None:
        """Take the set points (k,) of a cycle."""
        self._recent.append(target)

    def measured(self, position: Sequence[float | None], instant_ns: int) -> str | None:
        """Judge positions (k,) sampled at an instant, None where missing; return the reason to stop."""
        self._past.append((position, instant_ns))
        oldest, then_ns = self._past[0] if len(self._past) == self._past.maxlen else (None, 0)
        span_s = (instant_ns - then_ns) * 1e-9
        for j, q in enumerate(position):
            if q is None:
                continue
            if not self._lower[j] <= q <= self._upper[j]:
                return self._outside(j, q)
            goals = [target[j] for target in self._recent]
            apart = max(q - max(goals), min(goals) - q) if goals else 0.0
            if apart > self._following[j]:
                return self._apart(j, q, apart)
            before = oldest[j] if oldest is not None else None
            if before is not None and abs(q - before) > self._speed[j] * span_s:
                return self._too_fast(j, abs(q - before) / span_s)
        return None

    def _outside(self, j: int, q: float) -> str:
        limits = self._limits
        return (
            f"{limits.joints[j]} was measured at {q:.4f}, outside its limits {limits.lower[j]:.4f} to "
            f"{limits.upper[j]:.4f} (tolerance {limits.envelope[j]:.3g}); check its zero and its tuning."
        )

    def _apart(self, j: int, q: float, apart: float) -> str:
        return (
            f"{self._limits.joints[j]} was measured at {q:.4f}, {apart:.3g} away from its set points (limit "
            f"{self._following[j]:.3g}): it cannot follow; look for a collision, a brake or a weak drive."
        )

    def _too_fast(self, j: int, speed: float) -> str:
        return (
            f"{self._limits.joints[j]} was measured at the speed {speed:.3g}, beyond its limit "
            f"{self._limits.velocity[j]:.3g}; check its zero and its tuning."
        )


def limits_of(
    joints: Sequence[str], lower: Sequence[float], upper: Sequence[float], velocity: Sequence[float],
    acceleration: Sequence[float], following: float = 0.05, envelope: float = 0.02,
) -> Limits:
    """Limits from plain numbers, the last two alike for all joints [rad or m].

    Raises:
        UsageError: a joint whose lower limit is not below its upper one.
    """
    count = len(joints)
    found = Limits(
        tuple(joints), *(np.array(part, dtype=float) for part in (lower, upper, velocity, acceleration)),
        np.full(count, following), np.full(count, envelope),
    )
    for j, joint in enumerate(joints):
        if not found.lower[j] < found.upper[j]:
            span = f"{found.lower[j]:g} to {found.upper[j]:g}"
            raise UsageError(f"{joint} may move from {span}, which is no range: correct its limits.")
    return found
