"""What an inspection finds, on recordings whose faults are known because they were made."""

import json
from dataclasses import replace

import numpy as np
import pytest

from daq.log_reader import read_recording
from daq.period import find_period
from daq.quality import NON_PERIODIC, PERIODIC, UNFIT, inspect_recording
from daq.stream_quality import is_saturated, longest_run
from tests.daq import logs


def motion(frequencies, duration_s=20.0, rate_hz=150.0, noise=3e-5, ramp_s=0.0, jitter_ns=0.0, lose=()):
    """Joint states whose joints are each a sum of sines at the given frequencies."""
    stamp = logs.stamps(int(duration_s * rate_hz), rate_hz, jitter_ns=jitter_ns)
    t = (stamp - stamp[0]) * 1e-9
    rng = np.random.default_rng(3)
    angle = np.column_stack(
        [
            sum(np.sin(2 * np.pi * f * t + f + k) / (k + 1) for k, f in enumerate(fs)) + 0 * t
            for fs in frequencies
        ]
    )
    if ramp_s:
        angle *= np.clip(np.minimum(t, t[-1] - t) / ramp_s, 0, 1)[:, None]
    angle = angle + noise * rng.normal(size=angle.shape)
    keep = np.setdiff1d(np.arange(len(t)), lose)
    stream = logs.joint_stream(len(t), names=tuple(f"j{i}" for i in range(len(frequencies))))
    return replace(
        stream,
        stamp_ns=stamp[keep],
        log_time_ns=stamp[keep],
        sequence=keep.astype(np.uint32),
        data={"position": angle[keep]},
    )


def test_the_common_period_is_the_least_common_one():
    period = find_period(motion([[0.5, 1.5], [1.0, 2.0], [0.5, 1.0]], jitter_ns=10_000, lose=(100, 500, 501)))
    assert period.common
    assert period.period_s == pytest.approx(2.0, rel=1e-5)
    assert period.periods == 10
    assert period.repeatability["j0"] == pytest.approx(3e-5, rel=0.5)


def test_a_period_of_some_joints_is_none():
    period = find_period(motion([[0.2, 0.4], [0.2, 0.6], [0.2 * np.sqrt(2), 0.2 * np.pi]]))
    assert period.period_s == pytest.approx(5.0, rel=1e-4)
    assert not period.common
    assert period.repeating == ("j0", "j1")
    assert period.other == ("j2",)


def test_ramps_at_both_ends_are_set_aside():
    period = find_period(motion([[0.25, 0.5], [0.25, 0.75]], duration_s=32.0, ramp_s=3.0))
    assert period.common
    assert period.period_s == pytest.approx(4.0, rel=1e-4)
    assert 5 <= period.periods <= 7
    assert 2.0 < period.start_s < 5.0


def test_a_wrong_claim_is_not_believed():
    stream = motion([[0.5, 1.5], [1.0, 2.0]])
    assert find_period(stream, hint_hz=0.3).period_s == pytest.approx(2.0, rel=1e-5)
    chirp = motion([[0.2 * np.sqrt(2), 0.2 * np.pi, 0.31], [0.17, 0.2 * np.e]])
    assert find_period(chirp, hint_hz=0.5) is None


def test_a_joint_that_stands_is_named_and_not_asked_to_repeat():
    stream = motion([[0.5, 1.0], []])
    period = find_period(stream)
    assert period.common
    assert period.standing == ("j1",)


def test_a_good_recording_is_fit():
    quality = inspect_recording(logs.recording(count=1500, noise=0.1, fundamental_hz="1.0"))
    assert quality.verdict == PERIODIC
    assert quality.fit
    assert quality.period.periods == 10
    assert quality.repeatability["/motor_currents current a"] == pytest.approx(0.1, rel=0.1)
    plate = quality.streams[2]
    assert plate.drift_ppm == pytest.approx(-40.0, abs=0.1)  # longer intervals: a slower clock
    assert plate.phase_s == pytest.approx(1.7e-3, abs=1e-6)
    assert quality.streams[0].jitter_max_s < 1e-8
    text = json.dumps(quality.to_json(), allow_nan=False)
    assert json.loads(text)["verdict"] == PERIODIC


def test_a_wrong_fundamental_in_the_metadata_is_noticed():
    quality = inspect_recording(logs.recording(count=1500, fundamental_hz="0.9"))
    assert any("0.9 Hz but the motion repeats at 1 Hz" in note for note in quality.notes)


@pytest.mark.parametrize("counted", [True, False])
def test_losses_are_counted_by_sequence_or_by_stamps(counted):
    recording = logs.recording(count=1500)
    keep = np.setdiff1d(np.arange(1500), [100, 101, 102, 800])
    joints = recording.joint_states
    number = joints.sequence[keep] if counted else np.arange(1496, dtype=np.uint32)
    lossy = replace(
        joints,
        stamp_ns=joints.stamp_ns[keep],
        log_time_ns=joints.log_time_ns[keep],
        sequence=number,
        data={"position": joints.data["position"][keep]},
    )
    stream = inspect_recording(replace(recording, joint_states=lossy)).streams[0]
    assert stream.lost == 4
    assert stream.holes == (4 if counted else 0)
    assert (stream.gap_count, stream.gaps[0].missing) == (2, 3)
    assert stream.rate_hz == pytest.approx(150.0, rel=1e-6)


def test_many_losses_make_it_unfit():
    recording = logs.recording(count=1500)
    keep = np.flatnonzero(np.arange(1500) % 10)
    joints = recording.joint_states
    lossy = replace(
        joints,
        stamp_ns=joints.stamp_ns[keep],
        log_time_ns=joints.log_time_ns[keep],
        sequence=joints.sequence[keep],
        data={"position": joints.data["position"][keep]},
    )
    quality = inspect_recording(replace(recording, joint_states=lossy))
    assert quality.verdict == UNFIT
    assert "9.9%" in quality.reasons[0] or "10.0%" in quality.reasons[0]


def test_late_stamps_that_are_caught_up_are_no_loss():
    recording = logs.recording(count=1500)
    joints = recording.joint_states
    stamp = joints.stamp_ns.copy()
    for start in range(100, 1400, 100):
        stamp[start : start + 5] += np.arange(5, 0, -1) * 5_000_000
    stream = inspect_recording(replace(recording, joint_states=replace(joints, stamp_ns=stamp))).streams[0]
    assert stream.lost == 0


def test_without_a_cause_of_motion_it_is_unfit():
    recording = replace(logs.recording(), motor_currents=None, wrench=None)
    quality = inspect_recording(recording)
    assert quality.verdict == UNFIT
    assert "neither motor currents" in quality.reasons[0]


def test_standing_robots_and_dead_channels_are_unfit():
    recording = logs.recording()
    still = replace(recording.joint_states, data={"position": np.zeros((600, 3))})
    assert "No joint moves" in inspect_recording(replace(recording, joint_states=still)).reasons[0]
    current = recording.motor_currents.data["current"].copy()
    current[:, 1] = 0.25
    dead = replace(recording.motor_currents, data={"current": current})
    quality = inspect_recording(replace(recording, motor_currents=dead))
    assert quality.verdict == UNFIT
    assert "current b" in quality.reasons[0]


def test_saturation_is_a_flat_top_and_not_a_peak():
    t = np.linspace(0, 20, 6000)
    noisy = np.sin(t) + 0.05 * np.random.default_rng(0).normal(size=len(t))
    assert not is_saturated(np.sin(t))
    assert not is_saturated(noisy)
    assert not is_saturated(np.round(noisy * 500) / 500)
    assert is_saturated(np.clip(noisy, -0.9, 0.9))
    assert is_saturated(np.round(np.clip(noisy, -9, 0.9) * 500) / 500)
    assert longest_run(np.array([1, 1, 2, 2, 2, 1])) == 3


def test_bad_numbers_do_not_stop_the_inspection():
    recording = logs.recording()
    position = recording.joint_states.data["position"].copy()
    position[5, 0], position[9, 1] = np.nan, 1e306
    quality = inspect_recording(
        replace(recording, joint_states=replace(recording.joint_states, data={"position": position}))
    )
    assert quality.verdict == UNFIT
    assert quality.streams[0].bad_rows == 2
    json.dumps(quality.to_json(), allow_nan=False)


@pytest.mark.shared
@pytest.mark.parametrize("name", ["plain", "stribeck_joint_2"])
def test_the_sample_runs(name):
    quality = inspect_recording(read_recording(logs.shared(f"ir361/samples/{name}.run.mcap")))
    assert quality.verdict == PERIODIC
    assert quality.period.period_s == pytest.approx(10.0, rel=1e-6)
    assert quality.period.periods == 9
    assert all(0 < stream.lost < 20 for stream in quality.streams)
    assert 5 < abs(quality.streams[2].drift_ppm) < 100
    assert quality.repeatability["/joint_states position joint_1"] == pytest.approx(3e-5, rel=0.1)


@pytest.mark.shared
def test_a_validation_run_is_not_periodic():
    quality = inspect_recording(read_recording(logs.shared("ir361/samples/plain.validation.mcap")))
    assert quality.verdict == NON_PERIODIC
