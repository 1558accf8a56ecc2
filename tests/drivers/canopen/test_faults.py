"""Every injectable fault, on both clocks: complete, or failed with the exact missing cycles, cause first."""

import pytest

from drivers.canopen.fake.faults import Fault, FaultKind
from drivers.canopen.ladder import Rung
from drivers.canopen.report import CauseKind
from drivers.canopen.sample import Flag
from drivers.errors import DriveStoppedError, IdentityError, ModeRefusedError, NodeMissingError

AT = 4
CYCLES = 10


def run(open_bench, *faults, cycles=CYCLES, **changes):
    """Run a session; returns its bench, its samples and its final report."""
    samples = []
    with open_bench(*faults, **changes) as bench:
        try:
            samples = bench.run(cycles)
            bench.bus.stop()
        except DriveStoppedError as error:
            bench.error = error
            if bench.bus.report().unconfirmed:
                bench.pass_time(0.8)  # what the host cannot stop stops by its missing heartbeat
        bench.stopped = bench.fleet.stopped
        report = bench.bus.report()
    assert bench.bus.close().restore_failures == () or report.causes
    return bench, samples, report


def ladder_took_s(report):
    return (report.ladder[-1][1] - report.ladder[0][1]) * 1e-9


def assert_ladder_in_time(bench, report):
    deadlines = bench.config.deadlines
    assert report.stopped
    assert bench.stopped
    if bench.name == "virtual time":
        assert ladder_took_s(report) < deadlines.quick_stop_s + deadlines.nmt_stop_s


def test_undisturbed_session_is_complete(bench):
    made, samples, report = run(bench)
    assert report.outcome == "complete"
    assert report.sentence == f"The session is complete: {CYCLES} cycles, 0 missing."
    assert [sample.cycle for sample in samples] == list(range(CYCLES))
    assert all(sample.complete and not any(sample.flags) for sample in samples)
    assert_ladder_in_time(made, report)
    assert [rung for rung, _ in report.ladder] == [Rung.DISABLING, Rung.STOPPED]


def test_lost_tpdo_is_missing_not_repeated(bench):
    _, samples, report = run(bench, Fault(FaultKind.LOST_TPDO, node=2, at=AT))
    assert report.outcome == "failed"
    assert [(entry.cycle, entry.axis) for entry in report.missing] == [(AT, "joint_2")]
    assert samples[AT].position[1] is None
    assert samples[AT].position[0] is not None
    assert samples[AT + 1].complete


def test_three_lost_tpdos_in_a_row_stop_the_drives(bench):
    made, _, report = run(bench, Fault(FaultKind.LOST_TPDO, node=2, at=AT, count=400))
    assert report.cause.kind is CauseKind.MISSING
    assert report.cause.axis == "joint_2"
    assert report.missing_cycles == (AT, AT + 1, AT + 2)
    assert f"({AT}-{AT + 2})" in str(made.error)
    assert [rung for rung, _ in report.ladder][:2] == [Rung.QUICK_STOP, Rung.NMT_STOP]
    assert_ladder_in_time(made, report)


def test_lost_rpdo_shows_as_torn(bench):
    _, samples, report = run(bench, Fault(FaultKind.LOST_RPDO, node=3, at=AT))
    assert report.outcome == "failed"
    assert [(entry.cycle, entry.axis) for entry in report.torn] == [(AT + 1, "joint_3")]
    assert samples[AT + 1].flags == (0, 0, Flag.TORN)
    assert not report.missing


def test_rpdos_lost_in_a_row_stop_the_drives(bench):
    made, _, report = run(bench, Fault(FaultKind.LOST_RPDO, node=3, at=AT, count=3))
    assert report.cause.kind is CauseKind.TORN
    assert [entry.cycle for entry in report.torn] == [AT + 1, AT + 2, AT + 3]
    assert_ladder_in_time(made, report)


def test_sync_unseen_by_one_drive(bench):
    _, samples, report = run(bench, Fault(FaultKind.LOST_SYNC, node=1, at=AT))
    assert [(entry.cycle, entry.axis) for entry in report.missing] == [(AT, "joint_1")]
    assert samples[AT].status_word[0] is None


def test_sync_unseen_by_all_drives(bench):
    _, _, report = run(bench, Fault(FaultKind.LOST_SYNC, at=AT))
    assert [(entry.cycle, entry.axis) for entry in report.missing] == [
        (AT, "joint_1"),
        (AT, "joint_2"),
        (AT, "joint_3"),
    ]


def test_late_tpdo_is_missing_then_flagged_late(bench):
    _, samples, report = run(bench, Fault(FaultKind.LATE_TPDO, node=2, at=AT))
    assert [(entry.cycle, entry.axis) for entry in report.missing] == [(AT, "joint_2")]
    assert samples[AT + 1].flags == (0, Flag.LATE, 0)
    assert samples[AT + 1].position[1] > samples[AT - 1].position[1]
    assert samples[AT + 1].position[1] != samples[AT + 2].position[1]


def test_duplicate_tpdo_is_flagged_and_nothing_is_missing(bench):
    _, samples, report = run(bench, Fault(FaultKind.DUPLICATE_TPDO, node=2, at=AT))
    assert report.outcome == "complete"
    assert [(entry.cycle, entry.flags) for entry in report.irregular] == [(AT, Flag.DUPLICATE)]
    assert samples[AT].complete


def test_wrong_length_is_rejected_and_flagged(bench):
    _, samples, report = run(bench, Fault(FaultKind.WRONG_LENGTH, node=1, at=AT))
    assert [(entry.cycle, entry.axis) for entry in report.missing] == [(AT, "joint_1")]
    assert samples[AT].flags[0] == Flag.WRONG_LENGTH | Flag.MISSING_STATUS | Flag.MISSING_MOTION


@pytest.mark.parametrize("kind", [FaultKind.EMERGENCY, FaultKind.SHORT_EMERGENCY])
def test_emergency_stops_all_drives_and_is_named(bench, kind):
    made, _, report = run(bench, Fault(kind, node=2, at=AT, code=0x4310))
    assert report.cause.kind is CauseKind.EMERGENCY
    assert report.cause.axis == "joint_2"
    assert "4310h, drive over-temperature" in str(made.error)
    assert [entry.code for entry in report.emergencies] == [0x4310]
    assert [rung for rung, _ in report.ladder] == [Rung.QUICK_STOP, Rung.STOPPED]
    assert_ladder_in_time(made, report)


def test_fault_state_stops_all_drives(bench):
    made, _, report = run(bench, Fault(FaultKind.DRIVE_FAULT, node=3, at=AT, code=0x7305))
    assert {cause.kind for cause in report.causes} <= {CauseKind.EMERGENCY, CauseKind.FAULT}
    assert report.cause.axis == "joint_3"
    assert "7305h, incremental encoder 1 fault" in str(made.error)
    assert_ladder_in_time(made, report)


def test_blocked_axis_is_a_following_error(bench):
    made, _, report = run(bench, Fault(FaultKind.BLOCKED_AXIS, node=1, at=1), cycles=150)
    assert report.cause.axis == "joint_1"
    assert {cause.kind for cause in report.causes} & {CauseKind.FOLLOWING_ERROR, CauseKind.EMERGENCY}
    assert "following error" in str(made.error)
    assert_ladder_in_time(made, report)


def test_lost_heartbeat_stops_all_drives(bench):
    made, _, report = run(bench, Fault(FaultKind.HEARTBEAT_LOSS, node=2, at=AT), cycles=60)
    assert report.cause.kind is CauseKind.HEARTBEAT
    assert report.cause.axis == "joint_2"
    assert_ladder_in_time(made, report)


def test_power_loss_of_one_drive_stops_the_others(bench):
    made, _, report = run(bench, Fault(FaultKind.POWER_LOSS, node=2, at=AT))
    assert report.cause.axis == "joint_2"
    assert report.missing_cycles[0] == AT
    assert report.unconfirmed == ("joint_2",)  # nobody can confirm a drive that is not there
    assert all(made.fleet.drive(node).at_rest for node in (1, 3))


def test_restart_of_one_drive_is_named(bench):
    made, _, report = run(bench, Fault(FaultKind.RESTART, node=2, at=AT))
    assert report.cause.kind is CauseKind.RESTARTED
    assert "joint_2" in report.cause.sentence
    assert made.stopped


def test_drive_deaf_to_quick_stop_is_stopped_by_nmt(bench):
    faults = Fault(FaultKind.DEAF_DRIVE, node=1, at=1), Fault(FaultKind.EMERGENCY, node=2, at=AT)
    made, _, report = run(bench, *faults)
    assert [rung for rung, _ in report.ladder] == [Rung.QUICK_STOP, Rung.NMT_STOP, Rung.STOPPED]
    assert_ladder_in_time(made, report)


def test_bus_off_is_named_and_the_drives_stop_by_themselves(bench):
    made, _, report = run(bench, Fault(FaultKind.BUS_OFF, at=AT))
    assert report.cause.kind is CauseKind.BUS_OFF
    assert "bus-off" in str(made.error)
    assert report.missing_cycles == (AT,)  # the cycle it cut short
    assert report.unconfirmed == ("joint_1", "joint_2", "joint_3")
    assert made.stopped


def test_vanished_sync_is_missing_in_all_axes(virtual_bench):
    _, samples, report = run(virtual_bench, Fault(FaultKind.VANISHED_SYNC, at=AT))
    assert report.missing_cycles == (AT,)
    assert all(flags & Flag.NO_SYNC for flags in samples[AT].flags)
    made, _, report = run(virtual_bench, Fault(FaultKind.VANISHED_SYNC, at=AT, count=1000))
    assert report.cause.kind is CauseKind.SYNC_LOST
    assert report.missing_cycles == (AT, AT + 1, AT + 2)
    assert made.stopped  # NMT stop needs no SYNC


@pytest.mark.parametrize(
    ("kind", "error", "words"),
    [
        (FaultKind.NODE_MISSING, NodeMissingError, "node 2"),
        (FaultKind.WRONG_IDENTITY, IdentityError, "drive of joint_2"),
        (FaultKind.REFUSED_MODE, ModeRefusedError, "6061h shows"),
    ],
)
def test_boot_names_what_is_wrong(bench, tmp_path, kind, error, words):
    profile = tmp_path / "named.toml"
    profile.write_text(
        'name = "named"\nvendor = 0x5EED\nsync_periods_us = [6667, 20000]\nperiod_object = "1006h"'
    )
    with bench(Fault(kind, node=2)) as made:
        axes = [axis.model_copy(update={"profile": str(profile)}) for axis in made.config.axes]
        config = made.config.model_copy(update={"axes": tuple(axes)})
        bus = type(made.bus)(config, made.bus._link)
        with pytest.raises(error) as caught:
            bus.boot()
    assert words in str(caught.value)
    assert made.fleet.stopped
