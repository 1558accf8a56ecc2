"""Small recordings, files and foreign logs for the tests of log files."""

from pathlib import Path

import numpy as np
import pytest

from daq.messages import JOINT_STATE, MOTOR_CURRENTS, WRENCH, definition
from daq.recording import Recording, Stream

SHARED = Path(__file__).parents[3] / "shared" / "data"
START_NS = 1_760_000_000_000_000_000
NAMES = ("a", "b", "c")


def shared(name):
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"the shared recording {path} is not on this machine")
    return path


def stamps(count, rate_hz=150.0, start_ns=START_NS, ppm=0.0, jitter_ns=0.0, seed=0):
    uniform = np.arange(count) * (1e9 / rate_hz) * (1 + ppm * 1e-6)
    noise = np.random.default_rng(seed).normal(0, jitter_ns, count) if jitter_ns else 0
    return start_ns + np.round(uniform + noise).astype(np.int64)


def joint_stream(count=600, rate_hz=150.0, names=NAMES, topic="/joint_states", keys=("position",), **kw):
    stamp = stamps(count, rate_hz, **kw)
    t = (stamp - stamp[0]) * 1e-9
    angle = np.column_stack([np.sin(2 * np.pi * (i + 1) * t + i) for i in range(len(names))])
    data = {key: angle * (1 + i) for i, key in enumerate(keys)}
    return Stream(
        topic,
        JOINT_STATE,
        tuple(names),
        "base_link",
        stamp,
        stamp + 1000,
        np.arange(count, dtype=np.uint32),
        data,
    )


def recording(count=600, rate_hz=150.0, plate_ppm=40.0, noise=0.0, **metadata):
    joints = joint_stream(count, rate_hz)
    rng = np.random.default_rng(1)
    t = (joints.stamp_ns - joints.stamp_ns[0]) * 1e-9
    current = np.column_stack([np.cos(2 * np.pi * t + i) for i in range(3)]) + noise * rng.normal(
        size=(count, 3)
    )
    currents = Stream(
        "/motor_currents",
        MOTOR_CURRENTS,
        NAMES,
        "",
        joints.stamp_ns,
        joints.log_time_ns,
        joints.sequence,
        {"current": current},
    )
    stamp = stamps(count, rate_hz, START_NS + 1_700_000, ppm=plate_ppm)
    wrench = Stream(
        "/force_plate/wrench",
        WRENCH,
        (),
        "force_plate",
        stamp,
        stamp + 900,
        np.arange(count, dtype=np.uint32),
        {"force": rng.normal(size=(count, 3)), "torque": rng.normal(size=(count, 3))},
    )
    meta = {"schema_version": "1", "run_id": "r", "robot": "x", "kind": "excitation", "simulated": "true"}
    return Recording(
        "memory",
        joints,
        currents,
        wrench,
        None,
        {**meta, **metadata},
        {"robot.toml": b'name = "x"\n'},
        "",
        (),
    )


def assert_same(a, b):
    for one, other in zip(a.streams, b.streams, strict=True):
        assert (one.topic, one.schema, one.names, one.frame_id) == (
            other.topic,
            other.schema,
            other.names,
            other.frame_id,
        )
        for key in ("stamp_ns", "log_time_ns", "sequence"):
            np.testing.assert_array_equal(getattr(one, key), getattr(other, key))
        assert set(one.data) == set(other.data)
        for key, values in one.data.items():
            np.testing.assert_array_equal(values, other.data[key])


def foreign_log(
    path,
    messages,
    topic="/joint_states",
    schema=JOINT_STATE,
    text=None,
    chunked=True,
    compression="zstd",
    profile="ros2",
    index=True,
    sequence=True,
):
    """Write messages (CDR bytes or dicts for mcap-ros2-support) by the reference library."""
    from mcap.writer import CompressionType, IndexType, Writer

    kinds = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
    with open(path, "wb") as out:
        writer = Writer(
            out,
            compression=kinds[compression],
            use_chunking=chunked,
            chunk_size=4000,
            index_types=IndexType.ALL if index else IndexType.NONE,
        )
        writer.start(profile, "test")
        sid = writer.register_schema(schema, "ros2msg", (text or definition(schema)).encode())
        cid = writer.register_channel(topic, "cdr", sid)
        for i, (stamp, data) in enumerate(messages):
            writer.add_message(cid, stamp, data, stamp, i if sequence else 0)
        writer.finish()
    return path


def joint_state_bytes(stamp, names, position, velocity=(), effort=(), frame="base", big_endian=False):
    """One JointState as another implementation (rosbags) encodes it."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id=frame
    )
    message = types["sensor_msgs/msg/JointState"](
        header=header,
        name=list(names),
        position=np.array(position, float),
        velocity=np.array(velocity, float),
        effort=np.array(effort, float),
    )
    return bytes(store.serialize_cdr(message, "sensor_msgs/msg/JointState", little_endian=not big_endian))


def decoded(path, topics=None):
    """Every message as mcap-ros2-support decodes it."""
    from types import SimpleNamespace

    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, ros in reader.iter_decoded_messages(topics=topics, log_time_order=False):
            yield SimpleNamespace(topic=channel.topic, sequence=message.sequence, ros_msg=ros)
