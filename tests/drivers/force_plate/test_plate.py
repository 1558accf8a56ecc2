"""A plate on a pseudo-terminal in real time: commands, bulk reads, tare, stalls, unplugging."""

from __future__ import annotations

import os
import tty

import numpy as np
import pytest

from drivers.errors import DriverError, HardwareError
from drivers.force_plate.errors import (
    PlateNotFoundError,
    PlateNotStillError,
    PlateRefusedError,
    PlateStalledError,
    PlateUnpluggedError,
)
from drivers.force_plate.fake import FakePlate
from drivers.force_plate.fake_port import FakePort, FakePortProcess
from drivers.force_plate.faults import Fault
from drivers.force_plate.latency_timer import UDEV_RULE, latency_timer
from drivers.force_plate.mounting import Mounting
from drivers.force_plate.plate import ForcePlate
from drivers.force_plate.protocols.bota import Bota
from drivers.force_plate.protocols.protocol import Exchange
from drivers.force_plate.tare import Tare, tare_drift
from drivers.force_plate.wrench_source import ConstantLoad
from tests.drivers.force_plate.streams import NAMES, SINGLE

WEIGHT = ConstantLoad((5.0, -3.0, 90.0, 0.5, -0.4, 0.3))


class HastyBota(Bota):
    """A Bota that need not boot."""

    @property
    def startup(self):
        return (Exchange(b"C", b"r,0,C,0", timeout_s=0.2),)


def collect(plate: ForcePlate, count: int) -> list:
    samples = []
    while len(samples) < count:
        samples += plate.read(timeout_s=1.0)
    return samples


@pytest.mark.parametrize("name", NAMES)
def test_every_protocol_over_a_port(name):
    with FakePort(FakePlate(SINGLE[name], WEIGHT)) as fake, ForcePlate(SINGLE[name], fake.port) as plate:
        plate.start()
        samples = collect(plate, 60)
        plate.stop()
        health = plate.health
    np.testing.assert_allclose([s.wrench for s in samples], [WEIGHT.wrench] * len(samples), atol=0.06)
    assert health.lost == health.skipped_bytes == health.overloaded == 0
    ticks = np.diff([s.ticks for s in samples])
    assert ticks.min() > 0
    assert np.diff([s.read_ns for s in samples]).min() >= 0


def test_start_and_stop_again():
    with FakePort(FakePlate(SINGLE["bota"], WEIGHT)) as fake, ForcePlate(SINGLE["bota"], fake.port) as plate:
        for _ in range(2):
            plate.start()
            collect(plate, 5)
            assert plate.health.lost == 0  # what the device took while it was stopped is not lost
            plate.stop()


def test_a_device_in_another_process_with_a_bad_line():
    faults = (Fault("garbage", probability=0.2), Fault("split", probability=0.2), Fault("drop", 0.2, 9, 0.05))
    fake_plate = FakePlate(SINGLE["bota"], WEIGHT, faults=faults, seed=3)
    with FakePortProcess(fake_plate) as fake, ForcePlate(SINGLE["bota"], fake.port) as plate:
        plate.start()
        samples = collect(plate, 150)
    lost_by_index = round((samples[-1].ticks - samples[0].ticks) / 6660.15625) + 1 - len(samples)
    assert sum(s.lost for s in samples[1:]) == lost_by_index > 0


def test_tare_and_overload():
    faults = (Fault("overload", 0.6, 99.0),)
    fake_plate = FakePlate(SINGLE["bota"], WEIGHT, faults=faults, noise=(0.5,) * 6)
    with FakePort(fake_plate) as fake, ForcePlate(SINGLE["bota"], fake.port) as plate:
        plate.start()
        tare = plate.tare(0.4)
        np.testing.assert_allclose(tare.mean, WEIGHT.wrench, atol=0.5 * 6 / np.sqrt(tare.count))
        assert tare.count >= 60
        collect(plate, 60)
        with pytest.raises(PlateNotStillError, match="overloaded"):
            plate.tare(0.2)
        assert plate.health.overloaded > 0


def test_a_stall_is_reported_by_its_deadline():
    fake_plate = FakePlate(SINGLE["bota"], WEIGHT, faults=[Fault("stall", 0.2)])
    with (
        FakePort(fake_plate) as fake,
        ForcePlate(SINGLE["bota"], fake.port, stall_s=0.3) as plate,
    ):
        plate.start()
        with pytest.raises(PlateStalledError, match=r"no intact sample for 0\.\d+ s") as caught:
            collect(plate, 10_000)
        assert caught.value.silent_s > 0.3


def test_unplugging_is_a_hardware_error_after_the_last_samples():
    fake_plate = FakePlate(SINGLE["bota"], WEIGHT, faults=[Fault("unplug", 0.3)])
    with FakePort(fake_plate) as fake, ForcePlate(SINGLE["bota"], fake.port) as plate:
        plate.start()
        samples = []
        with pytest.raises(PlateUnpluggedError, match="unplugged while it was read"):
            while True:
                samples += plate.read(timeout_s=1.0)
    assert 1 <= len(samples) <= 46  # the last bytes may vanish with the line
    assert issubclass(PlateUnpluggedError, HardwareError) and issubclass(HardwareError, DriverError)
    assert PlateUnpluggedError.exit_code == 3


def test_a_missing_port_and_a_mute_device_are_named():
    with pytest.raises(PlateNotFoundError, match="no such file or directory"):
        ForcePlate(SINGLE["bota"], "/dev/no_such_plate").open()
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        with ForcePlate(HastyBota(), os.ttyname(slave)) as plate:
            with pytest.raises(PlateRefusedError, match=r"did not acknowledge b'C'.*got nothing"):
                plate.start()
            assert os.read(master, 100) == b"C"
    finally:
        os.close(master)
        os.close(slave)


def test_latency_timer_is_read_and_the_remedy_named(tmp_path):
    (tmp_path / "ttyUSB7").mkdir()
    (tmp_path / "ttyUSB7" / "latency_timer").write_text("16\n")
    link = tmp_path / "by-id-plate"
    link.symlink_to("/dev/ttyUSB7")
    timer = latency_timer(str(link), tmp_path)
    assert timer is not None and timer.value_ms == 16 and not timer.is_good
    assert "16 ms" in timer.remedy and UDEV_RULE in timer.remedy
    (tmp_path / "ttyUSB7" / "latency_timer").write_text("1\n")
    assert latency_timer("/dev/ttyUSB7", tmp_path).is_good
    assert latency_timer("/dev/ttyACM0", tmp_path) is None


def test_opening_warns_of_a_slow_converter(tmp_path):
    with FakePort(FakePlate(SINGLE["bota"])) as fake:
        plate = ForcePlate(SINGLE["bota"], fake.port, sysfs_root=tmp_path)
        assert plate.open() == ()
        plate.close()
        timer = tmp_path / os.path.basename(fake.port) / "latency_timer"
        timer.parent.mkdir()
        timer.write_text("16")
        (warning,) = plate.open()
        plate.close()
    assert "16 ms" in warning


def test_drift_between_tares():
    before = Tare((0.0,) * 6, (1.0,) * 6, 150)
    same = tare_drift(before, Tare((0.1, 1.9, 0, 0, 0, 0.1), (1.0,) * 6, 150))
    assert same.drifted == () and same.sentence == ""
    moved = tare_drift(before, Tare((0, 0, 4.0, 0, -0.7, 0), (1.0,) * 6, 150))
    assert moved.drifted == ("force.z", "torque.y")
    assert "force.z by +4.00" in moved.sentence
    noisy = tare_drift(before, Tare((0, 0, 4.0, 0, 0, 0), (30.0,) * 6, 150))
    assert noisy.drifted == ()  # 4 N is two standard errors there


def test_mounting_gives_the_plates_wrench_on_the_robot():
    """A sensor with z down that reports the robot's weight: m g along its z is + m g along the plate's."""
    flipped = Mounting(((1, 0, 0), (0, -1, 0), (0, 0, -1)), is_action=True)
    np.testing.assert_allclose(flipped.apply(np.array([1.0, 2, 90, 3, 4, 5])), [-1, 2, 90, -3, 4, 5])
    with pytest.raises(DriverError, match="no rotation"):
        Mounting(((1, 0, 0), (0, 1, 0), (0, 0, 2)))
