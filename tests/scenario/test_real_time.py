"""The same run in real time, the laboratory in a process of its own; slow enough for a busy machine."""

from dataclasses import replace

import numpy as np
import pytest

from daq.acquisition import Acquisition
from daq.host_clock import HostClock
from daq.log_reader import read_recording
from daq.run_state import RunState
from drivers.canopen.fake.faults import Fault, FaultKind
from drivers.force_plate.faults import Fault as PlateFault
from drivers.virtual.live import LiveLab, LiveSettings
from tests.scenario.benches import SPEC, job

AT = 20


def live_run(path, *faults, plate_faults=()):
    """A run of the standard short motion on a live laboratory at 50 Hz."""
    lab = LiveLab(LiveSettings(SPEC, 50.0, 4, faults=faults, plate_faults=plate_faults))
    try:
        wanted = replace(job(path, periods=1), patient=False)
        run = Acquisition(wanted, lab.drives, HostClock(), lab.plate)
        return run, run.execute()
    finally:
        lab.close()


@pytest.fixture(scope="module")
def calm(tmp_path_factory):
    path = tmp_path_factory.mktemp("live") / "run.mcap"
    return path, *live_run(path)


def test_every_commanded_cycle_is_in_the_log(calm):
    """A busy machine may stall the simulated drives: then the report must name the cycles, and no others."""
    path, run, report = calm
    recording = read_recording(path)
    assert recording.metadata["proof"] == report.proof
    expected = set(range(run.plan.first, min(report.cycles, run.plan.stop)))
    there = set(recording.joint_states.sequence.tolist())
    assert expected - there == expected & set(report.missing_cycles)
    assert report.state is (RunState.RECORDED if report.is_whole and not report.causes else RunState.FAILED)


def test_stamps_are_on_one_time_base(calm):
    path, _, report = calm
    if report.state is not RunState.RECORDED:
        pytest.skip(f"this machine was too busy: {report.sentence}")
    recording = read_recording(path)
    plate, joints = recording.wrench.stamp_ns, recording.joint_states.stamp_ns
    assert abs(int(plate[0]) - int(joints[0])) < 30_000_000
    rate_hz = 1e9 * (len(plate) - 1) / (int(plate[-1]) - int(plate[0]))
    assert rate_hz == pytest.approx(150.15, rel=5e-3)
    assert np.median(recording.wrench.data["force"][:, 2]) > 1000.0


def test_a_fault_in_real_time_stops_the_drives_and_names_the_cause(tmp_path):
    _, report = live_run(tmp_path / "run.mcap", Fault(FaultKind.EMERGENCY, node=2, at=AT))
    assert report.state is RunState.FAILED
    assert any("joint_2 (node 2) sent emergency 7305h" in cause for cause in report.causes)
    assert report.cycles < report.planned


def test_an_unplugged_plate_ends_the_run(tmp_path):
    _, report = live_run(tmp_path / "run.mcap", plate_faults=[PlateFault("unplug", 2.5)])
    assert report.state is RunState.FAILED
    assert any("force plate" in cause for cause in report.causes)
