"""Every fault at run level: complete with proof, or failed with the exact missing cycles, cause first."""

import json

import numpy as np
import pytest

from daq.log_reader import read_raw, read_recording
from daq.raw_records import NO_COUNT, NO_CYCLE
from daq.run_state import RunState
from drivers.canopen.fake.faults import Fault, FaultKind
from drivers.force_plate.faults import Fault as PlateFault
from tests.scenario.benches import NAMES, record

AT = 400  # a cycle on the orbit
STREAM_S = 5.0  # of the plate, well inside the motion


def assert_proof_agrees(outcome):
    """The log says of itself what the report says, and its streams have exactly those holes."""
    recording = read_recording(outcome.path)
    report, facts = outcome.report, recording.metadata
    plan = outcome.run.plan
    assert facts["proof"] == report.proof
    assert int(facts["cycles"]) == report.cycles
    assert json.loads(facts["missing"]) == [[entry.cycle, entry.axis] for entry in report.missing]
    sequence = recording.joint_states.sequence
    expected = set(range(plan.first, min(report.cycles, plan.stop)))
    assert expected - set(sequence.tolist()) == set(report.missing_cycles) & expected
    raw = read_raw(outcome.path, "/drive/raw")
    cycles = raw["cycle"][raw["cycle"] != NO_CYCLE]
    assert cycles.tolist() == list(range(report.written))
    return recording, raw


def assert_stopped(outcome):
    assert outcome.bench.fleet.stopped
    assert outcome.bench.drives.report().stopped


def test_undisturbed_run_proves_itself(tmp_path):
    outcome = record(tmp_path / "run.mcap")
    report = outcome.report
    assert report.state is RunState.RECORDED
    assert report.is_whole
    assert report.sentence.startswith("The run is complete: ")
    recording, _ = assert_proof_agrees(outcome)
    assert recording.metadata["outcome"] == "complete"
    assert recording.metadata["simulated"] == "true"
    assert len(recording.joint_states) == 4 * 150
    assert_stopped(outcome)


ONE_CYCLE = {
    "lost TPDO": (Fault(FaultKind.LOST_TPDO, node=2, at=AT), [(AT, "joint_2")]),
    "lost SYNC, one drive": (Fault(FaultKind.LOST_SYNC, node=1, at=AT), [(AT, "joint_1")]),
    "lost SYNC, all drives": (Fault(FaultKind.LOST_SYNC, at=AT), [(AT, name) for name in NAMES]),
    "late TPDO": (Fault(FaultKind.LATE_TPDO, node=3, at=AT), [(AT, "joint_3")]),
    "wrong length": (Fault(FaultKind.WRONG_LENGTH, node=1, at=AT), [(AT, "joint_1")]),
}


@pytest.mark.parametrize("name", ONE_CYCLE)
def test_a_single_loss_goes_on_and_is_named(tmp_path, name):
    fault, missing = ONE_CYCLE[name]
    outcome = record(tmp_path / "run.mcap", fault)
    report = outcome.report
    assert report.state is RunState.FAILED
    assert report.cycles == report.planned
    assert [(entry.cycle, entry.axis) for entry in report.missing] == missing
    assert f"1 missing ({AT})" in report.sentence
    _, raw = assert_proof_agrees(outcome)
    row = int(np.flatnonzero(raw["cycle"] == AT)[0])
    for _, axis in missing:
        assert raw["position"][row][NAMES.index(axis)] == NO_COUNT
    assert_stopped(outcome)


def test_lost_set_point_is_named(tmp_path):
    outcome = record(tmp_path / "run.mcap", Fault(FaultKind.LOST_RPDO, node=3, at=AT))
    assert [(entry.cycle, entry.axis) for entry in outcome.report.torn] == [(AT + 1, "joint_3")]
    assert outcome.report.state is RunState.FAILED
    assert not outcome.report.missing


def test_duplicate_is_noted_and_nothing_is_missing(tmp_path):
    outcome = record(tmp_path / "run.mcap", Fault(FaultKind.DUPLICATE_TPDO, node=2, at=AT))
    assert outcome.report.state is RunState.RECORDED
    assert outcome.report.irregular == (AT,)


STOPPING = {
    "TPDOs lost for good": (Fault(FaultKind.LOST_TPDO, node=2, at=AT, count=400), "joint_2 sent nothing"),
    "RPDOs lost for good": (Fault(FaultKind.LOST_RPDO, node=2, at=AT, count=400), "missed 3 set points"),
    "SYNC vanished": (Fault(FaultKind.VANISHED_SYNC, at=AT, count=400), "SYNC was not on the bus"),
    "emergency": (Fault(FaultKind.EMERGENCY, node=1, at=AT), "joint_1 (node 1) sent emergency 7305h"),
    "heartbeat lost": (Fault(FaultKind.HEARTBEAT_LOSS, node=3, at=AT), "joint_3 (node 3) has no heartbeat"),
    "drive fault": (Fault(FaultKind.DRIVE_FAULT, node=2, at=AT), "joint_2"),
    "drive restarted": (Fault(FaultKind.RESTART, node=2, at=AT), "joint_2 (node 2) restarted"),
    "drive without power": (Fault(FaultKind.POWER_LOSS, node=2, at=AT), "joint_2"),
    "blocked axis": (Fault(FaultKind.BLOCKED_AXIS, node=1, at=AT), "joint_1"),
    "bus-off": (Fault(FaultKind.BUS_OFF, at=AT), "bus-off"),
}


@pytest.mark.parametrize("name", STOPPING)
def test_what_endangers_stops_the_drives_and_keeps_everything_before(tmp_path, name):
    fault, cause = STOPPING[name]
    outcome = record(tmp_path / "run.mcap", fault)
    report = outcome.report
    assert report.state is RunState.FAILED
    assert AT <= report.cycles < report.planned
    assert cause in outcome.first_cause
    assert f"First cause: {outcome.first_cause}" in report.sentence
    recording, _ = assert_proof_agrees(outcome)
    assert recording.joint_states.sequence[-1] >= AT - 1
    assert recording.metadata["outcome"] == "failed"
    if name != "bus-off":
        assert outcome.bench.drives.report().ladder
        outcome.bench.segment.run(500_000_000)
    else:
        outcome.bench.segment.run(2_000_000_000)  # cut off from the host, they stop by its missing heartbeat
    if name != "drive without power":
        assert outcome.bench.fleet.stopped


BOOT = {
    "node missing": (FaultKind.NODE_MISSING, "node 2"),
    "wrong identity": (FaultKind.WRONG_IDENTITY, "node 2"),
    "refused mode": (FaultKind.REFUSED_MODE, "node 2"),
}


@pytest.mark.parametrize("name", BOOT)
def test_what_boot_refuses_never_moves_and_leaves_no_log(tmp_path, name):
    kind, words = BOOT[name]
    outcome = record(tmp_path / "run.mcap", Fault(kind, node=2))
    assert outcome.report.state is RunState.FAILED
    assert words in outcome.first_cause
    assert outcome.report.cycles == 0
    assert outcome.report.log == ""
    assert list(tmp_path.iterdir()) == []


def test_plate_losses_are_counted_and_spoil_the_proof(tmp_path):
    outcome = record(tmp_path / "run.mcap", plate_faults=[PlateFault("bit_flip", 4.0, 6.0, 0.05)])
    assert outcome.report.state is RunState.FAILED
    assert outcome.report.plate_lost > 0
    assert outcome.report.cycles == outcome.report.planned
    wrench = read_recording(outcome.path).wrench
    holes = int((np.diff(wrench.sequence.astype(np.int64)) - 1).sum())
    assert holes == outcome.report.plate_lost


@pytest.mark.parametrize("kind", ["split", "garbage", "clump"])
def test_what_the_plate_stream_survives_loses_nothing(tmp_path, kind):
    outcome = record(tmp_path / "run.mcap", plate_faults=[PlateFault(kind, 4.0, 6.0, 0.1)])
    assert outcome.report.state is RunState.RECORDED
    assert outcome.report.plate_lost == 0


PLATE_STOPS = {
    "stall": (PlateFault("stall", STREAM_S), "sent no intact sample"),
    "unplug": (PlateFault("unplug", STREAM_S), "unplugged"),
    "overload": (PlateFault("overload", STREAM_S), "overloaded"),
}


@pytest.mark.parametrize("name", PLATE_STOPS)
def test_a_dead_or_overloaded_plate_stops_the_drives(tmp_path, name):
    fault, cause = PLATE_STOPS[name]
    outcome = record(tmp_path / "run.mcap", plate_faults=[fault])
    assert outcome.report.state is RunState.FAILED
    assert cause in outcome.first_cause
    assert 0 < outcome.report.cycles < outcome.report.planned
    assert_stopped(outcome)
    recording, _ = assert_proof_agrees(outcome)
    assert recording.wrench is not None
