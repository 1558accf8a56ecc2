"""ROS 2 bags in SQLite: the rows of messages, seen as an open log."""

from __future__ import annotations

import hashlib
import sqlite3
import struct
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.mcap_file import LogFile, message_headers
from daq.mcap_records import MESSAGE_HEADER, RECORD_HEADER, Channel, Op, Schema

_HEADER = struct.Struct("<BQHIQQ")


def open_bag(path: Path) -> LogFile:
    """Read every message of a bag; numbered per topic in the order they were stored.

    Raises:
        DataError: the file is not a ROS 2 bag in SQLite, or its messages are not CDR.
    """
    try:
        with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as bag:
            topics = bag.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            rows = bag.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id").fetchall()
        bag.close()
    except sqlite3.Error as error:
        raise DataError(f"{path} is not a ROS 2 bag in SQLite: {error}; give the .db3 file.") from error
    schemas = {number: Schema(number, kind, "ros2msg", b"") for number, _, kind, _ in topics}
    channels = {number: Channel(number, number, name, form, {}) for number, name, _, form in topics}
    buffer, offsets = _records(rows)
    return LogFile(str(path), "ros2", schemas, channels, {}, {}, buffer, offsets,
                   message_headers(buffer, offsets), hashlib.sha256(path.read_bytes()).hexdigest(), ())


def _records(rows: list[tuple[int, int, bytes]]) -> tuple[np.ndarray, np.ndarray]:
    """The messages as records of a log, and where each begins."""
    parts: list[bytes] = []
    counts: dict[int, int] = {}
    for topic, stamp, data in rows:
        number = counts[topic] = counts.get(topic, -1) + 1
        length = MESSAGE_HEADER - RECORD_HEADER + len(data)
        parts += [_HEADER.pack(Op.MESSAGE, length, topic, number, max(stamp, 0), max(stamp, 0)), data]
    sizes = [MESSAGE_HEADER + len(row[2]) for row in rows]
    offsets = np.cumsum([0, *sizes])[:-1].astype(np.int64)
    return np.frombuffer(b"".join(parts), np.uint8), offsets
