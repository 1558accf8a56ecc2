"""Bad input: one clear sentence, the right exit code, nothing half-written."""

import os
from dataclasses import replace

import numpy as np
import pytest

from tests.service import synthetic_logs as logs


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return logs.write(logs.recording(), tmp_path_factory.mktemp("good") / "run.mcap")


@pytest.fixture
def identify(tmp_path, capsys):
    """Identify a log that must be refused; nothing may be left behind."""

    def attempt(recording_or_path, code, *options):
        path = recording_or_path
        if not hasattr(path, "exists"):
            path = logs.write(recording_or_path, tmp_path / "bad.mcap")
        before = set(os.listdir(tmp_path))
        robot = () if "--robot" in options else ("--robot", "ir361")
        sentence = logs.refused(
            capsys, code, "identify", path, *robot, "-o", tmp_path / "estimate.json", *options
        )
        assert set(os.listdir(tmp_path)) == before
        return sentence

    return attempt


def test_a_missing_log(identify, tmp_path):
    assert "No such file" in identify(tmp_path / "none.mcap", 2)


@pytest.mark.parametrize("content", [b"", b"time,q\n0,1\n", b"\x89MCAP0\r\n"])
def test_no_log_at_all(identify, tmp_path, content):
    (tmp_path / "bad.mcap").write_bytes(content)
    assert "bad.mcap" in identify(tmp_path / "bad.mcap", 4)


@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_a_truncated_log(identify, tmp_path, good, share):
    content = good.read_bytes()
    (tmp_path / "bad.mcap").write_bytes(content[: int(share * len(content))])
    assert "residuum recover" in identify(tmp_path / "bad.mcap", 4)


@pytest.mark.parametrize("place", [0.1, 0.35, 0.6])
def test_a_flipped_bit(identify, tmp_path, good, place):
    content = bytearray(good.read_bytes())
    content[int(place * len(content))] ^= 0x10
    (tmp_path / "bad.mcap").write_bytes(bytes(content))
    assert "bad.mcap" in identify(tmp_path / "bad.mcap", 4)


def test_a_missing_topic(identify):
    sentence = identify(replace(logs.recording(), motor_currents=None), 4, "--model", "internal")
    assert "neither motor currents nor joint efforts" in sentence
    assert "no force-plate wrench" in identify(
        replace(logs.recording(), wrench=None), 4, "--model", "combined"
    )


def test_other_joint_names(identify):
    plain = logs.recording()
    other = logs.changed(plain.joint_states, names=("shoulder", "elbow", "wrist"))
    sentence = identify(replace(plain, joint_states=other), 4)
    assert "joint_1" in sentence
    assert "shoulder" in sentence


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e306])
@pytest.mark.parametrize("stream", ["joint_states", "motor_currents", "wrench"])
def test_values_no_machine_has(identify, value, stream):
    plain = logs.recording()
    wrong = getattr(plain, stream)
    key = {"joint_states": "position", "motor_currents": "current", "wrench": "force"}[stream]
    values = wrong.data[key].copy()
    values[123, 1] = value
    sentence = identify(replace(plain, **{stream: logs.changed(wrong, **{key: values})}), 4)
    assert wrong.topic in sentence


def test_stamps_of_1970(identify):
    assert "1970" in identify(logs.shifted(logs.recording(), -logs.START_NS + 10**9), 4)


def test_stamps_that_repeat(identify):
    plain = logs.recording()
    stamp = plain.joint_states.stamp_ns.copy()
    stamp[200:205] = stamp[200]
    sentence = identify(replace(plain, joint_states=logs.changed(plain.joint_states, stamp_ns=stamp)), 4)
    assert "/joint_states" in sentence


def test_stamps_that_jump(identify):
    plain = logs.recording()
    stamp = plain.joint_states.stamp_ns.copy()
    stamp[300:] += 3_600_000_000_000
    sentence = identify(replace(plain, joint_states=logs.changed(plain.joint_states, stamp_ns=stamp)), 4)
    assert "/joint_states" in sentence


def test_stamps_that_go_back(identify):
    plain = logs.recording()
    stamp = plain.joint_states.stamp_ns.copy()
    stamp[300:] -= 2_000_000_000
    identify(replace(plain, joint_states=logs.changed(plain.joint_states, stamp_ns=stamp)), 4)


def test_fewer_than_two_periods(identify):
    plain = logs.recording()
    part = [logs.rows(s, slice(0, 400)) for s in (plain.joint_states, plain.motor_currents, plain.wrench)]
    sentence = identify(replace(plain, joint_states=part[0], motor_currents=part[1], wrench=part[2]), 4)
    assert "period" in sentence


def test_two_samples(identify):
    plain = logs.recording()
    part = [logs.rows(s, slice(0, 1)) for s in (plain.joint_states, plain.motor_currents, plain.wrench)]
    identify(replace(plain, joint_states=part[0], motor_currents=part[1], wrench=part[2]), 4)


@pytest.mark.parametrize("stated", ["0.2", "0.26", "1.7"])
def test_a_wrong_fundamental(identify, stated):
    sentence = identify(logs.recording(metadata={"fundamental_hz": stated}), 4)
    assert "0.25" in sentence


@pytest.mark.parametrize(
    ("key", "value"), [("fundamental_hz", "fast"), ("fundamental_hz", "-1"), ("periods", "nan")]
)
def test_metadata_that_make_no_sense(identify, key, value):
    sentence = identify(logs.recording(metadata={key: value}), 4)
    assert key in sentence
    assert value in sentence


def test_no_robot_anywhere(tmp_path, capsys):
    path = logs.write(logs.recording(), tmp_path / "run.mcap")
    assert "--robot" in logs.refused(capsys, 4, "identify", path)


def test_an_unknown_robot(identify, good):
    sentence = identify(good, 2, "--robot", "ir3611")
    assert "ir361" in sentence


@pytest.mark.parametrize(
    ("options", "hint"),
    [
        (("--model", "both"), "choose combined, internal or external"),
        (("--estimator", "kalman"), "choose markov, ols or ml"),
        (("--free", "--bandwidth", "500"), "bandwidth"),
        (("--decimate", "0"), "decimate"),
        (("--validate", "none.mcap"), "none.mcap"),
    ],
)
def test_wrong_options(identify, good, options, hint):
    code = 4 if "--bandwidth" in options else 2
    assert hint in identify(good, code, *options)


def test_a_validation_log_of_another_robot(identify, good, tmp_path):
    other = logs.write(logs.recording(metadata={"robot": "other"}), tmp_path / "other.mcap")
    assert "same robot" in identify(good, 4, "--validate", other)


@pytest.mark.parametrize("place", ["no/such/folder/estimate.json", "."])
def test_an_output_that_cannot_be_written(good, tmp_path, capsys, place):
    sentence = logs.refused(capsys, 2, "identify", good, "--robot", "ir361", "-o", tmp_path / place)
    assert "Cannot write the estimate" in sentence
    assert os.listdir(tmp_path) == []


def test_an_old_estimate_survives_a_failed_run(tmp_path, capsys):
    old = tmp_path / "estimate.json"
    old.write_text("old")
    path = logs.write(logs.recording(metadata={"fundamental_hz": "0.2"}), tmp_path / "bad.mcap")
    logs.refused(capsys, 4, "identify", path, "--robot", "ir361", "-o", old)
    assert old.read_text() == "old"
