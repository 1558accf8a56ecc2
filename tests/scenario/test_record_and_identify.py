"""What is recorded through the fake buses is identified as well as what was computed offline."""

import json

import numpy as np
import pytest

from daq.log_reader import read_raw, read_recording
from drivers.force_plate.protocols import protocol_named
from drivers.force_plate.protocols.protocol import sample_period_s
from drivers.virtual.plant_file import load_plant
from identify.fit import FitOptions
from service.errors import HardwareMissingError, UsageError
from service.identification import identify_log
from service.recordings import RecordRequest, open_session, preview

SPEC = load_plant("ir361")


def write_excitation(path, size=1.0, joints=SPEC.joint_names):
    """A motion that uses most of each joint's range and speed, at 0.1 Hz with five lines."""
    random = np.random.default_rng(8)
    shape = random.standard_normal((2, 3, 5)) / np.arange(1, 6)
    angle = 2 * np.pi * 0.1 * np.outer(np.linspace(0, 10, 3000), np.arange(1, 6))
    q = np.cos(angle) @ shape[0].T + np.sin(angle) @ shape[1].T
    qd = np.gradient(q, 10 / 2999, axis=0)
    qdd = np.gradient(qd, 10 / 2999, axis=0)
    room = zip(([2.0, 0.8, 1.0], [1.5, 1.2, 1.8], [5.5, 4.5, 7.5]), (q, qd, qdd), strict=True)
    scale = 0.85 * size * np.min([np.array(most) / np.abs(part).max(0) for most, part in room], axis=0)
    content = {
        "schema_version": 1, "robot": "ir361", "joints": list(joints), "fundamental_hz": 0.1, "harmonics": 5,
        "sample_rate_hz": 150.0, "offset": [0.0, 0.0, 0.1],
        "cosine": (shape[0] * scale[:, None]).tolist(), "sine": (shape[1] * scale[:, None]).tolist(),
    }
    path.write_text(json.dumps(content))
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("record")
    excitation = write_excitation(folder / "excitation.json")
    request = RecordRequest("ir361", excitation, folder / "run.mcap", is_virtual=True, periods=4, seed=21)
    report = open_session(request).run()
    return folder / "run.mcap", report


def test_parameters_are_the_plants_within_three_std(run):
    content = identify_log(run[0], None, FitOptions()).content
    assert content["simulated"] is True
    assert content["lack_of_fit"]["p"] > 1e-3
    assert content["intervals_valid"]
    found = {entry["name"]: entry for entry in content["parameters"]}
    for joint in SPEC.joints:
        for key, truth in (("coulomb", joint.coulomb_nm), ("viscous", joint.viscous_nm_s)):
            entry = found[f"{joint.name}.{key}"]
            assert abs(entry["value"] - truth) < 3.5 * entry["std"], (joint.name, key)
    for entry, joint in zip(content["torque_constants"], SPEC.joints, strict=True):
        assert abs(entry["value"] - joint.torque_constant_nm_a) < 3.5 * entry["std"]
        assert entry["std"] < 0.02 * entry["value"]


def test_the_log_keeps_the_contract(run):
    recording = read_recording(run[0])
    facts = recording.metadata
    assert facts["kind"] == "excitation"
    assert facts["periods"] == "4"
    assert facts["outcome"] == "complete"
    assert set(recording.attachments) == {"robot.toml", "ir361.urdf", "excitation.json"}
    states = recording.joint_states
    assert states.names == SPEC.joint_names
    assert len(states) == 5 * round(float(facts["sample_rate_hz"]) / float(facts["fundamental_hz"]))
    assert (np.diff(states.sequence.astype(np.int64)) == 1).all()
    assert (states.log_time_ns > states.stamp_ns).all()
    assert recording.wrench.data["force"][:, 2].mean() > 100.0
    for stream in recording.streams:
        assert stream.stamp_ns[0] - states.stamp_ns[0] < 20_000_000


def test_plate_instants_are_true_within_the_stated_uncertainty(run):
    """The fake plate samples on its own grid: its true instants are known to a constant start."""
    recording, raw = read_recording(run[0]), read_raw(run[0], "/force_plate/raw")
    wrench = recording.wrench
    period_s = sample_period_s(protocol_named("bota")) * (1.0 - 1e-6 * SPEC.plate.clock_ppm)
    number = wrench.sequence.astype(np.int64)
    # the stream began at time one of the virtual bus
    start_ns = int(recording.metadata["clock_offset_ns"]) + 1_000_000_000
    true_ns = start_ns + number * period_s * 1e9
    error_s = np.abs(wrench.stamp_ns - true_ns) * 1e-9
    assert np.quantile(error_s, 0.99) < 1e-4
    assert error_s.max() < float(recording.metadata["plate_uncertainty_s"])
    assert len(raw["sequence"]) >= len(wrench)


def test_a_validation_run_stays_inside_the_excitations_range(tmp_path):
    excitation = write_excitation(tmp_path / "e.json", size=0.5)
    request = RecordRequest(
        "ir361", excitation, tmp_path / "v.mcap", is_virtual=True, is_validation=True, points=3, seed=2
    )
    open_session(request).run()
    recording = read_recording(tmp_path / "v.mcap")
    assert recording.metadata["kind"] == "validation"
    assert "fundamental_hz" not in recording.metadata
    assert np.ptp(recording.joint_states.data["position"], axis=0).min() > 0.05


def test_without_hardware_the_sentence_says_so(tmp_path):
    excitation = write_excitation(tmp_path / "e.json")
    with pytest.raises(HardwareMissingError, match=r"no \[bus\] section.*--virtual") as caught:
        open_session(RecordRequest("ir361", excitation, tmp_path / "x.mcap"))
    assert caught.value.exit_code == 3
    assert [path.name for path in tmp_path.iterdir()] == ["e.json"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"is_real_time": True}, "--virtual"), ({"is_virtual": True, "periods": 0}, "at least one period")],
)
def test_wrong_use_is_refused_before_anything_opens(tmp_path, changes, words):
    excitation = write_excitation(tmp_path / "e.json")
    with pytest.raises(UsageError, match=words):
        open_session(RecordRequest("ir361", excitation, tmp_path / "x.mcap", **changes))


def test_a_dry_run_tells_peaks_duration_and_size(tmp_path, run):
    excitation = write_excitation(tmp_path / "e.json")
    plan, found = preview(RecordRequest("ir361", excitation, tmp_path / "x.mcap", periods=4))
    assert all(peak.is_kept for peak in found.peaks)
    assert found.cycles == plan.cycles
    assert found.duration_s == pytest.approx(50.0, abs=15.0)
    size = run[0].stat().st_size
    assert 0.5 * size < found.size_bytes < 2.0 * size
