"""What is written is what is read: by this project, mcap-ros2-support and rosbags."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from daq.cdr import layout_of, template
from daq.log_reader import read_raw, read_recording
from daq.log_writer import LogWriter, write_recording
from daq.messages import TOPIC_SCHEMAS, fields
from tests.daq import logs


def test_a_recording_survives_the_file(tmp_path):
    recording = logs.recording()
    write_recording(recording, tmp_path / "run.mcap")
    again = read_recording(tmp_path / "run.mcap")
    logs.assert_same(recording, again)
    assert again.metadata == recording.metadata
    assert again.attachments == recording.attachments
    assert again.warnings == ()
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


def test_live_and_bulk_writing_agree(tmp_path):
    recording = logs.recording(count=40)
    joints, currents, wrench = recording.joint_states, recording.motor_currents, recording.wrench
    with LogWriter(tmp_path / "live.mcap", recording.metadata) as log:
        for i in range(40):
            when = [
                (int(s.stamp_ns[i]), int(s.log_time_ns[i]), int(s.sequence[i]))
                for s in (joints, currents, wrench)
            ]
            log.write_joint_states(*when[0], joints.names, joints.data["position"][i])
            log.write_motor_currents(*when[1], joints.names, list(currents.data["current"][i]))
            log.write_wrench(*when[2], wrench.data["force"][i], wrench.data["torque"][i])
            if i == 20:
                log.flush()
    again = read_recording(tmp_path / "live.mcap")
    assert again.motor_currents.frame_id == ""
    logs.assert_same(recording, again)


def test_mcap_ros2_support_reads_the_same(tmp_path):
    recording = logs.recording(count=50)
    write_recording(recording, tmp_path / "run.mcap")
    seen = {}
    for message in logs.decoded(tmp_path / "run.mcap"):
        seen.setdefault(message.topic, []).append(message)
    joints = seen["/joint_states"]
    assert [m.sequence for m in joints] == list(range(50))
    np.testing.assert_array_equal(
        [m.ros_msg.position for m in joints], recording.joint_states.data["position"]
    )
    stamps = [m.ros_msg.header.stamp.sec * 10**9 + m.ros_msg.header.stamp.nanosec for m in joints]
    np.testing.assert_array_equal(stamps, recording.joint_states.stamp_ns)
    assert list(joints[0].ros_msg.name) == list(logs.NAMES)
    assert not len(joints[0].ros_msg.effort)
    np.testing.assert_array_equal(
        [m.ros_msg.current for m in seen["/motor_currents"]], recording.motor_currents.data["current"]
    )
    np.testing.assert_array_equal(
        [m.ros_msg.wrench.torque.z for m in seen["/force_plate/wrench"]],
        recording.wrench.data["torque"][:, 2],
    )


def test_rosbags_reads_the_same(tmp_path):
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    recording = logs.recording(count=50)
    write_recording(recording, tmp_path / "run.mcap")
    seen = {}
    with AnyReader([tmp_path / "run.mcap"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, _, data in reader.messages():
            seen.setdefault(connection.topic, []).append(reader.deserialize(data, connection.msgtype))
    np.testing.assert_array_equal(
        [m.position for m in seen["/joint_states"]], recording.joint_states.data["position"]
    )
    np.testing.assert_array_equal(
        [m.current for m in seen["/motor_currents"]], recording.motor_currents.data["current"]
    )
    np.testing.assert_array_equal(
        [m.wrench.force.y for m in seen["/force_plate/wrench"]], recording.wrench.data["force"][:, 1]
    )


def test_the_reference_checker_finds_every_checksum_right(tmp_path):
    from mcap.reader import make_reader

    write_recording(logs.recording(), tmp_path / "run.mcap")
    with open(tmp_path / "run.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary.statistics.message_count == 1800
        assert summary.statistics.attachment_count == 1
        assert [a.name for a in reader.iter_attachments()] == ["robot.toml"]
        assert next(iter(reader.iter_metadata())).name == "residuum.run"
        assert sum(1 for _ in reader.iter_messages()) == 1800
        assert reader.get_header().profile == "ros2"
        assert {c.compression for c in summary.chunk_indexes} == {"zstd"}


def test_raw_topics_keep_counts_and_words(tmp_path):
    names = ("a", "b")
    with LogWriter(tmp_path / "raw.mcap") as log:
        for i in range(5):
            log.write_joint_states(logs.START_NS + i, logs.START_NS + i, i, names, [0.0, i])
            log.write_raw(
                "/drive/raw",
                logs.START_NS + i,
                logs.START_NS + i,
                i,
                name=names,
                device_stamp=2**63 + i,
                host_receive_ns=-i,
                cycle=i,
                position=[-(2**31), i],
                velocity=[1, 2],
                current=[3, 4],
                status_word=[0x1637, 2**32 - 1],
                demand=[5, 6],
                target=[7, 8],
                flags=[0, 1],
                receive_ns=[9, -10],
            )
            log.write_raw(
                "/clock_sync",
                logs.START_NS + i,
                logs.START_NS + i,
                i,
                device="plate",
                device_stamp=i,
                host_receive_ns=i,
                mapped_ns=i,
                uncertainty_s=1e-6,
            )
            log.write_raw(
                "/force_plate/raw",
                logs.START_NS + i,
                logs.START_NS + i,
                i,
                device_stamp=i,
                host_receive_ns=i,
                counter=i,
                status_word=0,
                counts=range(i),
                values=[0.5] * 6,
                temperature=21.5,
                segment=0,
                lost=i,
                wrench=[0.25] * 6,
            )
        log.write_event(logs.START_NS, logs.START_NS, 0, "fault", "error", 7, "the drive of a stopped")
        log.write_event(logs.START_NS, logs.START_NS, 1, "end", "info", 9, "done")
    drive = read_raw(tmp_path / "raw.mcap", "/drive/raw")
    assert drive["position"].tolist() == [[-(2**31), i] for i in range(5)]
    assert drive["device_stamp"].tolist() == [2**63 + i for i in range(5)]
    assert drive["status_word"][0].tolist() == [0x1637, 2**32 - 1]
    plate = read_raw(tmp_path / "raw.mcap", "/force_plate/raw")
    assert [len(row) for row in plate["counts"]] == [0, 1, 2, 3, 4]
    events = read_raw(tmp_path / "raw.mcap", "/events")
    assert events["text"].tolist() == ["the drive of a stopped", "done"]
    assert events["cycle"].tolist() == [7, 9]
    texts = [m.ros_msg.text for m in logs.decoded(tmp_path / "raw.mcap", topics=["/events"])]
    assert texts == ["the drive of a stopped", "done"]
    words = [m.ros_msg.status_word[1] for m in logs.decoded(tmp_path / "raw.mcap", topics=["/drive/raw"])]
    assert words == [2**32 - 1] * 5


def test_later_metadata_wins(tmp_path):
    with LogWriter(tmp_path / "m.mcap", {"kind": "free", "missing": "?"}) as log:
        log.write_joint_states(logs.START_NS, logs.START_NS, 0, ("a",), [0.0])
        log.add_metadata({"missing": "0"})
    assert read_recording(tmp_path / "m.mcap").metadata == {"kind": "free", "missing": "0"}
    with (tmp_path / "m.mcap").open("rb") as stream:
        last = list(make_reader(stream).iter_metadata())[-1]
    assert last.metadata == {"kind": "free", "missing": "0"}  # whole for readers that take one record


_TEXT = st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), max_size=9)
_WORDS = {
    "int32": (-(2**31), 2**31 - 1),
    "uint32": (0, 2**32 - 1),
    "int64": (-(2**63), 2**63 - 1),
    "uint64": (0, 2**64 - 1),
}


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(sorted(set(TOPIC_SCHEMAS.values()))), st.data())
def test_any_message_comes_back_from_its_bytes(schema, data):
    """Bytes made for any texts and lengths are found again by walking them."""
    texts, counts = {}, {}
    for field in fields(schema):
        if field.kind == "string":
            strategy = st.lists(_TEXT, max_size=4) if field.sequence else _TEXT
            texts[field.name] = data.draw(strategy)
        elif field.sequence:
            counts[field.name] = data.draw(st.integers(0, 5))
    raw, _ = template(fields(schema), texts, counts)
    layout = layout_of(fields(schema), raw)
    for name, text in texts.items():
        assert layout.texts[name] == (tuple(text) if isinstance(text, list) else text)
    assert {n: s.count for n, s in layout.slots.items() if s.count is not None} == counts
    assert layout.size == len(raw)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(-(2**31) * 10**9, (2**31 - 1) * 10**9),
            st.integers(0, 2**64 - 1),
            st.integers(0, 2**32 - 1),
            st.lists(st.floats(width=64), min_size=2, max_size=2),
        ),
        min_size=1,
        max_size=20,
    )
)
def test_any_numbers_survive(tmp_path_factory, samples):
    path = tmp_path_factory.mktemp("p") / "any.mcap"
    with LogWriter(path) as log:
        for stamp, log_time, sequence, position in samples:
            log.write_joint_states(stamp, log_time % 2**63, sequence, ("x", "y"), position, effort=position)
    stream = read_recording(path).joint_states
    assert stream.stamp_ns.tolist() == [s[0] for s in samples]
    np.testing.assert_array_equal(stream.data["effort"], [s[3] for s in samples])
    if len(set(s[2] for s in samples)) > 1:
        assert stream.sequence.tolist() == [s[2] for s in samples]


@pytest.mark.shared
def test_the_sample_logs_agree_with_the_reference_reader():
    path = logs.shared("ir361/samples/plain.validation.mcap")
    mine = read_recording(path)
    theirs = {}
    for message in logs.decoded(path):
        theirs.setdefault(message.topic, []).append(message.ros_msg)
    np.testing.assert_array_equal(
        [m.position for m in theirs["/joint_states"]], mine.joint_states.data["position"]
    )
    np.testing.assert_array_equal(
        [m.current for m in theirs["/motor_currents"]], mine.motor_currents.data["current"]
    )
    np.testing.assert_array_equal(
        [(m.wrench.force.x, m.wrench.force.y, m.wrench.force.z) for m in theirs["/force_plate/wrench"]],
        mine.wrench.data["force"],
    )
    assert mine.metadata["kind"] == "validation"
