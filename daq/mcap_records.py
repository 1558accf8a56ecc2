"""The records of an MCAP file: their layout on disk, read and built.

Source: MCAP format specification version 0, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEADER = 9  # opcode u8, length u64
MESSAGE_HEADER = 31  # record header, channel u16, sequence u32, log time u64, publish time u64
_HEADER = struct.Struct("<BQ")


class Op(IntEnum):
    """Record opcodes."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


class TornError(ValueError):
    """Bytes end or contradict themselves at an offset."""

    def __init__(self, offset: int, reason: str) -> None:
        self.offset, self.reason = offset, reason
        super().__init__(f"{reason} (byte {offset})")


@dataclass(frozen=True)
class Schema:
    """A message type of the file."""

    id: int
    name: str
    encoding: str
    text: bytes


@dataclass(frozen=True)
class Channel:
    """A topic of the file."""

    id: int
    schema_id: int
    topic: str
    encoding: str
    metadata: Mapping[str, str]


@dataclass(frozen=True)
class Chunk:
    """A block of compressed records."""

    uncompressed_size: int
    crc: int
    compression: str
    records: memoryview


@dataclass(frozen=True)
class Attachment:
    """A file carried inside the log; ``crc`` covers the record up to itself, 0 where absent."""

    name: str
    media_type: str
    data: bytes
    crc: int
    covered: memoryview


class Cursor:
    """Reads fields one behind another, never beyond ``stop``."""

    def __init__(self, data: memoryview, at: int, stop: int) -> None:
        self.data, self.at, self.stop = data, at, stop

    def take(self, size: int) -> memoryview:
        """The next ``size`` bytes."""
        if size > self.stop - self.at:
            raise TornError(self.at, "a record's field reaches beyond the record's end")
        start, self.at = self.at, self.at + size
        return self.data[start : self.at]

    def number(self, size: int) -> int:
        """An unsigned little-endian number."""
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        """A length-prefixed UTF-8 string."""
        start = self.at
        try:
            return str(self.take(self.number(4)), "utf-8")
        except UnicodeDecodeError as error:
            raise TornError(start, "a text is not UTF-8") from error

    def mapping(self) -> dict[str, str]:
        """A length-prefixed map of strings."""
        size = self.number(4)
        end = self.at + size
        if end > self.stop:
            raise TornError(self.at, "a map reaches beyond its record's end")
        found: dict[str, str] = {}
        while self.at < end:
            key = self.text()
            found[key] = self.text()
        return found


def walk(data: memoryview, start: int, stop: int) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, start of the content, end of the content) of record after record.

    Raises:
        TornError: a record's header or content reaches beyond ``stop``.
    """
    at = start
    while at < stop:
        if stop - at < RECORD_HEADER:
            raise TornError(at, "the file ends inside a record's header")
        opcode, length = _HEADER.unpack_from(data, at)
        if opcode == 0:
            raise TornError(at, "there is no record where one should begin")
        end = at + RECORD_HEADER + length
        if end > stop:
            raise TornError(at, f"a record of {length} bytes reaches {end - stop} bytes beyond the end")
        yield opcode, at + RECORD_HEADER, end
        at = end


def read_schema(data: memoryview, start: int, stop: int) -> Schema:
    """Parse a schema record's content."""
    cursor = Cursor(data, start, stop)
    return Schema(cursor.number(2), cursor.text(), cursor.text(), bytes(cursor.take(cursor.number(4))))


def read_channel(data: memoryview, start: int, stop: int) -> Channel:
    """Parse a channel record's content."""
    cursor = Cursor(data, start, stop)
    return Channel(cursor.number(2), cursor.number(2), cursor.text(), cursor.text(), cursor.mapping())


def read_chunk(data: memoryview, start: int, stop: int) -> Chunk:
    """Parse a chunk record's content; the compressed bytes may be fewer than it says when torn."""
    cursor = Cursor(data, start + 16, stop)  # the two time limits are not needed
    size, crc, compression = cursor.number(8), cursor.number(4), cursor.text()
    return Chunk(size, crc, compression, cursor.take(cursor.number(8)))


def read_attachment(data: memoryview, start: int, stop: int) -> Attachment:
    """Parse an attachment record's content."""
    cursor = Cursor(data, start + 16, stop)  # log and creation time are not needed
    name, media_type = cursor.text(), cursor.text()
    content = bytes(cursor.take(cursor.number(8)))
    covered = data[start : cursor.at]
    return Attachment(name, media_type, content, cursor.number(4), covered)


def read_metadata(data: memoryview, start: int, stop: int) -> tuple[str, dict[str, str]]:
    """Parse a metadata record's content into its name and its map."""
    cursor = Cursor(data, start, stop)
    return cursor.text(), cursor.mapping()


def text_bytes(text: str) -> bytes:
    """A string as the file stores it."""
    raw = text.encode()
    return struct.pack("<I", len(raw)) + raw


def map_bytes(mapping: Mapping[str, str]) -> bytes:
    """A map of strings as the file stores it."""
    body = b"".join(text_bytes(str(key)) + text_bytes(str(value)) for key, value in mapping.items())
    return struct.pack("<I", len(body)) + body


def record(opcode: int, body: bytes) -> bytes:
    """A whole record."""
    return _HEADER.pack(opcode, len(body)) + body
