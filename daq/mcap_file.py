"""One pass over an MCAP file: checks every checksum, unpacks every chunk, finds every message."""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from daq.errors import DamagedLogError, DataError, NotALogError, UsageError
from daq.mcap_records import (
    MAGIC,
    MESSAGE_HEADER,
    RECORD_HEADER,
    Channel,
    Chunk,
    Cursor,
    Op,
    Schema,
    TornError,
    read_attachment,
    read_channel,
    read_chunk,
    read_metadata,
    read_schema,
    walk,
)

_MESSAGE = np.dtype({
    "names": ["opcode", "length", "channel", "sequence", "log_time", "publish_time"],
    "formats": ["u1", "<u8", "<u2", "<u4", "<u8", "<u8"],
    "offsets": [0, 1, 9, 11, 15, 23],
    "itemsize": MESSAGE_HEADER,
})


@dataclass(frozen=True)
class LogFile:
    """Everything a log holds, messages still as bytes.

    Attributes:
        source: path.
        profile: the header's profile.
        schemas: id to type.
        channels: id to topic.
        metadata: record name to map.
        attachments: name to content.
        buffer: (bytes,) uint8, all records unpacked one behind another.
        offsets: (n,) int64 where each message record begins in ``buffer``, in file order.
        headers: (n,) structured: channel, sequence, log_time, publish_time, length.
        sha256: of the file.
        warnings: what was odd but harmless.
    """

    source: str
    profile: str
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    buffer: np.ndarray
    offsets: np.ndarray
    headers: np.ndarray
    sha256: str
    warnings: tuple[str, ...]


@dataclass
class _Pieces:
    """What one pass collects."""

    source: str
    data: memoryview
    profile: str = ""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    blocks: list[bytes | memoryview] = field(default_factory=list)
    places: list[int] = field(default_factory=list)  # of each block in the file
    bases: list[int] = field(default_factory=list)  # of each block in the joined buffer
    size: int = 0
    indexes: list[tuple[int, memoryview]] = field(default_factory=list)  # base of the chunk, entries
    unchecked: int = 0
    loose_start: int = 0  # the run of messages outside chunks that is being passed
    loose_stop: int = 0

    def add_block(self, block: bytes | memoryview, place: int) -> None:
        self.blocks.append(block)
        self.places.append(place)
        self.bases.append(self.size)
        self.size += len(block)

    def add_loose(self, start: int, stop: int) -> None:
        """Neighbouring messages outside chunks become one block."""
        if self.loose_stop != start:
            self.end_loose()
            self.loose_start = start
        self.loose_stop = stop

    def end_loose(self) -> None:
        if self.loose_stop > self.loose_start:
            self.add_block(self.data[self.loose_start : self.loose_stop], self.loose_start)
        self.loose_start = self.loose_stop = 0


def decompressor() -> Callable[[Chunk], bytes]:
    """A function that unpacks chunks; zstd contexts are reused between them."""
    import lz4.frame
    import zstandard

    zstd = zstandard.ZstdDecompressor()

    def unpack(chunk: Chunk) -> bytes:
        if chunk.compression == "zstd":
            # the size in the chunk bounds the memory that a damaged frame header may ask for
            return zstd.decompress(chunk.records, max_output_size=chunk.uncompressed_size)
        if chunk.compression == "lz4":
            return lz4.frame.decompress(chunk.records)
        if chunk.compression == "":
            return bytes(chunk.records)
        raise ValueError(f"compression {chunk.compression!r} is unknown")

    return unpack


def checked(chunk: Chunk, unpack: Callable[[Chunk], bytes]) -> bytes:
    """A chunk's records, proven whole.

    Raises:
        ValueError: they do not unpack, or their length or checksum is wrong.
    """
    try:
        block = unpack(chunk)
    except Exception as error:  # zstandard and lz4 have error types of their own
        raise ValueError(f"a chunk does not unpack ({error})") from error
    if len(block) != chunk.uncompressed_size:
        raise ValueError(f"a chunk unpacks to {len(block)} instead of {chunk.uncompressed_size} bytes")
    if chunk.crc and zlib.crc32(block) != chunk.crc:
        raise ValueError("a chunk's checksum does not agree with its content")
    return block


def load_bytes(path: Path) -> bytes:
    """The file's bytes.

    Raises:
        UsageError: there is no such readable file.
        NotALogError: it is empty or begins with other bytes than an MCAP log.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise UsageError(f"cannot read {path}: {reason}; give the path of a log.") from error
    if not raw:
        raise NotALogError(str(path), "the file is empty")
    if raw[:8] != MAGIC:
        raise NotALogError(str(path), f"it begins with {raw[:8]!r} instead of the MCAP signature")
    return raw


def open_log(path: str | Path) -> LogFile:
    """Read a whole log once, verifying the checksums it carries.

    Raises:
        DamagedLogError: bytes are missing or changed.
        NotALogError: the file is not an MCAP log.
        UsageError: the file cannot be read.
    """
    path = Path(path)
    raw = load_bytes(path)
    pieces = _Pieces(str(path), memoryview(raw))
    with ThreadPoolExecutor(1) as beside:  # hashing holds no interpreter lock: free on a second core
        digest = beside.submit(lambda: hashlib.sha256(raw).hexdigest())
        offsets, headers, buffer = _parse(path, pieces)
        return LogFile(str(path), pieces.profile, pieces.schemas, pieces.channels, pieces.metadata,
                       pieces.attachments, buffer, offsets, headers, digest.result(), _oddities(pieces))


def _parse(path: Path, pieces: _Pieces) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Offsets, headers and bytes of all messages."""
    try:
        _check_end(pieces.data)
        _collect(pieces)
    except TornError as error:
        raise DamagedLogError(str(path), error.offset, error.reason) from error
    buffer = np.frombuffer(b"".join(pieces.blocks), np.uint8)
    offsets, headers = _find_messages(pieces, buffer)
    return offsets, headers, buffer


def _oddities(pieces: _Pieces) -> tuple[str, ...]:
    found = []
    if pieces.profile != "ros2":
        found.append(f"the log's profile is {pieces.profile!r}, not 'ros2'")
    if pieces.unchecked:
        found.append(f"{pieces.unchecked} chunks carry no checksum: a changed byte there stays unnoticed")
    return tuple(found)


def _check_end(data: memoryview) -> None:
    """A finished log ends with its signature; its summary proves itself where it has a checksum."""
    if bytes(data[-8:]) != MAGIC or len(data) < 16 + RECORD_HEADER + 20:
        raise TornError(len(data), "the file ends before its closing signature (an unfinished recording?)")
    footer = len(data) - 8 - 20
    if data[footer - RECORD_HEADER] != Op.FOOTER:
        raise TornError(footer - RECORD_HEADER, "the footer is not where it should be")
    summary_start, _, crc = struct.unpack_from("<QQI", data, footer)
    if summary_start > footer:
        raise TornError(footer, "the footer points beyond the file")
    if crc and summary_start and zlib.crc32(data[summary_start : footer + 16]) != crc:
        raise TornError(summary_start, "the summary's checksum does not agree with its content")


def _collect(pieces: _Pieces) -> None:
    data, unpack = pieces.data, decompressor()
    base = -1
    for opcode, start, stop in walk(data, len(MAGIC), len(data) - len(MAGIC)):
        if opcode == Op.MESSAGE:
            pieces.add_loose(start - RECORD_HEADER, stop)
        elif opcode == Op.CHUNK:
            pieces.end_loose()
            base = pieces.size
            _add_chunk(pieces, start, stop, unpack)
        elif opcode == Op.MESSAGE_INDEX:
            pieces.indexes.append((base, data[start + 6 : stop]))
        elif opcode == Op.DATA_END:
            _check_data_section(data, start)
        elif opcode != Op.FOOTER:
            _note(pieces, opcode, start, stop)
    pieces.end_loose()


def _add_chunk(pieces: _Pieces, start: int, stop: int, unpack: Callable[[Chunk], bytes]) -> None:
    chunk = read_chunk(pieces.data, start, stop)
    try:
        block = checked(chunk, unpack)
    except ValueError as error:
        raise TornError(start - RECORD_HEADER, str(error)) from error
    pieces.unchecked += not chunk.crc
    pieces.add_block(block, start)


def _check_data_section(data: memoryview, start: int) -> None:
    crc = int.from_bytes(data[start : start + 4], "little")
    if crc and zlib.crc32(data[: start - RECORD_HEADER]) != crc:
        raise TornError(0, "the data section's checksum does not agree with its content")


def _note(pieces: _Pieces, opcode: int, start: int, stop: int) -> None:
    """Keep what a record outside the messages says."""
    data = pieces.data
    if opcode == Op.HEADER:
        pieces.profile = Cursor(data, start, stop).text()
    elif opcode == Op.SCHEMA:
        schema = read_schema(data, start, stop)
        pieces.schemas[schema.id] = schema
    elif opcode == Op.CHANNEL:
        channel = read_channel(data, start, stop)
        pieces.channels[channel.id] = channel
    elif opcode == Op.METADATA:
        name, mapping = read_metadata(data, start, stop)
        pieces.metadata.setdefault(name, {}).update(mapping)
    elif opcode == Op.ATTACHMENT:
        attachment = read_attachment(data, start, stop)
        if attachment.crc and zlib.crc32(attachment.covered) != attachment.crc:
            raise TornError(start, f"the attachment {attachment.name}'s checksum does not agree")
        pieces.attachments[attachment.name] = attachment.data


def _find_messages(pieces: _Pieces, buffer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where every message lies: by the message indexes where they cover all, else by stepping through."""
    offsets = _indexed_offsets(pieces)
    headers = _headers_if_complete(pieces, buffer, offsets)
    if headers is None:
        offsets = _stepped_offsets(pieces)
        headers = message_headers(buffer, offsets)
    missing = used_channels(headers) - set(pieces.channels)
    if missing:
        raise DataError(f"{pieces.source}: messages refer to channel {min(missing)}, which the log does not "
                        f"describe; `residuum recover` keeps the other topics.")
    return offsets, headers


def message_headers(buffer: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """(n,) structured: channel, sequence, log_time, publish_time and length of the messages at offsets."""
    return gather(buffer, offsets, MESSAGE_HEADER).view(_MESSAGE)


def used_channels(headers: np.ndarray) -> set[int]:
    """The ids of the channels that have messages."""
    return set(np.flatnonzero(np.bincount(headers["channel"])).tolist())


def gather(buffer: np.ndarray, offsets: np.ndarray, size: int) -> np.ndarray:
    """Copy ``size`` bytes from each offset: (n,) void of that size.

    A view of every possible start lets one indexing fetch them all.
    """
    if not len(offsets):
        return np.empty(0, np.dtype((np.void, size)))
    every = np.lib.stride_tricks.as_strided(
        buffer[:size].view(np.dtype((np.void, size))), (len(buffer) - size + 1,), (1,)
    )
    return every[offsets]


def _indexed_offsets(pieces: _Pieces) -> np.ndarray:
    if not pieces.indexes:
        return np.empty(0, np.int64)
    counts = [len(entries) // 16 for _, entries in pieces.indexes]
    bases = np.repeat([base for base, _ in pieces.indexes], counts)
    joined = b"".join(entries[: 16 * n] for (_, entries), n in zip(pieces.indexes, counts, strict=True))
    offsets = np.frombuffer(joined, "<i8").reshape(-1, 2)[:, 1] + bases
    return np.sort(offsets, kind="stable")


def _headers_if_complete(pieces: _Pieces, buffer: np.ndarray, offsets: np.ndarray) -> np.ndarray | None:
    """The message headers, or None when the indexes miss a message or point elsewhere."""
    if not len(offsets) or offsets[0] < 0 or offsets[-1] > len(buffer) - MESSAGE_HEADER:
        return None
    headers = gather(buffer, offsets, MESSAGE_HEADER).view(_MESSAGE)
    if (headers["opcode"] != Op.MESSAGE).any() or (headers["length"] > len(buffer)).any():
        return None
    ends = offsets + RECORD_HEADER + headers["length"].astype(np.int64)
    begins = np.append(offsets, len(buffer))
    ends = np.insert(ends, 0, 0)
    if (ends > begins).any():
        return None
    view = memoryview(buffer)
    for at in np.flatnonzero(begins != ends):
        if not _gap_is_descriptive(pieces, view, int(ends[at]), int(begins[at])):
            return None
    return headers


def _gap_is_descriptive(pieces: _Pieces, view: memoryview, start: int, stop: int) -> bool:
    """Between indexed messages only schemas and channels may lie; they are kept."""
    try:
        for opcode, begin, end in walk(view, start, stop):
            if opcode == Op.MESSAGE:
                return False
            _describe(pieces, view, opcode, begin, end)
    except TornError:
        return False
    return True


def _describe(pieces: _Pieces, view: memoryview, opcode: int, start: int, stop: int) -> None:
    if opcode == Op.SCHEMA:
        schema = read_schema(view, start, stop)
        pieces.schemas[schema.id] = schema
    elif opcode == Op.CHANNEL:
        channel = read_channel(view, start, stop)
        pieces.channels[channel.id] = channel


def _stepped_offsets(pieces: _Pieces) -> np.ndarray:
    found: list[int] = []
    for block, base, place in zip(pieces.blocks, pieces.bases, pieces.places, strict=True):
        view = memoryview(block)
        try:
            for opcode, start, stop in walk(view, 0, len(view)):
                if opcode == Op.MESSAGE:
                    found.append(base + start - RECORD_HEADER)
                else:
                    _describe(pieces, view, opcode, start, stop)
        except TornError as error:
            raise DamagedLogError(pieces.source, place, f"inside a chunk, {error.reason}") from error
    return np.array(found, np.int64)
