"""Foreign recordings through map files: right units, right refusals."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest

from daq.errors import DataError, MissingTopicError, UsageError
from daq.imports.mapping import read_map
from daq.imports.recording import import_recording
from daq.log_reader import read_recording
from daq.log_writer import write_recording
from daq.quality import inspect_recording
from tests.daq import logs

MAPS = Path(__file__).parents[2] / "docs" / "maps"
MAP = """
[time]
column = "ms"
unit = "ms"
[joints]
names = ["a", "b"]
[position]
columns = ["q1", "q2"]
unit = "deg"
offset = [0.0, 1.5]
[current]
columns = ["i1", "i2"]
unit = "counts"
scale = [0.001, 0.002]
[metadata]
kind = "excitation"
fundamental_hz = 0.5
"""


@pytest.fixture
def files(tmp_path):
    """Write a CSV and a map; returns a function of their texts to the import."""

    def run(rows=None, plan=MAP, heading="ms,q1,q2,i1,i2,note", **options):
        rows = [f"{10 * i},{i},{-i},{100 * i},7,ok" for i in range(20)] if rows is None else rows
        (tmp_path / "r.csv").write_text("\n".join([heading, *rows]) + "\n")
        (tmp_path / "m.toml").write_text(plan)
        return import_recording(tmp_path / "r.csv", tmp_path / "m.toml", **options)

    return run


def test_units_scales_and_offsets(files, tmp_path):
    result = files()
    joints = result.recording.joint_states
    np.testing.assert_allclose(joints.data["position"][3], [np.deg2rad(3), np.deg2rad(-3) + 1.5])
    np.testing.assert_allclose(result.recording.motor_currents.data["current"][3], [0.3, 0.014])
    assert np.diff(joints.stamp_ns).tolist() == [10_000_000] * 19
    assert joints.names == ("a", "b")
    meta = result.recording.metadata
    assert (meta["kind"], meta["simulated"], meta["fundamental_hz"]) == ("excitation", "false", "0.5")
    write_recording(result.recording, tmp_path / "out.mcap")
    logs.assert_same(result.recording, read_recording(tmp_path / "out.mcap"))


GOOD = [f"{10 * i},{i},{-i},{100 * i},7,ok" for i in range(20)]


@pytest.mark.parametrize(
    ("row", "text", "what"),
    [
        (5, "50,nan,1,2,3,x", "is NaN"),
        (5, "50,inf,1,2,3,x", "is infinite"),
        (5, "50,1e306,1,2,3,x", "is beyond"),
        (5, "50,1,2,-1e309,3,x", "is infinite"),
        (19, "190,19", "has 2 of 6 cells"),
        (5, "40,1,1,2,3,x", "repeats the one before"),
        (5, "20,1,1,2,3,x", "lies before"),
        (5, "50,oops,1,2,3,x", "'oops', not a number"),
        (5, "nan,1,1,2,3,x", "is NaN"),
    ],
)
def test_bad_rows_are_refused_by_number_or_dropped(files, row, text, what):
    rows = [*GOOD[:row], text, *GOOD[row + 1 :]]
    with pytest.raises(DataError, match=f"row {row + 2} is unusable.*{what}.*--drop-bad-rows") as caught:
        files(rows)
    assert caught.value.exit_code == 4
    result = files(rows, drop_bad_rows=True)
    streams = result.recording.streams
    assert min(len(stream) for stream in streams) == 19
    assert result.dropped >= 1
    assert result.recording.metadata["dropped_rows"] == str(result.dropped)
    assert any(row not in stream.sequence for stream in streams)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[position]", "[positon]", "did you mean 'position'"),
        ('columns = ["q1"', 'colums = ["q1"', "did you mean 'columns'"),
        ("fundamental_hz", "fundamental_khz", "did you mean 'fundamental_hz'"),
        ('"q1"', '"q9"', "no column 'q9'"),
        ('"deg"', '"degree"', "choose one of rad, deg"),
        ("scale = [0.001, 0.002]\n", "", "give its scale"),
        ("[0.0, 1.5]", "[0.0, 1.5, 2.0]", "2 columns but 3"),
        ("[0.0, 1.5]", "[0.0, nan]", "must be finite"),
        ('"excitation"', '"dance"', "kind must be one of"),
        ("[joints]", "[joints", "is not TOML"),
        ('names = ["a", "b"]', 'names = ["a"]', "2 columns for 1 joints"),
    ],
)
def test_senseless_maps_are_wrong_use(files, old, new, message):
    assert old in MAP
    with pytest.raises(UsageError, match=message) as caught:
        files(plan=MAP.replace(old, new, 1))
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value).strip()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("x.csv", b""),
        ("x.csv", b"\xff\xfe\x00\x01\x80"),
        ("x.csv", b"a,b\n"),
        ("x.npz", b"PK\x03\x04nonsense"),
        ("x.db3", b"SQLite format 3\0nonsense" * 9),
        ("x.mcap", b"nonsense"),
    ],
)
def test_files_of_no_kind(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    (tmp_path / "m.toml").write_text(MAP)
    with pytest.raises(DataError):
        import_recording(tmp_path / name, tmp_path / "m.toml")


def test_unknown_kinds_and_absent_files_are_wrong_use(tmp_path):
    (tmp_path / "m.toml").write_text(MAP)
    (tmp_path / "x.xlsx").write_bytes(b"x")
    for name in ("x.xlsx", "none.csv"):
        with pytest.raises(UsageError):
            import_recording(tmp_path / name, tmp_path / "m.toml")


def test_pickles_are_never_loaded(tmp_path):
    np.savez(tmp_path / "x.npz", q=np.array([{"a": 1}], object), t=np.arange(3.0))
    (tmp_path / "m.toml").write_text('[time]\ncolumn = "t"\n[position]\ncolumns = ["q"]\n')
    with pytest.raises(DataError, match="not an archive of numeric arrays"):
        import_recording(tmp_path / "x.npz", tmp_path / "m.toml")


def test_a_plate_with_its_own_clock(tmp_path):
    t = np.arange(100) / 100
    np.savez(tmp_path / "x.npz", t=t, q=np.sin(t), tp=t[::2] + 0.001, f=np.ones((50, 3)), m=np.ones((50, 3)))
    (tmp_path / "m.toml").write_text(
        '[time]\ncolumn = "t"\nstart = 2026-01-31T12:00:00Z\n[position]\ncolumn = "q"\n'
        '[force]\ncolumn = "f"\ntime = "tp"\n[torque]\ncolumn = "m"\ntime = "tp"\nunit = "N.mm"\n'
    )
    recording = import_recording(tmp_path / "x.npz", tmp_path / "m.toml").recording
    assert len(recording.wrench) == 50
    assert recording.wrench.stamp_ns[0] - recording.joint_states.stamp_ns[0] == 1_000_000
    assert recording.wrench.data["torque"][0, 0] == pytest.approx(1e-3)
    assert recording.joint_states.stamp_ns[0] == 1_769_860_800 * 10**9


def test_a_foreign_mcap_with_other_topics_units_and_joints(tmp_path):
    messages = [
        (i * 10**7, logs.joint_state_bytes(i * 10**7, logs.NAMES, [90.0, 180.0, i])) for i in range(20)
    ]
    logs.foreign_log(tmp_path / "f.mcap", messages, topic="/arm/js", profile="")
    plan = (
        '[topics]\njoint_states = "/arm/js"\n[joints]\nnames = ["c", "a"]\nrename = ["j1", "j2"]\n'
        '[position]\nunit = "deg"\n'
    )
    (tmp_path / "m.toml").write_text(plan)
    joints = import_recording(tmp_path / "f.mcap", tmp_path / "m.toml").recording.joint_states
    assert joints.names == ("j1", "j2")
    np.testing.assert_allclose(joints.data["position"][4], np.deg2rad([4, 90]))
    assert joints.stamp_ns[0] == 946_684_800 * 10**9  # counting from zero: put at the default start
    (tmp_path / "m.toml").write_text(plan.replace("/arm/js", "/leg/js"))
    with pytest.raises(MissingTopicError, match="/leg/js"):
        import_recording(tmp_path / "f.mcap", tmp_path / "m.toml")


def test_bad_messages_of_a_bag(tmp_path):
    bag = sqlite3.connect(tmp_path / "b.db3")
    bag.execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
    )
    bag.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
    )
    bag.execute("INSERT INTO topics VALUES(1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr')")
    for i in range(30):
        stamp = logs.START_NS + (i if i != 7 else 6) * 10**7
        data = logs.joint_state_bytes(stamp, logs.NAMES, [i, i, np.nan if i == 9 else i])
        bag.execute("INSERT INTO messages VALUES(?, 1, ?, ?)", (i + 1, stamp, data))
    bag.commit()
    bag.close()
    (tmp_path / "m.toml").write_text("[metadata]\nkind = 'free'\n")
    with pytest.raises(DataError, match=r"message 7 of /joint_states has a stamp not after"):
        import_recording(tmp_path / "b.db3", tmp_path / "m.toml")
    result = import_recording(tmp_path / "b.db3", tmp_path / "m.toml", drop_bad_rows=True)
    assert result.dropped == 2
    assert len(result.recording.joint_states) == 28


@pytest.mark.shared
def test_emps():
    recording = import_recording(logs.shared("real/emps.csv"), MAPS / "emps.toml").recording
    assert len(recording.joint_states) == 24841
    assert recording.joint_states.data["effort"][0, 0] == 89.23443
    quality = inspect_recording(recording)
    assert quality.period.period_s == pytest.approx(6.24, abs=1e-4)
    assert quality.period.periods == 3


@pytest.mark.shared
def test_tx40():
    recording = import_recording(logs.shared("real/tx40.npz"), MAPS / "tx40.toml").recording
    assert recording.joint_states.data["effort"].shape == (45000, 6)
    np.testing.assert_allclose(recording.joint_states.data["position"][0, 1:3], 0.0, atol=1e-4)
    assert inspect_recording(recording).fit


@pytest.mark.shared
def test_bldc_bench():
    recording = import_recording(logs.shared("real/bldc_bench.npz"), MAPS / "bldc_bench.toml").recording
    assert recording.motor_currents.data["current"].shape == (26999, 1)
    assert inspect_recording(recording).streams[0].lost == 0


@pytest.mark.shared
def test_ur10():
    recording = import_recording(
        logs.shared("real/ur10_exciting_trajectory.db3"), MAPS / "ur10.toml"
    ).recording
    assert recording.joint_states.data["effort"].shape == (3441, 6)
    period = inspect_recording(recording).period
    assert period.period_s == pytest.approx(13.76, abs=0.01)
    assert period.repeating == ("shoulder_pan_joint", "elbow_joint")
    assert not period.common


@pytest.mark.parametrize("path", sorted(MAPS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_shipped_map_is_well_formed(path):
    assert read_map(path).metadata["simulated"] == "false"
