"""The table on a uniform grid: band-limited, holes marked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from daq.alignment import align
from daq.band_limited import resample
from daq.errors import DataError, UsageError
from daq.recording import Recording, Stream

LINES_HZ = (0.1, 0.7, 2.3, 8.0, 21.0)


def signal(t_s: np.ndarray) -> np.ndarray:
    return np.column_stack([sum(np.sin(2 * np.pi * f * t_s + k) for f in LINES_HZ) for k in range(3)])


def stream(t_s: np.ndarray, data: dict, names: tuple[str, ...] = ()) -> Stream:
    stamp_ns = 1_000_000_000_000 + np.rint(t_s * 1e9).astype(np.int64)
    return Stream("/t", "s", names, "f", stamp_ns, stamp_ns, np.arange(len(t_s), dtype=np.uint32), data)


def recording(joint_states: Stream, wrench: Stream | None = None) -> Recording:
    return Recording("test.mcap", joint_states, None, wrench, None, {}, {}, "", ())


def jittered(rate_hz: float, duration_s: float, seed: int = 0, jitter: float = 0.2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    count = int(duration_s * rate_hz)
    return (np.arange(count) + rng.uniform(-jitter, jitter, count)) / rate_hz


def test_jittered_and_drifting_samples_land_on_the_grid():
    t_joint, t_plate = jittered(150.0, 20.0, 1), 0.0031 + jittered(150.15, 20.0, 2)
    joints = stream(t_joint, {"position": signal(t_joint)}, ("a", "b", "c"))
    wrench = stream(t_plate, {"force": signal(t_plate), "torque": 0.1 * signal(t_plate)})
    table = align(recording(joints, wrench))
    t_s = (table.stamp_ns - 1_000_000_000_000) * 1e-9
    assert np.ptp(np.diff(table.stamp_ns)) <= 1
    for name, column in (("joint_states.position.b", 1), ("wrench.force.y", 1)):
        middle = slice(40, -40)
        error = table.columns[name][middle] - signal(t_s)[middle, column]
        straight = np.interp(t_s, t_joint, signal(t_joint)[:, column])[middle] - signal(t_s)[middle, column]
        assert np.abs(error).max() < 1e-3  # of an amplitude of 5
        assert np.abs(error).max() < 0.01 * np.abs(straight).max()
    assert set(table.columns) >= {"joint_states.position.a", "wrench.force.y", "wrench.torque.z"}
    assert "band-limited" in table.method


def test_holes_and_ends_are_nan_and_only_they():
    t_s = jittered(150.0, 10.0, 3, jitter=0.05)
    kept = np.ones(len(t_s), bool)
    kept[600] = False
    kept[900:960] = False
    joints = stream(t_s, {"position": signal(t_s)}, ("a", "b", "c"))
    late = kept & (t_s > 1.0) & (t_s < 9.0)
    wrench = stream(t_s[late], {"force": signal(t_s[late]), "torque": signal(t_s[late])})
    table = align(recording(joints, wrench))
    at_s = (table.stamp_ns - 1_000_000_000_000) * 1e-9
    missing = np.isnan(table.columns["wrench.force.x"])
    expected = (at_s < t_s[late][0]) | (at_s > t_s[late][-1])
    expected |= (at_s > t_s[599]) & (at_s < t_s[601]) | (at_s > t_s[899]) & (at_s < t_s[960])
    np.testing.assert_array_equal(missing, expected)
    assert not np.isnan(table.columns["joint_states.position.a"]).any()
    beside = (np.abs(at_s - t_s[600]) < 0.1) & ~missing
    error = table.columns["wrench.force.x"][beside] - signal(at_s[beside])[:, 0]
    assert np.abs(error).max() < 0.02


def test_faster_streams_are_filtered_before_they_are_thinned():
    t_s = jittered(1000.0, 6.0, 4, jitter=0.0)
    slow, alias = np.sin(2 * np.pi * 5 * t_s), np.sin(2 * np.pi * 145 * t_s)
    at_s = np.arange(100, 800) / 150.0
    got = resample(t_s, np.column_stack([slow, alias]), at_s, band_hz=60.0, signal_band_hz=400.0)
    assert np.abs(got[:, 0] - np.sin(2 * np.pi * 5 * at_s)).max() < 0.02
    assert np.abs(got[:, 1]).max() < 0.05  # 145 Hz would otherwise look like 5 Hz


def test_constants_stay_constant():
    t_s = jittered(150.0, 5.0, 5)
    got = resample(t_s, np.full((len(t_s), 1), 883.0), np.linspace(1, 4, 50), band_hz=60, signal_band_hz=60)
    np.testing.assert_allclose(got, 883.0, rtol=1e-12)


@pytest.mark.shared
def test_a_sample_log_becomes_a_table():
    path = Path(__file__).resolve().parents[3] / "shared/data/ir361/samples/plain.run.mcap"
    if not path.exists():
        pytest.skip(f"the shared recording {path} is absent")
    log_reader = pytest.importorskip("daq.log_reader")
    log = log_reader.read_recording(path)
    table = align(log)
    position = log.joint_states.data["position"]
    name = f"joint_states.position.{log.joint_states.names[0]}"
    column = table.columns[name]
    assert np.isfinite(column).mean() > 0.9
    assert np.nanmin(column) == pytest.approx(position[:, 0].min(), abs=0.02)
    assert np.nanmax(column) == pytest.approx(position[:, 0].max(), abs=0.02)


def test_refusals_name_the_remedy():
    t_s = np.arange(5) / 150
    short = recording(stream(t_s, {"position": signal(t_s)}, ("a", "b", "c")))
    with pytest.raises(DataError, match="only 5 joint states"):
        align(short)
    with pytest.raises(UsageError, match="positive rate"):
        align(short, 0.0)
