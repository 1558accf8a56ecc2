"""Logs that other programs wrote, odd in every way the formats allow."""

import numpy as np
import pytest

from daq.errors import DataError, MissingTopicError
from daq.log_reader import read_recording
from tests.daq import logs

POSITIONS = np.arange(60.0).reshape(20, 3)


def messages(**options):
    names = options.pop("names", logs.NAMES)
    return [
        (logs.START_NS + i * 10**7, logs.joint_state_bytes(logs.START_NS + i * 10**7, names, row, **options))
        for i, row in enumerate(POSITIONS)
    ]


@pytest.mark.parametrize(
    "options",
    [
        {"compression": "lz4"},
        {"compression": "none"},
        {"chunked": False},
        {"index": False},
        {"chunked": False, "index": False},
    ],
)
def test_every_kind_of_container(tmp_path, options):
    stream = read_recording(logs.foreign_log(tmp_path / "f.mcap", messages(), **options)).joint_states
    np.testing.assert_array_equal(stream.data["position"], POSITIONS)
    assert stream.sequence.tolist() == list(range(20))


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("filled", [(), ("velocity",), ("effort",), ("velocity", "effort")])
def test_byte_orders_and_empty_arrays(tmp_path, big_endian, filled):
    extra = {key: [7.0, 8.0, 9.0] for key in filled}
    path = logs.foreign_log(tmp_path / "f.mcap", messages(big_endian=big_endian, **extra))
    stream = read_recording(path).joint_states
    np.testing.assert_array_equal(stream.data["position"], POSITIONS)
    assert set(stream.data) == {"position", *filled}
    for key in filled:
        assert stream.data[key].tolist() == [[7.0, 8.0, 9.0]] * 20
    assert all(values.dtype == np.float64 for values in stream.data.values())


def test_mcap_ros2_support_writes_what_is_read(tmp_path):
    from mcap_ros2.writer import Writer

    from daq.messages import JOINT_STATE, definition

    with open(tmp_path / "w.mcap", "wb") as out:
        writer = Writer(out)
        schema = writer.register_msgdef(JOINT_STATE, definition(JOINT_STATE))
        for i, row in enumerate(POSITIONS):
            writer.write_message(
                "/joint_states",
                schema,
                {
                    "header": {"stamp": {"sec": 1_700_000_000, "nanosec": i}, "frame_id": "f"},
                    "name": list(logs.NAMES),
                    "position": row.tolist(),
                    "velocity": [],
                    "effort": row.tolist(),
                },
                log_time=i + 1,
                publish_time=i,
                sequence=i,
            )
        writer.finish()
    stream = read_recording(tmp_path / "w.mcap").joint_states
    np.testing.assert_array_equal(stream.data["effort"], POSITIONS)
    assert set(stream.data) == {"position", "effort"}


def test_the_only_joint_state_topic_is_taken(tmp_path):
    recording = read_recording(logs.foreign_log(tmp_path / "f.mcap", messages(), topic="/robot/js"))
    assert recording.joint_states.topic == "/joint_states"
    assert any("/robot/js" in text for text in recording.warnings)


def test_joints_in_changing_order_are_put_right(tmp_path):
    mixed = []
    for i, row in enumerate(POSITIONS):
        stamp = logs.START_NS + i
        order = [2, 0, 1] if i % 3 == 1 else [0, 1, 2]
        names = [logs.NAMES[j] for j in order]
        mixed.append((stamp, logs.joint_state_bytes(stamp, names, row[order], frame="x" if i < 5 else "y")))
    recording = read_recording(logs.foreign_log(tmp_path / "f.mcap", mixed))
    assert recording.joint_states.names == logs.NAMES
    np.testing.assert_array_equal(recording.joint_states.data["position"], POSITIONS)
    assert any("another order" in text for text in recording.warnings)
    assert any("frame_id" in text for text in recording.warnings)


def test_a_gripper_on_the_same_topic_is_left_out(tmp_path):
    both = messages()
    both[3:3] = [(logs.START_NS, logs.joint_state_bytes(logs.START_NS, ["grip"], [0.1]))] * 2
    recording = read_recording(logs.foreign_log(tmp_path / "f.mcap", both))
    np.testing.assert_array_equal(recording.joint_states.data["position"], POSITIONS)
    assert recording.joint_states.sequence.tolist() == [0, 1, 2, *range(5, 22)]
    assert any("2 messages name other joints" in text for text in recording.warnings)


def test_missing_sequence_counts_are_said(tmp_path):
    recording = read_recording(logs.foreign_log(tmp_path / "f.mcap", messages(), sequence=False))
    assert recording.joint_states.sequence.tolist() == list(range(20))
    assert any("no sequence count" in text for text in recording.warnings)


def test_a_wrist_sensor_is_not_taken_for_the_plate(tmp_path):
    from mcap.writer import Writer

    from daq.messages import JOINT_STATE, WRENCH, definition

    with open(tmp_path / "f.mcap", "wb") as out:
        writer = Writer(out)
        writer.start("ros2", "t")
        ids = [
            writer.register_channel(
                topic, "cdr", writer.register_schema(kind, "ros2msg", definition(kind).encode())
            )
            for topic, kind in (("/joint_states", JOINT_STATE), ("/wrist", WRENCH))
        ]
        for stamp, data in messages():
            writer.add_message(ids[0], stamp, data, stamp)
        writer.add_message(ids[1], logs.START_NS, b"\0\1\0\0" + bytes(68), logs.START_NS)
        writer.finish()
    recording = read_recording(tmp_path / "f.mcap")
    assert recording.wrench is None
    assert any("/wrist" in text for text in recording.warnings)


def test_logs_without_joints_are_refused(tmp_path):
    path = logs.foreign_log(
        tmp_path / "f.mcap",
        [(1, b"\0\1\0\0")],
        topic="/scan",
        schema="sensor_msgs/msg/LaserScan",
        text="float32 range_min",
    )
    with pytest.raises(MissingTopicError, match="/joint_states") as caught:
        read_recording(path)
    assert caught.value.exit_code == 4


def test_two_joint_topics_need_a_choice(tmp_path):
    from mcap.writer import Writer

    from daq.messages import JOINT_STATE, definition

    with open(tmp_path / "f.mcap", "wb") as out:
        writer = Writer(out)
        writer.start("ros2", "t")
        schema = writer.register_schema(JOINT_STATE, "ros2msg", definition(JOINT_STATE).encode())
        for topic in ("/left", "/right"):
            channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, 1, messages()[0][1], 1)
        writer.finish()
    with pytest.raises(DataError, match="/left and /right"):
        read_recording(tmp_path / "f.mcap")


def test_bytes_that_are_no_joint_state_are_refused(tmp_path):
    path = logs.foreign_log(tmp_path / "f.mcap", [(1, b"\0\1\0\0" + b"\xff" * 40)])
    with pytest.raises(DataError, match="/joint_states does not hold"):
        read_recording(path)


def test_names_and_values_must_match(tmp_path):
    path = logs.foreign_log(tmp_path / "f.mcap", [(1, logs.joint_state_bytes(1, ["a", "b"], [1, 2, 3]))])
    with pytest.raises(DataError, match="names 2 joints but its position has 3"):
        read_recording(path)
