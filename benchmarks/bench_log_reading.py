"""Reading and writing a 160 s log, three topics at 150 Hz: this project, mcap-ros2-support and rosbags.

Run: ``.venv/bin/python -m benchmarks.bench_log_reading``.
"""

import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from daq.log_reader import read_recording
from daq.log_writer import LogWriter, write_recording
from daq.messages import JOINT_STATE, MOTOR_CURRENTS, WRENCH, definition
from daq.recording import Recording, Stream

SECONDS, RATE_HZ, JOINTS = 160, 150, 3


def make_recording():
    """160 s of noise at 150 Hz: nothing compresses, so nobody wins by compression."""
    count = SECONDS * RATE_HZ
    stamp = 1_760_000_000_000_000_000 + np.round(np.arange(count) * 1e9 / RATE_HZ).astype(np.int64)
    rng = np.random.default_rng(0)
    names = tuple(f"joint_{i + 1}" for i in range(JOINTS))

    def stream(topic, schema, names, frame, **data):
        return Stream(topic, schema, names, frame, stamp, stamp, np.arange(count, dtype=np.uint32), data)

    joints = stream(
        "/joint_states", JOINT_STATE, names, "base_link", position=rng.normal(size=(count, JOINTS))
    )
    currents = stream("/motor_currents", MOTOR_CURRENTS, names, "", current=rng.normal(size=(count, JOINTS)))
    wrench = stream(
        "/force_plate/wrench",
        WRENCH,
        (),
        "force_plate",
        force=rng.normal(size=(count, 3)),
        torque=rng.normal(size=(count, 3)),
    )
    return Recording("", joints, currents, wrench, None, {}, {}, "", ())


def median_ms(function, repeats):
    """Median wall time after one run that warms caches."""
    function()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append((time.perf_counter() - start) * 1e3)
    return statistics.median(times)


def read_reference(path):
    """The same arrays by mcap-ros2-support."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    found = {}
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(log_time_order=False):
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            if channel.topic == "/joint_states":
                values = message.position
            elif channel.topic == "/motor_currents":
                values = message.current
            else:
                w = message.wrench
                values = (w.force.x, w.force.y, w.force.z, w.torque.x, w.torque.y, w.torque.z)
            found.setdefault(channel.topic, ([], []))
            found[channel.topic][0].append(stamp)
            found[channel.topic][1].append(values)
    return {topic: (np.array(stamps), np.array(rows)) for topic, (stamps, rows) in found.items()}


def read_rosbags(path):
    """The same messages by rosbags."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        return [reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()]


def live_rows(recording):
    """Plain Python numbers, as a recorder has them."""
    joints, currents, wrench = recording.joint_states, recording.motor_currents, recording.wrench
    return list(
        zip(
            joints.stamp_ns.tolist(),
            joints.data["position"].tolist(),
            currents.data["current"].tolist(),
            wrench.data["force"].tolist(),
            wrench.data["torque"].tolist(),
            strict=True,
        )
    )


def write_live(rows, names, path):
    """Message by message, a chunk each second."""
    path.unlink(missing_ok=True)
    with LogWriter(path) as log:
        for i, (stamp, position, current, force, torque) in enumerate(rows):
            log.write_joint_states(stamp, stamp, i, names, position)
            log.write_motor_currents(stamp, stamp, i, names, current)
            log.write_wrench(stamp, stamp, i, force, torque)
            if i % RATE_HZ == 0:
                log.flush()


def write_reference(rows, names, path):
    """Message by message by mcap-ros2-support."""
    from mcap_ros2.writer import Writer

    axes = "xyz"
    with open(path, "wb") as out:
        writer = Writer(out)
        ids = [
            writer.register_msgdef(kind, definition(kind)) for kind in (JOINT_STATE, MOTOR_CURRENTS, WRENCH)
        ]
        for i, (stamp, position, current, force, torque) in enumerate(rows):
            header = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": "base_link"}
            when = {"log_time": stamp, "publish_time": stamp, "sequence": i}
            writer.write_message(
                "/joint_states",
                ids[0],
                {"header": header, "name": names, "position": position, "velocity": [], "effort": []},
                **when,
            )
            writer.write_message(
                "/motor_currents", ids[1], {"header": header, "name": names, "current": current}, **when
            )
            wrench = {
                "force": dict(zip(axes, force, strict=True)),
                "torque": dict(zip(axes, torque, strict=True)),
            }
            writer.write_message("/force_plate/wrench", ids[2], {"header": header, "wrench": wrench}, **when)
        writer.finish()


def main():
    """Print every median and ratio."""
    with tempfile.TemporaryDirectory() as folder:
        path, other = Path(folder) / "run.mcap", Path(folder) / "other.mcap"
        recording = make_recording()
        write_recording(recording, path)
        np.testing.assert_array_equal(
            read_reference(path)["/joint_states"][1], read_recording(path).joint_states.data["position"]
        )
        mine = median_ms(lambda: read_recording(path), 15)
        reference = median_ms(lambda: read_reference(path), 3)
        rosbags = median_ms(lambda: read_rosbags(path), 3)
        rows, names = live_rows(recording), list(recording.joint_states.names)
        written = median_ms(lambda: write_live(rows, names, other), 3)
        reference_written = median_ms(lambda: write_reference(rows, names, other), 3)
        whole = median_ms(lambda: write_recording(recording, path), 5)
    print(f"log: {SECONDS} s, 3 topics, {RATE_HZ} Hz, {3 * SECONDS * RATE_HZ} messages")
    print(
        f"read   residuum {mine:8.1f} ms  mcap-ros2-support {reference:8.1f} ms ({reference / mine:.1f} x)   "
        f"rosbags {rosbags:8.1f} ms ({rosbags / mine:.1f} x)"
    )
    print(
        f"write  residuum {written:8.1f} ms   mcap-ros2-support {reference_written:8.1f} ms "
        f"({reference_written / written:.1f} x), message by message; whole recording {whole:.1f} ms"
    )


if __name__ == "__main__":
    main()
