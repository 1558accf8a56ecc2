"""The virtual robot behind the fake drives: what goes in as set points comes out as motion and current."""

import numpy as np
import pytest

from drivers.canopen.bus import DriveBus
from drivers.canopen.config import AxisConfig, BusConfig
from drivers.canopen.fake.contents import DriveData
from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.fake.robot_plant import RobotPlant
from drivers.canopen.fake.segment import SimulatedSegment
from drivers.virtual.plant_file import load_plant
from drivers.virtual.robot import VirtualRobot

PERIOD_S = 6.667e-3


@pytest.fixture(scope="module")
def session():
    """Three seconds of a slow cosine of all joints; returns bus report, boot report, samples, set points."""
    spec = load_plant("ir361").quiet()
    robot = VirtualRobot(spec, command_period_s=PERIOD_S)
    count = len(spec.joints)
    fleet = Fleet([DriveData(node=i + 1, rated_current_ma=20_000) for i in range(count)], RobotPlant(robot))
    axes = [AxisConfig(name=joint, node=i + 1, gear_ratio=100.0) for i, joint in enumerate(spec.joint_names)]
    time_s = PERIOD_S * np.arange(450)
    targets = np.outer(0.1 * (1.0 - np.cos(2.0 * np.pi * time_s / 3.0)), np.ones(count))
    with DriveBus(BusConfig(axes=tuple(axes)), SimulatedSegment(fleet)) as bus:
        boot = bus.boot()
        bus.enable()
        samples = [bus.cycle(row) for row in targets]
        report = bus.stop()
    return boot, samples, targets, report


def test_the_session_is_complete(session):
    assert session[3].sentence == "The session is complete: 450 cycles, 0 missing."


def test_positions_follow_the_set_points_smoothly(session):
    boot, samples, targets, _ = session
    for axis, units in enumerate(entry.units for entry in boot.axes):
        position = np.array([units.position_rad(sample.position[axis]) for sample in samples])
        assert np.abs(position[3:] - targets[:-3, axis]).max() < 0.02
        assert np.abs(np.diff(position, 2)).max() < 1e-4


def test_velocity_and_current_are_there(session):
    boot, samples, targets, _ = session
    units = boot.axes[1].units
    velocity = np.array([units.velocity_rad_s(sample.velocity[1]) for sample in samples])
    current = np.array([units.current_a(sample.current[1]) for sample in samples])
    expected = np.gradient(targets[:, 1], PERIOD_S)
    assert np.corrcoef(velocity[5:], expected[:-5])[0, 1] > 0.98
    assert np.ptp(current) > 0.1


def test_a_jittering_sync_neither_repeats_nor_drops_a_set_point():
    robot = VirtualRobot(load_plant("ir361").quiet(), command_period_s=PERIOD_S)
    plant = RobotPlant(robot)
    jitter_ns = np.random.default_rng(5).integers(-100_000, 100_000, 200)
    positions = []
    for k, late_ns in enumerate(jitter_ns):
        plant.advance_to(round(k * PERIOD_S * 1e9) + int(late_ns))
        positions.append(plant.axes[0].sample()[0])
        for axis in plant.axes:
            axis.set_target(0.1 * (1.0 - np.cos(2.0 * np.pi * k * PERIOD_S)))
    largest_step_rad = 0.1 * 2.0 * np.pi * PERIOD_S
    assert np.abs(np.diff(positions, 2)).max() < 0.2 * largest_step_rad
