"""Writes the log of a run while it happens, or a whole recording at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from daq.errors import UsageError
from daq.interleave import interleave
from daq.log_reader import METADATA_RECORD
from daq.mcap_writer import McapWriter
from daq.messages import (
    CURRENTS_TOPIC,
    EVENT,
    EVENTS_TOPIC,
    JOINT_STATES_TOPIC,
    SETPOINTS_TOPIC,
    TOPIC_SCHEMAS,
    WRENCH,
    WRENCH_TOPIC,
    definition,
    fields,
)
from daq.record_template import RecordTemplate
from daq.recording import Recording, Stream

CHUNK_BYTES = 1 << 20  # a chunk ends here at the latest, even when nobody flushes
FRAMES = {WRENCH_TOPIC: "force_plate", JOINT_STATES_TOPIC: "base_link"}

Numbers = Sequence[float] | np.ndarray


class LogWriter:
    """The log of one run, growing at ``<path>.partial`` and renamed when closed.

    All methods belong to one thread, except :meth:`sync`, which may be called from any.
    Leaving the ``with`` block by an exception keeps the partial file for ``residuum recover``.

    Args:
        path: final name of the log.
        metadata: the run's ``residuum.run`` record.
        attachments: files to carry along, name to content.
        file: go on writing this one instead of a new one.

    Raises:
        UsageError: the file cannot be created.
    """

    def __init__(
        self,
        path: str | Path,
        metadata: Mapping[str, str] | None = None,
        attachments: Mapping[str, bytes] | None = None,
        file: McapWriter | None = None,
    ) -> None:
        self.file = file or McapWriter(path)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._templates: dict[tuple[object, ...], RecordTemplate] = {}
        self._block = bytearray()
        self._offsets: list[int] = []
        self._ids: list[int] = []
        self._times: list[int] = []
        self.metadata: dict[str, str] = {}
        if metadata:
            self.add_metadata(metadata)
        for name, data in (attachments or {}).items():
            self.file.add_attachment(name, data)

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abort()

    def add_metadata(self, metadata: Mapping[str, str]) -> None:
        """Add to the run's record, such as the proof of completeness at its end; later values win.

        Every record written holds all that was said so far: a reader that takes only the last one misses nothing.
        """
        self.metadata = {**self.metadata, **metadata}
        self.file.add_metadata(METADATA_RECORD, self.metadata)

    def write_joint_states(
        self, stamp_ns: int, log_time_ns: int, sequence: int, names: Sequence[str], position: Numbers,
        velocity: Numbers | None = None, effort: Numbers | None = None,
    ) -> None:
        """Log where the joints were: rad (m), rad/s (m/s), N.m (N), joint side."""
        self._write_joints(JOINT_STATES_TOPIC, (stamp_ns, log_time_ns, sequence), names,
                           {"position": position, "velocity": velocity, "effort": effort})

    def write_setpoints(
        self, stamp_ns: int, log_time_ns: int, sequence: int, names: Sequence[str], position: Numbers,
        velocity: Numbers | None = None, effort: Numbers | None = None,
    ) -> None:
        """Log what was commanded, in the units of the joint states."""
        self._write_joints(SETPOINTS_TOPIC, (stamp_ns, log_time_ns, sequence), names,
                           {"position": position, "velocity": velocity, "effort": effort})

    def write_motor_currents(
        self, stamp_ns: int, log_time_ns: int, sequence: int, names: Sequence[str], current: Numbers
    ) -> None:
        """Log the motor currents [A], motor side."""
        self._write_joints(CURRENTS_TOPIC, (stamp_ns, log_time_ns, sequence), names, {"current": current})

    def write_wrench(
        self, stamp_ns: int, log_time_ns: int, sequence: int, force: Numbers, torque: Numbers
    ) -> None:
        """Log what the plate exerts on the robot [N, N.m], in the plate's frame about its origin."""
        found = self._template(WRENCH_TOPIC, {"header.frame_id": FRAMES[WRENCH_TOPIC]}, {})
        self._append(found, (stamp_ns, log_time_ns, sequence),
                     {"wrench.force": force, "wrench.torque": torque})

    def write_raw(
        self, topic: str, stamp_ns: int, log_time_ns: int, sequence: int, **values: object
    ) -> None:
        """Log one message of ``/drive/raw``, ``/force_plate/raw`` or ``/clock_sync``.

        Args:
            topic: which of the raw topics.
            stamp_ns: sampling instant on the common time base.
            log_time_ns: when the host received it.
            sequence: as the device counted.
            **values: every field of the topic's type but the header (see ``daq.messages``).

        Raises:
            UsageError: a field is missing, unknown or does not fit.
        """
        if topic not in TOPIC_SCHEMAS:
            raise UsageError(f"{topic} is no topic of a log; choose one of {', '.join(TOPIC_SCHEMAS)}.")
        known = {field.name: field for field in fields(TOPIC_SCHEMAS[topic]) if "." not in field.name}
        if values.keys() != known.keys():
            wrong = sorted(values.keys() ^ known.keys())
            raise UsageError(f"{topic} takes exactly {', '.join(known)}; check {', '.join(wrong)}.")
        texts: dict[str, str | tuple[str, ...]] = {"header.frame_id": FRAMES.get(topic, "")}
        counts: dict[str, int] = {}
        for name, field in known.items():
            if field.kind == "string":
                texts[name] = tuple(values[name]) if field.sequence else str(values[name])  # type: ignore[arg-type]
            elif field.sequence:
                counts[name] = len(values[name])  # type: ignore[arg-type]
        self._append(self._template(topic, texts, counts), (stamp_ns, log_time_ns, sequence), values)

    def write_event(
        self, stamp_ns: int, log_time_ns: int, sequence: int, name: str, severity: str, cycle: int, text: str
    ) -> None:
        """Log something that happened, at a cycle of the run."""
        texts = {"header.frame_id": "", "name": name, "severity": severity, "text": text}
        found = RecordTemplate(self._channel(EVENTS_TOPIC), EVENT, texts, {})  # no two texts alike: not kept
        self._append(found, (stamp_ns, log_time_ns, sequence), {"cycle": cycle})

    def write_streams(self, streams: Sequence[Stream]) -> None:
        """Log whole streams at once, interleaved by log time, vectorised."""
        self._end_chunk()
        parts = [self._rows(stream) for stream in streams if len(stream)]
        for block, offsets, channels, times in interleave(parts, CHUNK_BYTES):
            self.file.write_chunk(block, offsets, channels, times)

    def flush(self) -> None:
        """End the chunk and hand it to the operating system; call at a tick boundary, once a second."""
        self._end_chunk()
        self.file.push()

    def sync(self) -> None:
        """Force what was flushed onto the disk; takes milliseconds, so never in a thread that keeps time."""
        self.file.sync()

    def close(self) -> None:
        """Finish the log and give it its final name."""
        if not self.file.closed:
            self._end_chunk()
            self.file.finish()

    def abort(self) -> None:
        """Stop without finishing: the partial file keeps everything written so far."""
        if not self.file.closed:
            self._end_chunk()
            self.file.abandon(keep=True)

    def _write_joints(
        self, topic: str, when: tuple[int, int, int], names: Sequence[str],
        values: Mapping[str, Numbers | None],
    ) -> None:
        names = tuple(names)
        key = (topic, names, *(value is not None for value in values.values()))
        found = self._templates.get(key)
        if found is None:
            counts = {name: 0 if value is None else len(names) for name, value in values.items()}
            texts = {"header.frame_id": FRAMES.get(topic, ""), "name": names}
            found = self._templates[key] = RecordTemplate(
                self._channel(topic), TOPIC_SCHEMAS[topic], texts, counts
            )
        self._append(found, when, values)

    def _template(
        self, topic: str, texts: Mapping[str, str | tuple[str, ...]], counts: Mapping[str, int]
    ) -> RecordTemplate:
        key = (topic, *texts.values(), *counts.values())
        found = self._templates.get(key)
        if found is None:
            found = RecordTemplate(self._channel(topic), TOPIC_SCHEMAS[topic], texts, counts)
            self._templates[key] = found
        return found

    def _channel(self, topic: str) -> int:
        """The topic's channel, declared at its first message."""
        found = self._channels.get(topic)
        if found is None:
            schema = TOPIC_SCHEMAS[topic]
            if schema not in self._schemas:
                self._schemas[schema] = self.file.add_schema(schema, definition(schema))
            found = self._channels[topic] = self.file.add_channel(topic, self._schemas[schema])
        return found

    def _append(
        self, found: RecordTemplate, when: tuple[int, int, int], values: Mapping[str, object]
    ) -> None:
        record = found.fill(*when, values)
        self._offsets.append(len(self._block))
        self._ids.append(found.channel)
        self._times.append(when[1])
        self._block += record
        if len(self._block) >= CHUNK_BYTES:
            self._end_chunk()

    def _end_chunk(self) -> None:
        if not self._offsets:
            return
        block, self._block = bytes(self._block), bytearray()
        arrays = [np.array(column, np.int64) for column in (self._offsets, self._ids, self._times)]
        self._offsets, self._ids, self._times = [], [], []
        self.file.write_chunk(block, *arrays)

    def _rows(self, stream: Stream) -> tuple[int, np.ndarray, np.ndarray]:
        """Channel, (n, bytes) records and log times of a stream."""
        texts: dict[str, str | tuple[str, ...]] = {"header.frame_id": stream.frame_id}
        if stream.schema == WRENCH:
            counts: dict[str, int] = {}
            values = {f"wrench.{key}": column for key, column in stream.data.items()}
        else:
            texts["name"] = stream.names
            sequences = [f.name for f in fields(stream.schema) if f.sequence and f.kind != "string"]
            counts = {name: len(stream.names) if name in stream.data else 0 for name in sequences}
            values = dict(stream.data)
        made = RecordTemplate(self._channel(stream.topic), stream.schema, texts, counts)
        rows = made.rows(stream.stamp_ns, stream.log_time_ns, stream.sequence, values)
        return made.channel, rows, stream.log_time_ns


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write a whole recording as a contract log; nothing is left behind if that fails.

    Args:
        recording: what to write.
        path: the log's name.

    Raises:
        UsageError: the file cannot be written.
    """
    writer = LogWriter(path, recording.metadata, recording.attachments)
    try:
        writer.write_streams(recording.streams)
        writer.close()
    except BaseException:
        writer.file.abandon(keep=False)
        raise
