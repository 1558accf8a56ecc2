"""Topics of a bag or a foreign log become the streams of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from daq.checks import ABSURD, EPOCH_END_NS
from daq.errors import DataError, MissingTopicError, UsageError
from daq.imports.mapping import ImportMap
from daq.imports.tabular import start_ns
from daq.log_reader import recording_of
from daq.mcap_file import LogFile
from daq.messages import CURRENTS_TOPIC, JOINT_STATES_TOPIC, SETPOINTS_TOPIC, WRENCH_TOPIC
from daq.recording import Recording, Stream
from daq.topic_table import topics

_TOPICS = {"joint_states": JOINT_STATES_TOPIC, "motor_currents": CURRENTS_TOPIC, "wrench": WRENCH_TOPIC,
           "setpoints": SETPOINTS_TOPIC}


def topic_recording(log: LogFile, plan: ImportMap, drop: bool) -> tuple[Recording, int]:
    """The recording in a log whose topics a map names, and how many samples were left out.

    Raises:
        DataError: a topic is missing or its samples are unusable.
        UsageError: the map does not fit the log.
    """
    there = topics(log)
    rename = {_TOPICS[key]: name for key, name in plan.topics.items()}
    for name in rename.values():
        if name not in there:
            raise MissingTopicError(log.source, name, tuple(sorted(there)))
    recording = recording_of(log, rename)
    dropped = 0
    changed: dict[str, Stream | None] = {}
    shift = _shift(plan, recording)
    for key in ("joint_states", "motor_currents", "wrench", "setpoints"):
        stream = getattr(recording, key)
        if stream is not None:
            stream, lost = _clean(log.source, _adapt(stream, plan, shift), drop)
            dropped += lost
        changed[key] = stream
    return replace(recording, **changed), dropped  # type: ignore[arg-type]


def _shift(plan: ImportMap, recording: Recording) -> int:
    """What is added to all stamps: logs that count from zero are put at the map's start."""
    stream = recording.joint_states
    stamps = stream.log_time_ns if plan.by_log_time else stream.stamp_ns
    if int(np.median(stamps)) >= EPOCH_END_NS:
        return 0
    return start_ns(plan, np.zeros(1))


def _adapt(stream: Stream, plan: ImportMap, shift: int) -> Stream:
    """Units, joint choice, names and time as the map says."""
    data = dict(stream.data)
    for key in data:
        quantity = "setpoint" if stream.topic == SETPOINTS_TOPIC and key == "position" else key
        if quantity in plan.channels:
            data[key] = plan.channels[quantity].to_si(data[key])
    names = stream.names
    if names and plan.joints:
        absent = [name for name in plan.joints if name not in names]
        if absent:
            raise UsageError(f"{plan.source}: {stream.topic} has no joint {absent[0]!r}; it has "
                             f"{', '.join(names)}.")
        order = [names.index(name) for name in plan.joints]
        names, data = plan.joints, {key: values[:, order] for key, values in data.items()}
    if names and plan.rename:
        if len(plan.rename) != len(names):
            raise UsageError(f"{plan.source}: [joints] rename has {len(plan.rename)} names for "
                             f"{len(names)} joints.")
        names = plan.rename
    stamp = stream.log_time_ns if plan.by_log_time else stream.stamp_ns
    log_time = np.where(stream.log_time_ns < EPOCH_END_NS, stream.log_time_ns + shift, stream.log_time_ns)
    return replace(stream, names=names, data=data, stamp_ns=stamp + shift, log_time_ns=log_time)


def _clean(source: str, stream: Stream, drop: bool) -> tuple[Stream, int]:
    """Without samples that are not finite or whose stamp does not increase."""
    table = np.column_stack(list(stream.data.values()))
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(table) < ABSURD).all(axis=1)
    latest = np.maximum.accumulate(np.concatenate([[np.iinfo(np.int64).min], stream.stamp_ns[:-1]]))
    late = stream.stamp_ns <= latest
    wrong = bad | late
    if not wrong.any():
        return stream, 0
    if not drop or wrong.all():
        row = int(np.argmax(wrong))
        what = "holds NaN, infinite or absurd numbers" if bad[row] else "has a stamp not after the one before"
        raise DataError(f"{source}: message {row} of {stream.topic} {what} ({int(wrong.sum())} such "
                        f"messages); correct it or give --drop-bad-rows.")
    return _take(stream, ~wrong), int(wrong.sum())


def _take(stream: Stream, keep: np.ndarray) -> Stream:
    data: Mapping[str, np.ndarray] = {key: values[keep] for key, values in stream.data.items()}
    return replace(stream, stamp_ns=stream.stamp_ns[keep], log_time_ns=stream.log_time_ns[keep],
                   sequence=stream.sequence[keep], data=data)
