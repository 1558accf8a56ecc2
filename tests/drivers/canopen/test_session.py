"""Whole sessions: long runs, random losses, stalls, silence of the host, other modes and links."""

import time
from itertools import pairwise

import can
import pytest

from drivers.canopen.bus import DriveBus, Phase
from drivers.canopen.can_link import CanLink
from drivers.canopen.config import AxisConfig, BusConfig, CanConfig
from drivers.canopen.fake.axis import InertiaAxis, InertiaPlant
from drivers.canopen.fake.contents import DriveData
from drivers.canopen.fake.dictionary import key
from drivers.canopen.fake.faults import FaultKind, FaultPlan
from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.fake.realtime import RealTimeFleet
from drivers.canopen.fake.segment import SimulatedSegment
from drivers.canopen.ladder import Rung
from drivers.canopen.report import CauseKind
from drivers.canopen.sample import Flag
from drivers.errors import ConfigError, DriveStoppedError, LinkError, RateRefusedError

RATE_HZ = 150.0


def axes(count, **changes):
    return tuple(
        AxisConfig(**{"name": f"joint_{i}", "node": i, "gear_ratio": 100.0, **changes})
        for i in range(1, count + 1)
    )


def simulated(count=2, plan=None, plates=None, **changes):
    """A bus on a simulated segment, with its fleet and segment."""
    fleet = Fleet(plates or [DriveData(node=i) for i in range(1, count + 1)], plan=plan)
    segment = SimulatedSegment(fleet)
    config = BusConfig(**{"axes": axes(count), **changes})
    return DriveBus(config, segment), fleet, segment


def ready(bus, fleet):
    bus.boot()
    bus.enable()
    fleet.plan.arm(bus.sync)


def ramp(cycle, count):
    return [2e-4 * cycle] * count


def test_random_losses_are_all_detected_and_nothing_else_is():
    plan = FaultPlan(loss=2e-3, seed=7)
    bus, fleet, _ = simulated(7, plan)
    cycles = 1500
    with bus:
        ready(bus, fleet)
        samples = [bus.cycle(ramp(k, 7)) for k in range(cycles)]
        bus.stop()
    report = bus.report()
    lost = {
        (i.cycle, f"joint_{i.node}")
        for i in plan.log
        if i.kind is FaultKind.LOST_TPDO and i.cycle < cycles
    }
    assert len(lost) > 20
    assert {(entry.cycle, entry.axis) for entry in report.missing} == lost
    unseen = {
        (sample.cycle, f"joint_{axis + 1}")
        for sample in samples
        for axis, flags in enumerate(sample.flags)
        if flags & Flag.MISSING_MOTION
    }
    missed = {
        (i.cycle + 1, f"joint_{i.node}")
        for i in plan.log
        if i.kind is FaultKind.LOST_RPDO and i.cycle + 1 < cycles
    }
    assert len(missed) > 10
    assert {(entry.cycle, entry.axis) for entry in report.torn} == missed - unseen


def test_samples_are_latched_at_their_sync_and_follow_the_targets():
    bus, fleet, _ = simulated(2)
    with bus:
        ready(bus, fleet)
        samples = [bus.cycle(ramp(k, 2)) for k in range(50)]
    for before, after in pairwise(samples):
        assert after.sync_ns - before.sync_ns == pytest.approx(1e9 / RATE_HZ, rel=1e-3)
        assert after.demand == before.target
        assert after.stamp_ns[0] > after.sync_ns
    for early, late in zip(samples, samples[2:], strict=False):
        assert abs(late.position[0] - early.target[0]) <= 1


def test_a_session_in_virtual_time_repeats_exactly():
    def one():
        bus, fleet, _ = simulated(3, FaultPlan(loss=1e-3, seed=3))
        with bus:
            ready(bus, fleet)
            return [bus.cycle(ramp(k, 3)) for k in range(300)]

    assert one() == one()


def test_stalled_host_is_flagged_and_syncs_never_come_in_a_burst():
    bus, fleet, segment = simulated(3)
    period_ns = 6_667_000
    samples = []
    with bus:
        ready(bus, fleet)
        for k in range(60):
            if k in (10, 30):
                segment.run(2 * period_ns if k == 10 else period_ns * 6 // 10)
            samples.append(bus.cycle(ramp(k, 3)))
        bus.stop()
    gaps = [after.sync_ns - before.sync_ns for before, after in pairwise(samples)]
    assert min(gaps) >= 0.79 * period_ns
    assert max(gaps) > 2 * period_ns
    assert bus.report().late_syncs == (11,)
    assert not bus.report().missing
    assert not bus.report().torn


def test_host_that_falls_silent_stops_the_drives(bench):
    with bench() as made:
        made.run(5)
        assert not made.fleet.stopped
        made.pass_time(0.8)
        assert made.fleet.stopped
        with pytest.raises(DriveStoppedError) as caught:
            made.run_on(10)
    assert caught.value.report.cause.kind in (CauseKind.EMERGENCY, CauseKind.NOT_FOLLOWING)
    assert 0x8130 in [entry.code for entry in caught.value.report.emergencies]


def test_external_request_walks_the_ladder(bench):
    with bench() as made:
        made.run(5)
        made.bus.request_stop("The force plate is beyond its limit: 812 N where 500 N are allowed.")
        with pytest.raises(DriveStoppedError, match="812 N") as caught:
            made.run_on(3)
        assert made.fleet.stopped
    assert caught.value.report.cause.kind is CauseKind.EXTERNAL
    assert caught.value.report.ladder[0][0] is Rung.QUICK_STOP


def test_an_error_inside_the_session_stops_the_drives_and_closes():
    bus, fleet, _ = simulated(2)
    with pytest.raises(ZeroDivisionError), bus:
        ready(bus, fleet)
        bus.cycle([0.0, 0.0])
        raise ZeroDivisionError
    assert fleet.stopped
    assert bus.phase is Phase.CLOSED
    assert bus.report().cause.kind is CauseKind.OPERATOR
    assert bus.report().outcome == "failed"


def test_every_changed_setting_is_put_back():
    bus, fleet, segment = simulated(2)
    before = [dict(drive.dictionary.values) for drive in fleet.drives]
    with bus:
        ready(bus, fleet)
        assert fleet.drives[0].dictionary.values[key(0x6007)] == 3
        bus.cycle([0.0, 0.0])
    segment.run(10_000_000)
    process = {0x6040, 0x6041, 0x6061, 0x6062, 0x6064, 0x606C, 0x6078, 0x607A, 0x603F}
    for drive, values in zip(fleet.drives, before, strict=True):
        left = {entry for entry, value in drive.dictionary.values.items() if values[entry] != value}
        assert {entry >> 8 for entry in left} <= process
    assert bus.report().restore_failures == ()


def test_interpolated_mode_is_used_where_cyclic_synchronous_is_refused():
    bus, _, _ = simulated(2, plates=[DriveData(node=i, modes=(1, 7)) for i in (1, 2)])
    with bus:
        report = bus.boot()
        assert [axis.mode for axis in report.axes] == [7, 7]
        bus.enable()
        samples = [bus.cycle(ramp(k, 2)) for k in range(20)]
        bus.stop()
    assert bus.report().outcome == "complete"
    assert samples[-1].demand == samples[-2].target


def test_150_hz_is_refused_where_the_drive_cannot_run_it():
    config = BusConfig(axes=axes(2, profile="whole_milliseconds"), rate_hz=150.0)
    fleet = Fleet([DriveData(node=1), DriveData(node=2)])
    segment = SimulatedSegment(fleet)
    with pytest.raises(RateRefusedError, match=r"125, 166\.667, 200, 250") as caught:
        DriveBus(config, segment)
    assert caught.value.exit_code == 2
    assert segment.frames == 0


def test_too_many_axes_for_the_wire_are_refused():
    with pytest.raises(ConfigError, match="use at most"):
        simulated(25)


def test_calls_out_of_order_are_refused():
    bus, _, _ = simulated(1)
    with pytest.raises(ConfigError, match="not booted"):
        bus.enable()
    with pytest.raises(ConfigError, match="not running"):
        bus.cycle([0.0])
    bus.close()
    assert bus.close().outcome == "failed"  # nothing was run


@pytest.mark.parametrize("targets", [[0.0, float("nan")], [0.0, 1e9], [0.0]])
def test_a_set_point_that_cannot_be_sent_is_refused_and_the_drives_stop(targets):
    bus, fleet, _ = simulated(2)
    with pytest.raises(ConfigError, match="set point"), bus:
        ready(bus, fleet)
        bus.cycle([0.0, 0.0])
        bus.cycle(targets)
    assert fleet.stopped
    assert bus.report().cycles == 1


def test_inverted_drive_and_joint_read_in_joint_sense():
    plates = [DriveData(node=1), DriveData(node=2, polarity=0xC0)]
    plant = InertiaPlant([InertiaAxis(start_rad=0.1) for _ in plates])
    fleet = Fleet(plates, plant)
    config = BusConfig(axes=axes(2))
    with DriveBus(config, SimulatedSegment(fleet)) as bus:
        report = bus.boot()
        bus.enable()
        for k in range(100):
            sample = bus.cycle([0.1 + 2e-4 * k] * 2)
    one, two = report.axes
    assert sample.position[0] == -sample.position[1]
    assert one.units.position_rad(sample.position[0]) == pytest.approx(0.1 + 2e-4 * 97, abs=1e-6)
    assert two.units.position_rad(sample.position[1]) == pytest.approx(0.1 + 2e-4 * 97, abs=1e-6)
    assert two.units.velocity_rad_s(sample.velocity[1]) == pytest.approx(2e-4 * RATE_HZ, rel=1e-2)
    assert one.units.current_a(sample.current[0]) == pytest.approx(two.units.current_a(sample.current[1]))
    assert one.units.current_a(sample.current[0]) == pytest.approx((2.0 + 0.03) / 20.0, abs=0.006)


def test_foreign_sync_is_named(real_bench):
    with real_bench() as made:
        made.run(3)
        with can.Bus(interface="virtual", channel=made.bus._link._config.channel) as intruder:
            intruder.send(can.Message(arbitration_id=0x80, is_extended_id=False))
            with pytest.raises(DriveStoppedError, match="SYNC too"):
                made.run_on(3)


def test_error_frames_are_counted(real_bench):
    with real_bench() as made:
        made.run(2)
        with can.Bus(interface="virtual", channel=made.bus._link._config.channel) as sick:
            sick.send(can.Message(arbitration_id=0x04, is_error_frame=True, data=bytes(8)))
            made.run_on(2)
        report = made.bus.stop()
    assert report.outcome == "complete"
    assert report.error_frames == (("controller problem", 1),)


def test_a_stepped_wall_clock_does_not_move_the_stamps(monkeypatch):
    link = CanLink(CanConfig(interface="virtual", channel="stepped"))
    wall_s, wall_ns = time.time, time.time_ns
    with can.Bus(interface="virtual", channel="stepped") as other:
        for step_s in (0.0, 0.2, -3600.0):
            monkeypatch.setattr(time, "time", lambda step_s=step_s: wall_s() + step_s)
            monkeypatch.setattr(time, "time_ns", lambda step_s=step_s: wall_ns() + round(step_s * 1e9))
            before_ns = time.monotonic_ns()
            other.send(can.Message(arbitration_id=0x181, is_extended_id=False))
            frame = link.receive(before_ns + 1_000_000_000)
            assert before_ns - 1_000_000 <= frame.stamp_ns <= time.monotonic_ns()
    link.close()
    assert link.clock_steps == 2


@pytest.mark.parametrize("settings", [{"kernel_sync": True}, {"own_echo": False}])
def test_other_ways_to_produce_and_see_sync(settings):
    can_config = CanConfig(interface="virtual", channel=f"sync-{sorted(settings)[0]}", **settings)
    config = BusConfig(axes=axes(2), rate_hz=25.0, can=can_config, heartbeat_ms=200, heartbeat_patience=5.0)
    fleet = Fleet([DriveData(node=1), DriveData(node=2)])
    link = CanLink(can_config)
    with RealTimeFleet(fleet, can_config.channel), DriveBus(config, link) as bus:
        ready(bus, fleet)
        samples = [bus.cycle(ramp(k, 2)) for k in range(6)]
        bus.stop()
    assert bus.report().outcome == "complete"
    assert [sample.cycle for sample in samples] == list(range(6))


def test_unknown_interface_is_one_sentence():
    with pytest.raises(LinkError, match="no_such_adapter channel can7 could not be opened"):
        CanLink(CanConfig(interface="no_such_adapter", channel="can7"))


def test_closed_link_says_so():
    link = CanLink(CanConfig(interface="virtual", channel="closed"))
    link.close()
    link.close()
    with pytest.raises(LinkError, match="is closed"):
        link.send(0x80, b"")
