"""The fake drive as a device: SDO, PDO rules, heartbeats, options; asked through the library's client."""

import struct
from itertools import pairwise

import pytest

from drivers.canopen import objects as od
from drivers.canopen.bus import DriveBus
from drivers.canopen.config import AxisConfig, BusConfig
from drivers.canopen.fake.contents import DriveData
from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.fake.segment import SimulatedSegment
from drivers.errors import ReadBackError, SdoFailedError


@pytest.fixture
def booted():
    """One booted drive: its bus, its SDO access, the fake itself and the segment."""
    fleet = Fleet([DriveData(node=7, device_name="a name longer than seven bytes, twice over")])
    segment = SimulatedSegment(fleet)
    config = BusConfig(axes=(AxisConfig(name="joint_1", node=7, gear_ratio=100.0),))
    with DriveBus(config, segment) as bus:
        bus.boot()
        yield bus, bus._nodes[0], fleet.drives[0], segment


def drain(segment, duration_ns=20_000_000):
    frames, end_ns = [], segment.now_ns() + duration_ns
    while (frame := segment.receive(end_ns)) is not None:
        frames.append(frame)
    return frames


def test_strings_come_in_segments(booted):
    _, node, _, _ = booted
    assert node.read_text(0x1008) == "a name longer than seven bytes, twice over"
    assert node.read_text(0x1009) == ""


def test_segmented_download_is_taken(booted):
    _, node, _, _ = booted
    node._client.download(0x6065, 0, struct.pack("<I", 777), force_segment=True)
    assert node.read(od.Entry(0x6065, 0, "I", "window")) == 777


def test_refusals_carry_object_and_reason(booted):
    _, node, _, _ = booted
    with pytest.raises(SdoFailedError, match=r"joint_1 \(node 7\).*2000h:0.*does not exist"):
        node.read(od.Entry(0x2000, 0, "B", "nothing"))
    with pytest.raises(SdoFailedError, match="Subindex does not exist"):
        node.read(od.Entry(0x6091, 9, "B", "nothing"))
    with pytest.raises(SdoFailedError, match="read only"):
        node.put(od.POSITION, 5)
    with pytest.raises(SdoFailedError, match="length code"):
        node.put(od.Entry(0x6007, 0, "i", "too long"), 1)


def test_a_pdo_in_use_cannot_be_remapped(booted):
    _, node, _, _ = booted
    with pytest.raises(SdoFailedError, match="1A00h:0"):
        node.put(od.Entry(0x1A00, 0, "B", "count"), 0)


def test_the_pdos_carry_what_the_session_expects(booted):
    _, node, drive, _ = booted
    assert [hex(a >> 8) for a, _ in drive.dictionary.mapped(0x1600)] == ["0x6040", "0x607a"]
    assert [hex(a >> 8) for a, _ in drive.dictionary.mapped(0x1A00)] == ["0x6041", "0x6064", "0x6078"]
    assert [hex(a >> 8) for a, _ in drive.dictionary.mapped(0x1A01)] == ["0x6062", "0x606c"]
    assert node.read(od.Entry(0x1800, 2, "B", "type")) == 1
    assert node.read(od.Entry(0x1401, 1, "I", "unused")) >> 31 == 1


def test_a_value_that_does_not_read_back_is_an_error(booted):
    _, node, drive, _ = booted
    drive.dictionary.before_read = lambda: drive.dictionary.values.update({0x600700: 1})
    with pytest.raises(ReadBackError, match=r"given 2 for 6007h:0.*reads back 1"):
        node.write(od.ABORT_OPTION, 2)


def test_a_silent_drive_is_an_error_in_time(booted):
    bus, node, drive, segment = booted
    drive.on_nmt(0x02, segment.now_ns())
    before_ns = segment.now_ns()
    with pytest.raises(SdoFailedError, match="no answer in time"):
        node.read(od.POSITION)
    assert segment.now_ns() - before_ns <= 2.1 * bus.config.deadlines.sdo_s * 1e9
    drive.on_nmt(0x01, segment.now_ns())


def test_an_rpdo_of_wrong_length_is_reported_by_the_drive(booted):
    _, _, _, segment = booted
    segment.send(0x207, b"\x06\x00")
    emergencies = [frame for frame in drain(segment) if frame.identifier == 0x087]
    assert [frame.data[:2] for frame in emergencies] == [b"\x10\x82"]


def test_heartbeats_come_at_their_period(booted):
    bus, _, _, segment = booted
    beats = [frame.stamp_ns for frame in drain(segment, 140_000_000) if frame.identifier == 0x707]
    gaps = [b - a for a, b in pairwise(beats)]
    assert gaps
    assert gaps == [bus.config.heartbeat_ms * 1_000_000] * len(gaps)


def test_lower_identifiers_win_the_wire(booted):
    _, _, _, segment = booted
    segment.send(0x207, b"\x06\0\0\0\0\0")
    segment.send(0x080, b"")
    frames = [frame.identifier for frame in drain(segment, 5_000_000)]
    assert frames[0] == 0x080
    assert frames[1:3] == [0x187, 0x287]


@pytest.mark.parametrize("deceleration", [5.0, 50.0])
def test_quick_stop_takes_the_time_of_its_ramp(deceleration):
    fleet = Fleet([DriveData(node=1, quick_stop_rad_s2=deceleration)])
    segment = SimulatedSegment(fleet)
    config = BusConfig(axes=(AxisConfig(name="joint_1", node=1, gear_ratio=100.0),))
    with DriveBus(config, segment) as bus:
        bus.boot()
        bus.enable()
        for k in range(60):
            bus.cycle([0.5 * k / 150.0])
        report = bus.stop("operator pressed stop")
    assert report.stopped
    took_s = (report.ladder[-1][1] - report.ladder[0][1]) * 1e-9
    assert 0.5 / deceleration <= took_s <= 0.5 / deceleration + 0.04
