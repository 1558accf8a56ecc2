"""Writes an MCAP file chunk by chunk, beside its final name until it is whole.

Source: MCAP format specification version 0, https://mcap.dev/spec.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from daq.errors import HardwareError, UsageError
from daq.mcap_records import MAGIC, Op, map_bytes, record, text_bytes

PARTIAL_SUFFIX = ".partial"
LIBRARY = "residuum"
_MEDIA_TYPES = {".json": "application/json", ".toml": "application/toml", ".urdf": "application/xml",
                ".xml": "application/xml"}


class McapWriter:
    """An MCAP file under construction; schemas lie outside the chunks, so no chunk depends on another.

    Args:
        path: final name; the file grows at ``<path>.partial`` until :meth:`finish`.
    """

    def __init__(self, path: str | Path) -> None:
        import zstandard

        self.path = Path(path)
        self.partial = self.path.with_name(self.path.name + PARTIAL_SUFFIX)
        self._file = _create(self.partial)
        self._zstd = zstandard.ZstdCompressor(level=1)  # level 1 keeps 7 axes at 1 kHz under 2 % of a core
        self._at = self._crc = 0
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._summary: dict[int, list[bytes]] = {Op.CHUNK_INDEX: [], Op.ATTACHMENT_INDEX: [],
                                                 Op.METADATA_INDEX: []}
        self._first, self._last = 2**64 - 1, 0
        self._put(MAGIC + record(Op.HEADER, text_bytes("ros2") + text_bytes(LIBRARY)))

    @property
    def closed(self) -> bool:
        """Whether the file was finished or abandoned."""
        return self._file.closed

    def _put(self, data: bytes) -> int:
        """Append bytes; return where they begin."""
        start = self._at
        try:
            self._file.write(data)
        except OSError as error:
            raise HardwareError(f"writing {self.partial} failed at byte {start}: "
                                f"{error.strerror or error}; free the disk, then `residuum recover` what "
                                f"was written.") from error
        self._crc = zlib.crc32(data, self._crc)
        self._at += len(data)
        return start

    def add_schema(self, name: str, text: str, encoding: str = "ros2msg") -> int:
        """Declare a message type; returns its id."""
        number = len(self._schemas) + 1
        raw = text.encode()
        body = struct.pack("<H", number) + text_bytes(name) + text_bytes(encoding)
        self._schemas.append(record(Op.SCHEMA, body + struct.pack("<I", len(raw)) + raw))
        self._put(self._schemas[-1])
        return number

    def add_channel(self, topic: str, schema: int, encoding: str = "cdr") -> int:
        """Declare a topic; returns its channel id."""
        number = len(self._channels) + 1
        body = struct.pack("<HH", number, schema) + text_bytes(topic) + text_bytes(encoding)
        self._channels.append(record(Op.CHANNEL, body + map_bytes({})))
        self._put(self._channels[-1])
        return number

    def add_metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Write a metadata record."""
        raw = record(Op.METADATA, text_bytes(name) + map_bytes(mapping))
        start = self._put(raw)
        index = struct.pack("<QQ", start, len(raw)) + text_bytes(name)
        self._summary[Op.METADATA_INDEX].append(record(Op.METADATA_INDEX, index))

    def add_attachment(self, name: str, data: bytes) -> None:
        """Carry a file along."""
        media = text_bytes(_MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream"))
        body = struct.pack("<QQ", 0, 0) + text_bytes(name) + media + struct.pack("<Q", len(data)) + data
        raw = record(Op.ATTACHMENT, body + struct.pack("<I", zlib.crc32(body)))
        start = self._put(raw)
        index = struct.pack("<QQQQQ", start, len(raw), 0, 0, len(data)) + text_bytes(name) + media
        self._summary[Op.ATTACHMENT_INDEX].append(record(Op.ATTACHMENT_INDEX, index))

    def write_chunk(self, block: bytes, offsets: np.ndarray, channels: np.ndarray, times: np.ndarray) -> None:
        """Compress and write message records.

        Args:
            block: the records one behind another.
            offsets: (n,) where each begins in ``block``.
            channels: (n,) channel ids.
            times: (n,) log times in ns.
        """
        if not len(offsets):
            return
        first, last = int(times.min()), int(times.max())
        packed = self._zstd.compress(block)
        head = struct.pack("<QQQI", first, last, len(block), zlib.crc32(block)) + text_bytes("zstd")
        chunk = record(Op.CHUNK, head + struct.pack("<Q", len(packed)) + packed)
        start = self._put(chunk)
        places = self._write_message_indexes(offsets, channels, times)
        index = struct.pack("<QQQQ", first, last, start, len(chunk))
        index += struct.pack("<I", 10 * len(places))
        index += b"".join(struct.pack("<HQ", *place) for place in places.items())
        index += struct.pack("<Q", self._at - start - len(chunk)) + text_bytes("zstd")
        index += struct.pack("<QQ", len(packed), len(block))
        self._summary[Op.CHUNK_INDEX].append(record(Op.CHUNK_INDEX, index))
        self._first, self._last = min(self._first, first), max(self._last, last)

    def _write_message_indexes(
        self, offsets: np.ndarray, channels: np.ndarray, times: np.ndarray
    ) -> dict[int, int]:
        """One index a channel; returns where each lies."""
        places: dict[int, int] = {}
        for channel in np.flatnonzero(np.bincount(channels)).tolist():
            mine = channels == channel
            entries = np.column_stack([times[mine], offsets[mine]]).astype("<u8").tobytes()
            body = struct.pack("<HI", channel, len(entries)) + entries
            places[channel] = self._put(record(Op.MESSAGE_INDEX, body))
            self._counts[channel] = self._counts.get(channel, 0) + int(mine.sum())
        return places

    def push(self) -> None:
        """Hand everything to the operating system: a killed process then loses none of it."""
        try:
            self._file.flush()
        except OSError as error:
            raise HardwareError(f"writing {self.partial} failed: {error.strerror or error}.") from error

    def sync(self) -> None:
        """Force everything onto the disk (6-16 ms: never in a thread that keeps time)."""
        self.push()
        os.fsync(self._file.fileno())

    def finish(self) -> None:
        """Write the summary and give the file its final name."""
        self._put(record(Op.DATA_END, struct.pack("<I", self._crc)))
        start = self._at
        groups = {Op.SCHEMA: self._schemas, Op.CHANNEL: self._channels,
                  Op.STATISTICS: [self._statistics()], **self._summary}
        summary, offsets = b"", b""
        for opcode, records in groups.items():
            group = b"".join(records)
            if group:
                offsets += record(Op.SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start + len(summary),
                                                                 len(group)))
            summary += group
        footer = struct.pack("<BQQQ", Op.FOOTER, 20, start, start + len(summary))
        body = summary + offsets + footer
        self._put(body + struct.pack("<I", zlib.crc32(body)) + MAGIC)
        self.sync()
        self._file.close()
        os.replace(self.partial, self.path)

    def _statistics(self) -> bytes:
        counts = b"".join(struct.pack("<HQ", *item) for item in sorted(self._counts.items()))
        body = struct.pack(
            "<QHIIII", sum(self._counts.values()), len(self._schemas), len(self._channels),
            len(self._summary[Op.ATTACHMENT_INDEX]), len(self._summary[Op.METADATA_INDEX]),
            len(self._summary[Op.CHUNK_INDEX]),
        )
        times = struct.pack("<QQ", self._first if self._last else 0, self._last)
        return record(Op.STATISTICS, body + times + struct.pack("<I", len(counts)) + counts)

    def abandon(self, keep: bool) -> None:
        """Stop without finishing; what was written stays for ``residuum recover`` if ``keep``."""
        self._file.close()
        if not keep:
            self.partial.unlink(missing_ok=True)


def _create(partial: Path):  # noqa: ANN202 - a BufferedWriter
    try:
        return open(partial, "xb", buffering=1 << 18)
    except FileExistsError as error:
        raise UsageError(f"{partial} exists: an unfinished log lies there; `residuum recover {partial} -o "
                         f"whole.mcap` saves it, then delete it.") from error
    except OSError as error:
        raise UsageError(f"cannot write {partial}: {error.strerror or error}; "
                         f"choose a folder that exists and that you may write to.") from error
