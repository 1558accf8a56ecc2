"""What the host does to a run: full disk, stepped clock, operator, a motion that leaves its limits."""

import os
import signal

import numpy as np
import pytest

import daq.mcap_writer
from daq.log_reader import read_raw, read_recording
from daq.recovery import recover
from daq.run_state import RunState
from drivers.canopen.fake.faults import Fault, FaultKind
from service.salvage import salvage_run
from tests.scenario.benches import LOWER, UPPER, excitation, limits, make, record

AT = 400


class TrickyDisk:
    """A file that has room for so many bytes, as a full disk has."""

    def __init__(self, file, room):
        self._file, self._room = file, room

    def __getattr__(self, name):
        return getattr(self._file, name)

    def write(self, data):
        if self._room < len(data):
            raise OSError(28, os.strerror(28))
        self._room -= len(data)
        return self._file.write(data)


def test_a_full_disk_stops_the_drives_and_keeps_what_was_written(tmp_path, monkeypatch):
    create = daq.mcap_writer._create
    monkeypatch.setattr(daq.mcap_writer, "_create", lambda path: TrickyDisk(create(path), 150_000))
    run, bench = make(tmp_path / "run.mcap", periods=40)
    report = run.execute()
    assert report.state is RunState.FAILED
    assert "No space left on device" in report.causes[0]
    assert report.log.endswith(".partial")
    assert bench.fleet.stopped
    assert run.error.exit_code == 3
    assert not (tmp_path / "run.mcap").exists()
    monkeypatch.undo()
    recover(report.log, tmp_path / "whole.mcap")
    cycles = read_recording(tmp_path / "whole.mcap").joint_states.sequence
    assert np.array_equal(np.diff(cycles), np.ones(len(cycles) - 1))


class SteppedClock:
    """Virtual time whose time of day jumps an hour back at some moment."""

    def __init__(self, clock, step_at_ns, step_ns=-3_600_000_000_000):
        self._clock, self._at_ns, self._step_ns = clock, step_at_ns, step_ns

    def now_ns(self):
        return self._clock.now_ns()

    def wall_ns(self):
        step_ns = self._step_ns if self._clock.now_ns() > self._at_ns else 0
        return self._clock.wall_ns() + step_ns


def test_a_stepped_wall_clock_is_noted_and_moves_no_stamp(tmp_path):
    plain = record(tmp_path / "plain.mcap")
    run, bench = make(tmp_path / "run.mcap")
    run.clock = SteppedClock(bench.clock, bench.clock.now_ns() + 5_000_000_000)
    report = run.execute()
    assert report.state is RunState.RECORDED
    assert "stepped by -3600.000 s" in report.notes[0]
    logs = [read_recording(path) for path in (plain.path, tmp_path / "run.mcap")]
    for one, other in zip(logs[0].streams, logs[1].streams, strict=True):
        np.testing.assert_array_equal(one.stamp_ns, other.stamp_ns)
    events = read_raw(tmp_path / "run.mcap", "/events")
    assert "clock_step" in events["name"].tolist()


def interrupt_at(run, cycle, *, times=1):
    """Press Ctrl-C when a cycle is reached, by the handler that the command line installs."""
    drives, inner = run.drives, run.drives.cycle

    def cycle_and_press(targets):
        sample = inner(targets)
        if sample.cycle == cycle:
            for _ in range(times):
                signal.raise_signal(signal.SIGINT)
        return sample

    drives.cycle = cycle_and_press


def test_ctrl_c_once_stops_by_the_ladder_and_keeps_the_log(tmp_path, capsys):
    from service.cli.record import _interrupts

    run, bench = make(tmp_path / "run.mcap")
    interrupt_at(run, AT)
    with _interrupts(run):
        report = run.execute()
    assert report.state is RunState.ABORTED
    assert report.causes == ("The operator stopped the run.",)
    assert bench.fleet.stopped
    recording = read_recording(tmp_path / "run.mcap")
    assert recording.metadata["outcome"] == "aborted"
    assert recording.metadata["periods"] == str(run.plan.whole_periods(AT + 1))
    assert recording.joint_states.sequence[-1] == AT
    assert report.cycles == report.written == AT + 1
    assert not report.missing
    assert "again to halt" in capsys.readouterr().err
    assert [change.after for change in run.status.changes][-2:] == [RunState.ABORTING, RunState.ABORTED]


def test_ctrl_c_twice_halts_at_once_and_leaves_the_partial_log(tmp_path):
    from service.cli.record import _interrupts

    run, bench = make(tmp_path / "run.mcap")
    interrupt_at(run, AT, times=2)
    with _interrupts(run), pytest.raises(KeyboardInterrupt):
        run.execute()
    assert run.status.state is RunState.ABORTED
    bench.segment.run(500_000_000)
    assert bench.fleet.stopped
    found = salvage_run(tmp_path / "run.mcap.partial", tmp_path / "whole.mcap")
    assert not found.finished
    whole = read_recording(tmp_path / "whole.mcap")
    assert whole.metadata["outcome"] == "interrupted"
    assert whole.joint_states.sequence[-1] >= AT - 1
    assert whole.wrench is not None


@pytest.mark.parametrize("stage", ["rest", "boot"])
def test_an_abort_before_the_motion_leaves_nothing(tmp_path, stage):
    run, _ = make(tmp_path / "run.mcap")
    if stage == "rest":
        run.abort("Changed my mind.")
    else:
        boot = run.drives.boot
        run.drives.boot = lambda: (run.abort("Changed my mind."), boot())[1]
    report = run.execute()
    assert report.state is RunState.ABORTED
    assert report.cycles == 0
    assert list(tmp_path.iterdir()) == []


class SlippingAxis:
    """An axis whose encoder slips on its shaft at some moment."""

    def __init__(self, axis, segment, at_ns, slip_rad):
        self._axis, self._now_ns, self._at_ns, self._slip_rad = axis, segment.now_ns, at_ns, slip_rad

    def set_target(self, position_rad):
        self._axis.set_target(position_rad)

    def sample(self):
        position_rad, current_a, velocity_rad_s = self._axis.sample()
        slip_rad = self._slip_rad if self._now_ns() > self._at_ns else 0.0
        return position_rad + slip_rad, current_a, velocity_rad_s


def test_a_measured_position_beyond_the_limits_stops_the_drives(tmp_path):
    """The set points keep their limits all the time; the measured position does not."""
    upper = UPPER.copy()
    upper[1] = max(0.0, excitation().evaluate(np.linspace(0, 1, 500))[0][:, 1].max()) + 0.01
    run, bench = make(tmp_path / "run.mcap", limits_of_run=limits(upper=upper))
    drive = bench.fleet.drives[1]
    drive.axis = SlippingAxis(drive.axis, bench.segment, bench.segment.now_ns() + 5_000_000_000, 0.07)
    report = run.execute()
    assert report.state is RunState.FAILED
    assert "joint_2 was measured at" in report.causes[0]
    assert "outside its limits" in report.causes[0]
    assert bench.fleet.stopped
    assert 0 < report.cycles < report.planned


def test_an_axis_that_cannot_follow_stops_the_drives(tmp_path):
    outcome = record(
        tmp_path / "run.mcap",
        Fault(FaultKind.BLOCKED_AXIS, node=2, at=AT),
        limits_of_run=limits(following=0.01),
    )
    assert outcome.report.state is RunState.FAILED
    assert "joint_2" in outcome.first_cause
    assert "away from its set points" in outcome.first_cause
    assert outcome.bench.fleet.stopped


def test_set_points_beyond_the_limits_never_move(tmp_path):
    run, _ = make(tmp_path / "run.mcap", limits_of_run=limits(lower=LOWER, upper=np.array([0.05, 0.5, 0.5])))
    report = run.execute()
    assert report.state is RunState.FAILED
    assert "joint_1 reaches the position" in report.causes[0]
    assert run.error.exit_code == 2
    assert report.cycles == 0


def test_settings_are_put_back(tmp_path):
    run, bench = make(tmp_path / "run.mcap")
    before = [dict(drive.dictionary.values) for drive in bench.fleet.drives]
    run.execute()
    for drive, values in zip(bench.fleet.drives, before, strict=True):
        for address in (0x6060, 0x60C2, 0x6007, 0x605A):
            keys = [key for key in values if key >> 8 == address or key == address]
            assert keys or address == 0x60C2
            assert all(drive.dictionary.values[key] == values[key] for key in keys)


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        record(tmp_path / f"{name}.mcap")
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()


