"""The virtual laboratory in real time, in a process of its own: drives on a socket, the plate on a pty."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

import numpy as np

from daq.realtime import precedence
from drivers.canopen.bus import DriveBus
from drivers.canopen.config import BusConfig
from drivers.canopen.fake.contents import DriveData
from drivers.canopen.fake.faults import Fault, FaultPlan
from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.fake.robot_plant import RobotPlant
from drivers.canopen.fake.socket_bus import SocketLink, serve_fleet
from drivers.canopen.sample import CycleSample
from drivers.errors import LinkError
from drivers.force_plate.fake import FakePlate
from drivers.force_plate.fake_port import FakePort
from drivers.force_plate.faults import Fault as PlateFault
from drivers.force_plate.port import SerialPlate
from drivers.force_plate.protocols import protocol_named
from drivers.virtual.bench import nameplate, robot_on, virtual_bus, widen_windows
from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.record import wrench_noise
from drivers.virtual.robot import VirtualRobot
from drivers.virtual.sensors import quantise, stream_generator

_START_S = 60.0
_RUNNING_NS = 100_000_000
"""SYNCs this recent mean that the robot moves and its future must be waited for."""

_LONGEST_WAIT_S = 0.05
_PATIENCE = 10.0  # heartbeats
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


@dataclass(frozen=True)
class LiveSettings:
    """What the laboratory is made of.

    Attributes:
        spec: the plant.
        rate_hz: SYNC rate.
        seed: of all noise.
        effects: on top of the plant.
        start_q: joint angles (k,) at rest.
        faults: of bus and drives, counted from the first set point.
        plate_faults: of the plate, timed from the start of its stream.
        profile: of the drives.
    """

    spec: PlantSpec
    rate_hz: float = 150.0
    seed: int = 0
    effects: tuple[EffectSpec, ...] = ()
    start_q: np.ndarray | None = None
    faults: tuple[Fault, ...] = ()
    plate_faults: tuple[PlateFault, ...] = field(default_factory=tuple)
    profile: str = "generic"

    @property
    def bus(self) -> BusConfig:
        """The bus that its drives are on; patient, because a busy machine stalls simulated drives too."""
        bus = virtual_bus(self.spec, self.rate_hz, self.profile)
        return bus.model_copy(update={"heartbeat_patience": _PATIENCE})


class LiveLoad:
    """The wrench under the robot now; waits for the robot where the plate is ahead of it."""

    def __init__(self, robot: VirtualRobot, plant: RobotPlant, lock: threading.Lock, seed: int) -> None:
        self._robot, self._plant, self._lock = robot, plant, lock
        self._noise = wrench_noise(robot.spec, stream_generator(seed, "wrench noise"))
        self._begun_ns = 0
        self.sync_ns = 0

    def sample(self, t_s: float) -> Sequence[float]:
        """Force [N] and torque [N.m] at ``t_s`` seconds after the stream's start."""
        if t_s == 0.0:
            self._begun_ns = time.monotonic_ns()
        instant_ns = self._begun_ns + round(t_s * 1e9)
        until_s = instant_ns * 1e-9 + _LONGEST_WAIT_S
        while True:
            with self._lock:
                ahead_s = self._plant.robot_time_s(instant_ns) - self._robot.plant.time_s
                moving = time.monotonic_ns() - self.sync_ns < _RUNNING_NS
                if ahead_s <= 0.0 or not moving or time.monotonic() > until_s:
                    return self._now(self._robot.plant.time_s + min(ahead_s, 0.0))
            time.sleep(min(max(ahead_s, 2e-4), 5e-3))

    def _now(self, robot_s: float) -> Sequence[float]:
        wrench = self._robot.plant.wrench(np.array([robot_s]))[0] + self._noise.next(1)[0]
        return quantise(wrench, self._robot.spec.noise.wrench_resolution).tolist()


class LiveDriveBus(DriveBus):
    """A bus whose fake drives, and their process, end with it."""

    def __init__(self, config: BusConfig, link: SocketLink, lab: LiveLab) -> None:
        super().__init__(config, link)
        self._lab = lab

    def enable(self) -> CycleSample:
        """Start SYNC and enable every drive; faults count from the next set point."""
        sample = super().enable()
        self._lab.arm(self.sync)
        return sample


class LiveLab:
    """The laboratory's process, seen from the host."""

    def __init__(self, settings: LiveSettings) -> None:
        for name in _THREADS:
            os.environ.setdefault(name, "1")
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        context = multiprocessing.get_context("spawn")
        self._pipe, far = context.Pipe()
        self._process = context.Process(target=_run, args=(settings, theirs, far), daemon=True)
        self._process.start()
        theirs.close()
        far.close()
        try:
            plate_port = self._pipe.recv() if self._pipe.poll(_START_S) else None
        except EOFError:
            plate_port = None
        if plate_port is None:
            raise LinkError("The virtual laboratory did not start; run the command again.")
        self.drives = LiveDriveBus(settings.bus, SocketLink(ours), self)
        self.plate = SerialPlate(protocol_named("bota"), plate_port) if plate_port else None

    def arm(self, sync: int) -> None:
        """Let the faults count from this SYNC."""
        self._pipe.send(sync)

    def close(self) -> None:
        """End the process."""
        with contextlib.suppress(OSError):
            self._pipe.close()
        self._process.join(timeout=5.0)
        if self._process.is_alive():
            self._process.kill()


def _run(settings: LiveSettings, end: socket.socket, pipe: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C concerns the host, whose drives it must still stop
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    precedence()
    sys.setswitchinterval(5e-4)  # the plate's thread must not keep the drives waiting
    spec, config = settings.spec, settings.bus
    robot = robot_on(spec, config, settings.seed, settings.effects, settings.start_q)
    plant = RobotPlant(robot)
    plan = FaultPlan(settings.faults)
    fleet = Fleet(_nameplates(spec), plant, plan)
    widen_windows(fleet, spec, robot.plant.period_s)
    lock = threading.Lock()
    load = LiveLoad(robot, plant, lock, settings.seed)

    def on_sync(now_ns: int) -> None:
        if now_ns - load.sync_ns > _RUNNING_NS:
            plant.anchor(now_ns)
        load.sync_ns = now_ns
        if pipe.poll():
            with contextlib.suppress(EOFError, OSError):
                plan.arm(pipe.recv())

    with contextlib.ExitStack() as stack:
        port = ""
        if spec.plate is not None:
            protocol, drift = protocol_named("bota"), -1e-6 * spec.plate.clock_ppm
            fake = FakePlate(protocol, load, faults=settings.plate_faults, drift=drift, seed=settings.seed)
            port = stack.enter_context(FakePort(fake)).port
        pipe.send(port)
        with contextlib.suppress(OSError):
            serve_fleet(end, fleet, lock, on_sync)
        with contextlib.suppress(EOFError, OSError):
            pipe.recv()  # the plate lives until the host has gone


def _nameplates(spec: PlantSpec) -> list[DriveData]:
    return [nameplate(spec, index) for index in range(len(spec.joints))]
