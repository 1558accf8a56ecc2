"""A whole simulated robot behind the fake drives: it takes targets and gives samples in its own time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

#: The drives' interpolation starts this share of a period after SYNC, so that a SYNC which jitters by less
#: never takes one set point twice; a real drive locks its interpolation to SYNC with such a reserve too.
_RESERVE = 0.25


class PeriodicPlant(Protocol):
    """The robot's physics, which advances in whole periods."""

    @property
    def time_s(self) -> float:
        """Time up to which it has been computed [s]."""
        ...

    @property
    def period_s(self) -> float:
        """The drives' interpolation period [s]."""
        ...


class Robot(Protocol):
    """What is needed of a simulated robot."""

    plant: Any  # a PeriodicPlant
    time_s: float

    def command_position(self, q: np.ndarray) -> None:
        """Set all targets [rad]."""
        ...

    def advance_to(self, t_s: float) -> None:
        """Let time pass [s]."""
        ...

    def sample_encoders(self, t_s: float | None = None) -> np.ndarray:
        """Positions [rad]."""
        ...

    def sample_currents(self, t_s: float | None = None) -> np.ndarray:
        """Motor currents [A]."""
        ...


class RobotAxis:
    """One joint of the robot, as one fake drive sees it."""

    def __init__(self, robot: RobotPlant, index: int) -> None:
        self._robot = robot
        self._index = index

    def set_target(self, position_rad: float) -> None:
        """Set this joint's target [rad]."""
        self._robot.set_target(self._index, position_rad)

    def sample(self) -> tuple[float, float, float]:
        """Position [rad], current [A], velocity [rad/s] at the last SYNC."""
        return self._robot.sample(self._index)


class RobotPlant:
    """Ties a robot's time to the time of a bus.

    Args:
        robot: the robot, whose drives interpolate with the bus' SYNC period.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._plant: PeriodicPlant = robot.plant
        self._targets = np.array(robot.sample_encoders(), dtype=float)
        self._positions = self._targets.copy()
        self._currents = np.array(robot.sample_currents(), dtype=float)
        self._velocities = np.zeros_like(self._targets)
        self._origin_ns: int | None = None
        self._origin_s = 0.0
        self._last_s = self._sampled_s = 0.0
        self.axes: Sequence[RobotAxis] = tuple(RobotAxis(self, i) for i in range(len(self._targets)))

    def set_target(self, index: int, position_rad: float) -> None:
        """Set one joint's target [rad]; it counts from the next period on."""
        self._run()
        self._targets[index] = position_rad

    def sample(self, index: int) -> tuple[float, float, float]:
        """Position [rad], current [A], velocity [rad/s] of one joint."""
        if self._sampled_s < self._last_s:
            self._sample()
        return float(self._positions[index]), float(self._currents[index]), float(self._velocities[index])

    def robot_time_s(self, time_ns: int) -> float:
        """The robot's time at a time of the bus [s]; for a force plate sampled beside the drives."""
        if self._origin_ns is None:
            self._start(time_ns)
        assert self._origin_ns is not None
        return self._origin_s + (time_ns - self._origin_ns) * 1e-9

    def anchor(self, sync_ns: int) -> None:
        """Lock the interpolation to the first SYNC at `sync_ns`, as drives do; the robot is still at rest."""
        phase_s = (self.robot_time_s(sync_ns) - self._plant.time_s) % self._plant.period_s
        shift_s = (1.0 - _RESERVE) * self._plant.period_s - phase_s
        self._origin_s += shift_s % self._plant.period_s

    def advance_to(self, time_ns: int) -> None:
        """Let time pass up to `time_ns` of the bus; the robot catches up when somebody looks or commands."""
        self._last_s = max(self._last_s, self.robot_time_s(time_ns))

    def _run(self) -> None:
        if self._robot.time_s < self._last_s:
            self._robot.command_position(self._targets)
            self._robot.advance_to(self._last_s)

    def _sample(self) -> None:
        """All joints at once, at the time reached."""
        self._run()
        time_s, before = self._last_s, self._positions
        self._positions = np.array(self._robot.sample_encoders(time_s), dtype=float)
        self._currents = np.array(self._robot.sample_currents(time_s), dtype=float)
        self._velocities = (self._positions - before) / (time_s - self._sampled_s)
        self._sampled_s = time_s

    def _start(self, time_ns: int) -> None:
        """Put the first SYNC a reserve ahead of the end of the robot's computed time."""
        start_s = self._plant.time_s - _RESERVE * self._plant.period_s
        while start_s < self._robot.time_s:
            start_s += self._plant.period_s
        self._origin_ns, self._origin_s = time_ns, start_s
        self._last_s = self._sampled_s = self._robot.time_s
