"""The fake plate under the virtual robot, in the bus' virtual time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

import numpy as np

from daq.ports import PlateRest
from daq.timebase import USB_CDC
from drivers.force_plate.errors import PlateStalledError, PlateUnpluggedError
from drivers.force_plate.fake import Emission, FakePlate
from drivers.force_plate.faults import Fault
from drivers.force_plate.parser import PlateParser
from drivers.force_plate.port import PlateOnHostClock
from drivers.force_plate.protocols import protocol_named
from drivers.force_plate.protocols.protocol import PlateProtocol, sample_period_s
from drivers.force_plate.sample import PlateSample
from drivers.force_plate.tare import tare_of
from drivers.virtual.record import wrench_noise
from drivers.virtual.robot import VirtualRobot
from drivers.virtual.sensors import quantise, stream_generator

_BLOCK = 24
"""Samples whose physics is computed together: ten times cheaper than one by one, and 0.16 s late at most."""

_REST_S = 1.0
_STALL_S = 0.25
_WAIT_MEAN_S = 150e-6
"""Mean waiting time in the host on top of the floor, exponentially distributed."""


class VirtualTime(Protocol):
    """The bus whose time everything shares."""

    def now_ns(self) -> int:
        """Present virtual time [ns]."""
        ...

    def run(self, duration_ns: int) -> None:
        """Let time pass."""
        ...


class RobotLoad:
    """The wrench under the robot at the plate's own instants, computed a block at a time.

    Args:
        robot: the virtual robot.
        seed: of the noise.
        robot_time_s: from seconds since the stream's start to the robot's time.
        period_s: of the plate's samples.
    """

    def __init__(
        self, robot: VirtualRobot, seed: int, robot_time_s: Callable[[float], float], period_s: float
    ) -> None:
        self._robot, self._time_s, self._period_s = robot, robot_time_s, period_s
        self._noise = wrench_noise(robot.spec, stream_generator(seed, "wrench noise"))
        self._first_s, self._block = 0.0, np.empty((0, 6))

    def sample(self, t_s: float) -> Sequence[float]:
        """Force [N] and torque [N.m] at ``t_s`` seconds after the stream's start; call in order of time."""
        row = round((t_s - self._first_s) / self._period_s)
        if row >= len(self._block):
            self._compute(t_s)
            row = 0
        return self._block[row].tolist()

    def _compute(self, t_s: float) -> None:
        instants = np.array([self._time_s(t_s + i * self._period_s) for i in range(_BLOCK)])
        known = instants <= self._robot.time_s + 1e-12  # the plant may have been computed further ahead
        instants = instants[: max(1, int(known.sum()))]
        instants[0] = min(instants[0], self._robot.plant.time_s)
        wrench = self._robot.plant.wrench(instants) + self._noise.next(len(instants))
        self._first_s, self._block = t_s, quantise(wrench, self._robot.spec.noise.wrench_resolution)


class VirtualPlate(PlateOnHostClock):
    """A plate whose bytes come out of a fake one, parsed as a real one's would be.

    Args:
        robot: what stands on it.
        time: the shared virtual time.
        robot_time_s: robot's time at a virtual time [ns].
        seed: of its noise and of the host's waiting times.
        faults: to inject, timed from the stream's start.
        protocol: how it speaks, the reference plate by default.
    """

    port = "the simulated plate"

    def __init__(
        self, robot: VirtualRobot, time: VirtualTime, robot_time_s: Callable[[int], float], seed: int,
        faults: Sequence[Fault] = (), protocol: PlateProtocol | None = None,
    ) -> None:
        super().__init__(protocol or protocol_named("bota"), USB_CDC)
        self._robot, self._time, self._robot_time_s, self._seed = robot, time, robot_time_s, seed
        self._faults = faults
        self._random = np.random.default_rng([seed, 0x9A7E])
        self._parser = PlateParser(self.protocol)
        self._emissions: Iterator[Emission] = iter(())
        self._waiting: list[PlateSample] = []
        self._begun_ns = self._due_ns = self._read_ns = self._heard_ns = 0
        self._next: Emission | None = None
        self._is_gone = False

    def start(self) -> Sequence[str]:
        """Begin to stream now."""
        spec = self._robot.spec.plate
        drift = -1e-6 * spec.clock_ppm if spec is not None else 0.0
        period_s = sample_period_s(self.protocol) * (1.0 + drift)
        self._begun_ns = self._due_ns = self._read_ns = self._heard_ns = self._time.now_ns()
        load = RobotLoad(self._robot, self._seed, self._robot_time, period_s)
        fake = FakePlate(self.protocol, load, faults=self._faults, drift=drift, seed=self._seed)
        self._block_ns = round(_BLOCK * period_s * 1e9)
        self._emissions = fake.emissions()
        return ()

    def rest(self) -> PlateRest:
        """Let a second pass and average it."""
        self._waiting += self._receive(self._time.now_ns())
        self._time.run(round(_REST_S * 1e9))
        samples = self._receive(self._time.now_ns())
        self._waiting += samples
        found = tare_of(samples)
        return PlateRest(found.mean, found.std, found.count)

    def poll(self) -> Sequence[PlateSample]:
        """The samples so far; looked for a block at a time."""
        now_ns = self._time.now_ns()
        if now_ns < self._due_ns:
            return ()
        self._due_ns = now_ns + self._block_ns
        samples = self._waiting + self._receive(now_ns)
        self._waiting = []
        if not samples and self._is_gone:
            raise PlateUnpluggedError(self.port, "no such device")
        if not samples and now_ns - self._heard_ns > _STALL_S * 1e9:
            raise PlateStalledError(self.port, (now_ns - self._heard_ns) * 1e-9, _STALL_S)
        return samples

    def stop(self) -> None:
        """End the stream."""
        self._emissions = iter(())

    def _robot_time(self, t_s: float) -> float:
        return self._robot_time_s(self._begun_ns + round(t_s * 1e9))

    def _receive(self, now_ns: int) -> list[PlateSample]:
        """Parse what has arrived by now, less what physics does not know yet (the fake looks one ahead)."""
        samples: list[PlateSample] = []
        now_ns -= 3 * self._block_ns // _BLOCK
        while (emission := self._next or next(self._emissions, None)) is not None:
            self._next = emission
            if self._begun_ns + round(emission.due_s * 1e9) > now_ns:
                break
            self._next = None
            if emission.is_end:
                self._is_gone = True
                break
            samples += self._parser.feed(emission.data, self._arrival_ns(emission)) if emission.data else []
        if samples:
            self._heard_ns = now_ns
        return samples

    def _arrival_ns(self, emission: Emission) -> int:
        floor_s = self.transport.floor_s
        waited_s = floor_s + float(self._random.exponential(_WAIT_MEAN_S))
        arrival_ns = self._begun_ns + round((emission.due_s + waited_s) * 1e9)
        self._read_ns = max(self._read_ns, arrival_ns)
        return self._read_ns
