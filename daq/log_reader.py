"""Reads a log into arrays, whatever wrote it, as long as it says where the joints were."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from daq.errors import DataError, MissingTopicError
from daq.mcap_file import LogFile, open_log
from daq.messages import (
    CURRENTS_TOPIC,
    JOINT_STATE,
    JOINT_STATES_TOPIC,
    MOTOR_CURRENTS,
    SETPOINTS_TOPIC,
    WRENCH,
    WRENCH_TOPIC,
)
from daq.recording import Recording, Stream
from daq.topic_table import Batch, Table, read_table, topics

METADATA_RECORD = "residuum.run"
NANOSECONDS = 1_000_000_000
_KEYS = {JOINT_STATE: ("position", "velocity", "effort"), MOTOR_CURRENTS: ("current",)}


def read_recording(path: str | Path) -> Recording:
    """Read the streams, metadata and attachments of a log, every checksum verified.

    Args:
        path: an MCAP log of any source with a ``JointState`` topic.

    Returns:
        The recording, each stream at its own instants.

    Raises:
        DataError: the log is damaged, is something else, or lacks joint states.
        UsageError: the file cannot be read.
    """
    return recording_of(open_log(path))


def recording_of(log: LogFile, rename: Mapping[str, str] | None = None) -> Recording:
    """The recording in a log already open.

    Args:
        log: the open log.
        rename: contract topic to the topic that holds it here, for logs with other names.
    """
    there, rename = topics(log), rename or {}
    warnings = list(log.warnings)
    joints = rename.get(JOINT_STATES_TOPIC) or _joint_states_topic(log, there, warnings)

    def optional(topic: str, schema: str) -> Stream | None:
        name = rename.get(topic, topic)
        if there.get(name) != schema or name == joints:
            return None
        return _stream(log, name, topic, warnings)

    wrench = optional(WRENCH_TOPIC, WRENCH)
    if wrench is None:
        _mention_other_wrenches(there, warnings)
    return Recording(
        source=log.source,
        joint_states=_stream(log, joints, JOINT_STATES_TOPIC, warnings),
        motor_currents=optional(CURRENTS_TOPIC, MOTOR_CURRENTS),
        wrench=wrench,
        setpoints=optional(SETPOINTS_TOPIC, JOINT_STATE),
        metadata=dict(log.metadata.get(METADATA_RECORD, {})),
        attachments=dict(log.attachments),
        sha256=log.sha256,
        warnings=tuple(warnings),
    )


def read_raw(path: str | Path, topic: str) -> dict[str, np.ndarray]:
    """Every field of a topic of one of the project's own raw types, as (n, ...) arrays or text tuples.

    Raises:
        MissingTopicError: the log has no messages there.
    """
    log = open_log(path)
    there = topics(log)
    if topic not in there:
        raise MissingTopicError(log.source, topic, tuple(sorted(there)))
    table = read_table(log, topic)
    out: dict[str, np.ndarray] = {name: np.asarray(table.headers[name]) for name in ("sequence", "log_time")}
    for name in table.batches[0].columns:
        out[name] = _any_column(table, [batch.columns[name] for batch in table.batches])
    for name in table.batches[0].texts:
        texts = np.empty(len(table.headers), object)
        for batch in table.batches:
            texts[batch.rows] = np.fromiter([batch.texts[name]] * len(batch.rows), object, len(batch.rows))
        out[name] = texts
    out["stamp_ns"] = _stamps(table)
    return out


def _any_column(table: Table, parts: list[np.ndarray]) -> np.ndarray:
    """Rows of unequal width become an object array of rows."""
    if len(parts) == 1:
        return parts[0]
    widths = {part.shape[1:] for part in parts}
    if len(widths) == 1:
        out = np.empty((len(table.headers), *parts[0].shape[1:]), parts[0].dtype)
    else:
        out = np.empty(len(table.headers), object)
    for batch, part in zip(table.batches, parts, strict=True):
        if len(widths) == 1:
            out[batch.rows] = part
        else:
            out[batch.rows] = np.fromiter(part, object, len(part))
    return out


def _joint_states_topic(log: LogFile, there: dict[str, str], warnings: list[str]) -> str:
    """The joint states' topic: by name, else the only one of the type."""
    if there.get(JOINT_STATES_TOPIC) == JOINT_STATE:
        return JOINT_STATES_TOPIC
    others = [topic for topic, schema in there.items() if schema == JOINT_STATE and topic != SETPOINTS_TOPIC]
    if len(others) == 1:
        warnings.append(f"the joint states are taken from {others[0]}")
        return others[0]
    if others:
        raise DataError(f"{log.source} holds joint states on {' and '.join(sorted(others))} but none on "
                        f"{JOINT_STATES_TOPIC}; choose one with `residuum import --map`.")
    raise MissingTopicError(log.source, JOINT_STATES_TOPIC, tuple(sorted(there)))


def _mention_other_wrenches(there: dict[str, str], warnings: list[str]) -> None:
    """A wrench elsewhere may be a wrist sensor: taking it for the base plate would be wrong silently."""
    others = sorted(topic for topic, schema in there.items() if schema == WRENCH)
    if others:
        warnings.append(f"the wrench on {', '.join(others)} is not used: if it is the force plate under the "
                        f"base, map it to {WRENCH_TOPIC} with `residuum import`")


def _stamps(table: Table) -> np.ndarray:
    seconds = table.column("header.stamp.sec").astype(np.int64)
    return seconds * NANOSECONDS + table.column("header.stamp.nanosec").astype(np.int64)


def _stream(log: LogFile, topic: str, as_topic: str, warnings: list[str]) -> Stream:
    table = read_table(log, topic)
    if table.schema == WRENCH:
        names: tuple[str, ...] = ()
        kept, data = np.ones(len(table.headers), bool), _wrench_columns(table)
    else:
        names, kept, data = _joint_columns(log, table, warnings)
    headers = table.headers if kept.all() else table.headers[kept]
    stamps = _stamps(table)
    return Stream(
        topic=as_topic,
        schema=table.schema,
        names=names,
        frame_id=_frame(table, warnings),
        stamp_ns=stamps if kept.all() else stamps[kept],
        log_time_ns=headers["log_time"].astype(np.int64),
        sequence=_sequence(headers, as_topic, warnings),
        data=data,
    )


def _frame(table: Table, warnings: list[str]) -> str:
    frames = list(dict.fromkeys(str(batch.texts["header.frame_id"]) for batch in table.batches))
    if len(frames) > 1:
        warnings.append(f"{table.topic} changes its frame_id ({', '.join(map(repr, frames))}); "
                        f"the first is kept")
    return frames[0]


def _sequence(headers: np.ndarray, topic: str, warnings: list[str]) -> np.ndarray:
    counts = headers["sequence"].astype(np.uint32)
    if len(counts) > 1 and (counts == counts[0]).all():
        warnings.append(f"{topic} carries no sequence count: lost samples show only in its stamps")
        return np.arange(len(counts), dtype=np.uint32)
    return counts


def _wrench_columns(table: Table) -> dict[str, np.ndarray]:
    return {
        key: np.column_stack([table.column(f"wrench.{key}.{axis}") for axis in "xyz"]).astype(np.float64)
        for key in ("force", "torque")
    }


def _joint_columns(
    log: LogFile, table: Table, warnings: list[str]
) -> tuple[tuple[str, ...], np.ndarray, dict[str, np.ndarray]]:
    """Names, which messages are kept, and (n, k) columns in the order of the first message's names."""
    names, batches = _one_set_of_joints(log, table, warnings)
    kept = np.zeros(len(table.headers), bool)
    for batch in batches:
        kept[batch.rows] = True
    slot = np.cumsum(kept) - 1  # where a kept message ends up
    data: dict[str, np.ndarray] = {}
    for key in _KEYS[table.schema]:
        filled = [batch for batch in batches if batch.columns[key].shape[1]]
        if not filled or (len(filled) < len(batches) and key != "position"):
            if filled:
                warnings.append(f"{table.topic}: {key} is empty in some messages and is left out")
            continue
        data[key] = _merge(log, table.topic, key, names, filled, slot, int(kept.sum()))
    if _KEYS[table.schema][0] not in data:
        raise DataError(f"{log.source}: {table.topic} has messages but their "
                        f"{_KEYS[table.schema][0]} arrays are empty; record them too.")
    return names, kept, data


def _one_set_of_joints(
    log: LogFile, table: Table, warnings: list[str]
) -> tuple[tuple[str, ...], list[Batch]]:
    """The joints most messages speak of, in their first message's order, and the batches that have them."""
    weight: Counter[frozenset[str]] = Counter()
    for batch in table.batches:
        weight[frozenset(_names(log, table, batch))] += len(batch.rows)
    joints, count = weight.most_common(1)[0]
    batches = [batch for batch in table.batches if frozenset(_names(log, table, batch)) == joints]
    first = min(batches, key=lambda batch: batch.rows[0])
    names = _names(log, table, first)
    if count < len(table.headers):
        warnings.append(f"{table.topic}: {len(table.headers) - count} messages name other joints than "
                        f"{', '.join(names)} and are left out")
    moved = sum(len(batch.rows) for batch in batches if _names(log, table, batch) != names)
    if moved:
        warnings.append(f"{table.topic}: {moved} messages list the joints in another order than the first; "
                        f"they were put into its order")
    return names, batches


def _names(log: LogFile, table: Table, batch: Batch) -> tuple[str, ...]:
    names = tuple(batch.texts["name"])
    if not names:
        width = batch.columns[_KEYS[table.schema][0]].shape[1]
        return tuple(f"joint_{i + 1}" for i in range(width))
    if len(set(names)) < len(names):
        raise DataError(f"{log.source}: {table.topic} names a joint twice ({', '.join(names)}); "
                        "give every joint its own name where the log is written.")
    return names


def _merge(
    log: LogFile, topic: str, key: str, names: tuple[str, ...], batches: list[Batch],
    slot: np.ndarray, count: int,
) -> np.ndarray:
    """(n, k) numbers of all batches in one joint order; rows no batch has are NaN."""
    out = np.full((count, len(names)), np.nan)
    for batch in batches:
        values = batch.columns[key]
        if values.shape[1] != len(names):
            raise DataError(f"{log.source}: {topic} names {len(names)} joints but its {key} has "
                            f"{values.shape[1]} values (message {int(batch.rows[0])}).")
        own = tuple(batch.texts["name"]) or names
        order = [own.index(name) for name in names]
        out[slot[batch.rows]] = values if order == list(range(len(names))) else values[:, order]
    return out
