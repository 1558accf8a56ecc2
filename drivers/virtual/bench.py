"""A whole laboratory in virtual time: the virtual robot behind fake CiA 402 drives and a fake plate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.canopen.bus import DriveBus
from drivers.canopen.config import AxisConfig, BusConfig
from drivers.canopen.fake.contents import DriveData
from drivers.canopen.fake.dictionary import key
from drivers.canopen.fake.faults import FaultPlan
from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.fake.segment import SimulatedSegment
from drivers.canopen.profile import common_period_us, load_profile
from drivers.canopen.sample import CycleSample
from drivers.force_plate.faults import Fault as PlateFault
from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.effects.scales import noise_a
from drivers.virtual.foresight import ForesightPlant
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.plate import VirtualPlate
from drivers.virtual.record import EPOCH_NS
from drivers.virtual.robot import VirtualRobot
from drivers.virtual.trajectories import joint_limits
from drivers.virtual.urdf_tree import read_tree

_ENCODER_COUNTS = 131_072  # 17 bits, usual for servo motors
_RATING_PER_NOISE = 100.0  # rated current per noise: the drive's 1/1000 then resolves a tenth of the noise
_PEAK_PER_RATING = 20.0  # 6078h reaches 32 times the rated current
_WINDOW = key(0x6065)
_LAG_CYCLES = 6.0  # set points take this long to be reached, at the most


@dataclass(frozen=True)
class VirtualClock:
    """The segment's time; its day begins at the same instant in every run."""

    segment: SimulatedSegment

    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self.segment.now_ns()

    def wall_ns(self) -> int:
        """Virtual time of day [ns since 1970]."""
        return EPOCH_NS + self.segment.now_ns()


class VirtualDriveBus(DriveBus):
    """A bus whose simulated drives lock their interpolation to the first SYNC and may know the script."""

    def __init__(
        self, config: BusConfig, link: SimulatedSegment, plant: ForesightPlant
    ) -> None:
        super().__init__(config, link)
        self._plant, self._fleet = plant, link.fleet

    def foresee(self, targets_rad: np.ndarray) -> None:
        """Tell the simulation the set points (n, k) [rad] to come: it then computes in blocks."""
        columns = [
            np.rint(targets_rad[:, j] / axis.units.rad_per_count) * drive.data.rad_per_count
            for j, (axis, drive) in enumerate(zip(self._axes, self._fleet.drives, strict=True))
        ]
        self._plant.foresee(np.column_stack(columns))

    def cycle(self, targets_rad: Sequence[float]) -> CycleSample:
        """Run one SYNC cycle."""
        self._plant.expect(self._ledger.cycle + 1)
        return super().cycle(targets_rad)

    def enable(self) -> CycleSample:
        """Start SYNC and enable every drive; faults count from the first set point."""
        self._plant.anchor(self._link.now_ns())
        sample = super().enable()
        self._fleet.plan.arm(self.sync)
        return sample


@dataclass(frozen=True)
class VirtualBench:
    """Everything that a run needs, and what tests look at."""

    robot: VirtualRobot
    plant: ForesightPlant
    fleet: Fleet
    segment: SimulatedSegment
    drives: VirtualDriveBus
    plate: VirtualPlate | None
    clock: VirtualClock


def open_bench(
    spec: PlantSpec,
    rate_hz: float = 150.0,
    seed: int = 0,
    effects: Sequence[EffectSpec] = (),
    start_q: np.ndarray | None = None,
    plan: FaultPlan | None = None,
    plate_faults: Sequence[PlateFault] = (),
) -> VirtualBench:
    """Put a virtual robot on its bench.

    Args:
        spec: the plant.
        rate_hz: SYNC rate.
        seed: of all noise.
        effects: on top of the plant.
        start_q: joint angles (k,) at rest; zero (or the nearest limit) where not given.
        plan: faults of bus and drives.
        plate_faults: faults of the plate and its line.
    """
    config = virtual_bus(spec, rate_hz)
    robot, plant, fleet = virtual_fleet(spec, config, seed, effects, start_q, plan)
    segment = SimulatedSegment(fleet, config.can.bitrate_hz)
    drives = VirtualDriveBus(config, segment, plant)
    plate = None
    if spec.plate is not None:
        plate = VirtualPlate(robot, segment, plant.robot_time_s, seed, plate_faults)
    return VirtualBench(robot, plant, fleet, segment, drives, plate, VirtualClock(segment))


def virtual_bus(spec: PlantSpec, rate_hz: float, profile: str = "generic") -> BusConfig:
    """The bus of a virtual robot: nodes 1, 2, ... in joint order."""
    axes = tuple(
        AxisConfig(
            name=joint.name, node=index + 1, gear_ratio=joint.gear_ratio, serial=index + 1, profile=profile
        )
        for index, joint in enumerate(spec.joints)
    )
    return BusConfig(axes=axes, rate_hz=rate_hz)


def virtual_fleet(
    spec: PlantSpec, config: BusConfig, seed: int, effects: Sequence[EffectSpec],
    start_q: np.ndarray | None, plan: FaultPlan | None,
) -> tuple[VirtualRobot, ForesightPlant, Fleet]:
    """The robot, its coupling to the bus, and its fake drives."""
    robot = robot_on(spec, config, seed, effects, start_q)
    plant = ForesightPlant(robot, seed)
    fleet = Fleet([nameplate(spec, index) for index in range(len(spec.joints))], plant, plan)
    widen_windows(fleet, spec, robot.plant.period_s)
    return robot, plant, fleet


def robot_on(
    spec: PlantSpec, config: BusConfig, seed: int, effects: Sequence[EffectSpec], start_q: np.ndarray | None
) -> VirtualRobot:
    """The robot at rest, its drives interpolating with the bus' SYNC period."""
    period_s = 1e-6 * common_period_us([load_profile(axis.profile) for axis in config.axes], config.rate_hz)
    lower, upper, _ = joint_limits(spec)
    start = np.clip(np.zeros(len(spec.joints)), lower, upper) if start_q is None else start_q
    return VirtualRobot(spec, effects, seed, period_s, start)


def widen_windows(fleet: Fleet, spec: PlantSpec, period_s: float) -> None:
    """Set each drive's following error window (6065h) to what its fastest motion needs."""
    for drive, fastest in zip(fleet.drives, joint_limits(spec)[2], strict=True):
        window_rad = 0.05 + _LAG_CYCLES * period_s * float(fastest)
        drive.dictionary.values[_WINDOW] = round(window_rad / abs(drive.data.rad_per_count))


def nameplate(spec: PlantSpec, index: int) -> DriveData:
    """A drive of the size that the joint needs, current resolved to a tenth of its noise."""
    joint = spec.joints[index]
    effort_nm = read_tree(spec.urdf_text).joint(joint.name).effort
    peak_a = effort_nm / (joint.gear_ratio * joint.torque_constant_nm_a)
    rated_a = max(_RATING_PER_NOISE * noise_a(spec, index), peak_a / _PEAK_PER_RATING, 0.5)
    return DriveData(
        node=index + 1, serial=index + 1, gear_ratio=joint.gear_ratio, encoder_counts=_ENCODER_COUNTS,
        rated_current_ma=max(1, round(1e3 * rated_a)),
    )
