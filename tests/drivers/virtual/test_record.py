import numpy as np
import pytest

from daq.log_reader import read_recording
from daq.log_writer import write_recording
from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.plant_file import load_plant
from drivers.virtual.record import record_virtual, run_motion
from drivers.virtual.sensors import ColouredNoise
from drivers.virtual.trajectories import fourier_from_excitation, joint_limits, random_points


@pytest.fixture(scope="module")
def recording(arm, motion):
    return record_virtual(arm, motion, periods=3, transient_periods=1, seed=5)


def same(one, other):
    return all(
        np.array_equal(a.stamp_ns, b.stamp_ns)
        and np.array_equal(a.sequence, b.sequence)
        and all(np.array_equal(a.data[key], b.data[key]) for key in a.data)
        for a, b in zip(one.streams, other.streams, strict=True)
    )


def test_the_same_seed_gives_the_same_run(arm, motion, recording):
    assert same(recording, record_virtual(arm, motion, 3, 1, seed=5))
    assert not same(recording, record_virtual(arm, motion, 3, 1, seed=6))


def test_an_effect_leaves_all_noise_as_it_was(arm, motion, recording):
    other = record_virtual(arm, motion, 3, 1, seed=5, effects=[EffectSpec("stribeck_friction", "joint_2")])
    assert np.array_equal(other.wrench.data["force"], recording.wrench.data["force"])
    assert np.array_equal(other.joint_states.data["position"], recording.joint_states.data["position"])
    gap = other.motor_currents.data["current"] - recording.motor_currents.data["current"]
    assert np.abs(gap[:, [0, 2]]).max() < 1e-12
    assert np.abs(gap[:, 1]).max() > 0.05


def test_the_run_says_what_it_is(recording):
    facts = dict(recording.metadata)
    assert facts["simulated"] == "true"
    assert facts["kind"] == "excitation"
    assert (facts["periods"], facts["transient_periods"], facts["harmonics"]) == ("3", "1", "5")
    assert float(facts["fundamental_hz"]) == 0.1


def test_noise_comes_out_as_asked(arm, motion, recording):
    quiet = run_motion(arm, motion, 40.1)
    stamps = (recording.motor_currents.stamp_ns - 1_760_000_000_000_000_000) * 1e-9
    gear = np.array([j.gear_ratio * j.torque_constant_nm_a for j in arm.joints])
    noise = (recording.motor_currents.data["current"] - quiet.currents(stamps)) * gear
    assert np.std(noise, axis=0) == pytest.approx(arm.noise.joint_torque_nm, rel=0.05)
    stamps = (recording.wrench.stamp_ns - 1_760_000_000_000_000_000) * 1e-9
    seen = np.hstack([recording.wrench.data["force"], recording.wrench.data["torque"]])
    assert np.std(seen - quiet.wrench(stamps), axis=0) == pytest.approx(arm.noise.wrench, rel=0.05)
    stamps = (recording.joint_states.stamp_ns - 1_760_000_000_000_000_000) * 1e-9
    reading = recording.joint_states.data["position"]
    assert np.std(reading - quiet.encoders(stamps), axis=0) == pytest.approx([3e-5] * 3, rel=0.05)


def test_noise_has_the_colour_and_correlation_asked():
    noise = ColouredNoise(np.array([1.0, 3.0]), 0.7, 0.4, np.random.default_rng(1))
    values = np.vstack([noise.next(50), noise.next(60_000), noise.next(1)])
    assert np.std(values, axis=0) == pytest.approx([1.0, 3.0], rel=0.03)
    ahead = [np.corrcoef(values[1:, k], values[:-1, k])[0, 1] for k in range(2)]
    assert ahead == pytest.approx([0.7, 0.7], abs=0.02)
    assert np.corrcoef(values.T)[0, 1] == pytest.approx(0.4, abs=0.03)


def test_lost_samples_are_holes_in_the_count(recording):
    for stream in (recording.joint_states, recording.wrench):
        holes = np.diff(stream.sequence.astype(int)) - 1
        assert 0 < holes.sum() < 20
        assert np.all(holes >= 0)


def test_the_plate_runs_on_its_own_clock(arm, recording):
    wrench, joints = recording.wrench, recording.joint_states
    rate = [
        np.polyfit(s.sequence.astype(float), s.stamp_ns - s.stamp_ns[0], 1)[0] for s in (wrench, joints)
    ]
    assert 1e6 * (rate[1] / rate[0] - 1.0) == pytest.approx(arm.plate.clock_ppm, abs=0.5)
    assert np.all(wrench.log_time_ns > wrench.stamp_ns)
    assert np.all(np.diff(wrench.log_time_ns) >= 0)


def test_a_log_holds_the_run_exactly(tmp_path, recording):
    path = tmp_path / "virtual.run.mcap"
    write_recording(recording, path)
    back = read_recording(path)
    assert same(recording, back)
    assert back.metadata["simulated"] == "true"


def test_validation_visits_its_points_within_limits(arm):
    points = random_points(arm, seed=2)
    lower, upper, speed = joint_limits(arm)
    t_s = np.linspace(0.0, points.duration_s, 20_000)
    q = points.position(t_s)
    assert np.all((q >= lower) & (q <= upper))
    assert np.all(np.abs(np.gradient(q, t_s, axis=0)) <= speed)
    assert len(points.points_rad) == 21
    run = record_virtual(arm, points, seed=1)
    assert run.metadata["kind"] == "validation"
    assert "fundamental_hz" not in run.metadata


def test_an_excitation_file_becomes_a_trajectory(motion):
    table = {
        "fundamental_hz": motion.fundamental_hz,
        "offset": motion.offset_rad.tolist(),
        "cosine": motion.cosine_rad.tolist(),
        "sine": motion.sine_rad.tolist(),
    }
    again = fourier_from_excitation(table)
    t_s = np.linspace(0.0, 10.0, 50)
    assert np.array_equal(again.position(t_s), motion.position(t_s))
    assert np.allclose(motion.reversed().position(t_s), motion.position(-t_s))


def test_a_plant_without_plate_records_no_wrench(motion):
    bare = load_plant("ir361").model_copy(update={"plate": None})
    assert record_virtual(bare, motion, 1, 0).wrench is None
