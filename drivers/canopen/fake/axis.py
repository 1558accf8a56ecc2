"""What a fake drive moves: the port for any plant, and a plain inertia for tests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol


class Axis(Protocol):
    """One joint as its drive sees it."""

    def set_target(self, position_rad: float) -> None:
        """Make `position_rad` [rad, joint side] the set point from now on."""
        ...

    def sample(self) -> tuple[float, float, float]:
        """Position [rad], motor current [A], velocity [rad/s] now."""
        ...


class Plant(Protocol):
    """All joints together, with a time of their own."""

    @property
    def axes(self) -> Sequence[Axis]:
        """The joints in order."""
        ...

    def advance_to(self, time_ns: int) -> None:
        """Let physics run up to `time_ns`; called before the drives sample, never backwards."""
        ...


class InertiaAxis:
    """A rigid inertia with friction whose ideal drive moves straight to each set point in one period.

    Args:
        inertia_kgm2: at the joint [kg.m2].
        coulomb_nm: Coulomb friction [N.m].
        viscous_nms: viscous friction [N.m.s/rad].
        motor_gain_nm_a: joint torque per motor current, gear ratio times torque constant [N.m/A].
        period_s: time to reach a set point [s].
        start_rad: initial position [rad].
    """

    def __init__(
        self,
        inertia_kgm2: float = 1.0,
        coulomb_nm: float = 2.0,
        viscous_nms: float = 1.0,
        motor_gain_nm_a: float = 20.0,
        period_s: float = 1.0 / 150.0,
        start_rad: float = 0.0,
    ) -> None:
        self._inertia, self._coulomb, self._viscous = inertia_kgm2, coulomb_nm, viscous_nms
        self._gain, self._period_s = motor_gain_nm_a, period_s
        self._position = self._goal = start_rad
        self._velocity = self._acceleration = self._left_s = 0.0

    def set_target(self, position_rad: float) -> None:
        """Go to `position_rad` within the next period."""
        self._goal = position_rad
        self._left_s = self._period_s

    def sample(self) -> tuple[float, float, float]:
        """Position [rad], motor current [A], velocity [rad/s]."""
        friction_nm = self._viscous * self._velocity + self._coulomb * math.tanh(self._velocity / 0.01)
        torque_nm = self._inertia * self._acceleration + friction_nm
        return self._position, torque_nm / self._gain, self._velocity

    def advance(self, step_s: float) -> None:
        """Move on by `step_s` [s]."""
        share = step_s / self._left_s if step_s < self._left_s else 1.0
        moved = (self._goal - self._position) * share
        velocity = moved / step_s
        self._position += moved
        self._left_s = max(0.0, self._left_s - step_s)
        self._acceleration = (velocity - self._velocity) / step_s
        self._velocity = velocity


class InertiaPlant:
    """Independent inertia axes on one time."""

    def __init__(self, axes: Sequence[InertiaAxis]) -> None:
        self._axes = tuple(axes)
        self._time_ns: int | None = None

    @property
    def axes(self) -> Sequence[InertiaAxis]:
        """The joints in order."""
        return self._axes

    def advance_to(self, time_ns: int) -> None:
        """Move every axis up to `time_ns` [ns]."""
        if self._time_ns is not None and time_ns > self._time_ns:
            step_s = (time_ns - self._time_ns) * 1e-9
            for axis in self._axes:
                axis.advance(step_s)
        self._time_ns = time_ns
