"""Salvages what is intact in a damaged or unfinished log."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from daq.checks import unwrapped
from daq.errors import DataError
from daq.log_reader import METADATA_RECORD
from daq.log_writer import LogWriter
from daq.mcap_file import checked, decompressor, load_bytes
from daq.mcap_records import (
    MAGIC,
    MESSAGE_HEADER,
    RECORD_HEADER,
    Attachment,
    Channel,
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
from daq.mcap_writer import McapWriter
from daq.recording import Stream

_KNOWN = {int(op) for op in Op}
_MESSAGE_FIELDS = MESSAGE_HEADER - RECORD_HEADER
_LARGEST = 1 << 31  # a record that claims more is a flipped length


@dataclass(frozen=True)
class TopicLoss:
    """What became of one topic.

    Attributes:
        topic: its name.
        recovered: messages saved.
        holes: sequence numbers missing between the first and the last saved message.
        largest_hole: the most that are missing in a row.
        last_ns: log time of the last saved message, 0 where none was.
        in_damaged_chunks: messages that the indexes of dropped chunks list.
    """

    topic: str
    recovered: int
    holes: int
    largest_hole: int
    last_ns: int
    in_damaged_chunks: int


@dataclass(frozen=True)
class Recovery:
    """What a salvage saved and what is lost."""

    source: str
    output: str
    topics: tuple[TopicLoss, ...]
    damaged_chunks: tuple[int, ...]  # byte offsets
    torn_messages: int  # saved from a torn last chunk
    skipped_bytes: int
    attachments_lost: tuple[str, ...]
    finished: bool  # the log was complete at its end

    @property
    def sentence(self) -> str:
        """The result in a sentence."""
        total = sum(topic.recovered for topic in self.topics)
        losses = []
        if self.damaged_chunks:
            losses.append(f"{len(self.damaged_chunks)} damaged chunks were dropped (first at byte "
                          f"{self.damaged_chunks[0]})")
        if self.skipped_bytes:
            losses.append(f"{self.skipped_bytes} bytes could not be read")
        if self.attachments_lost:
            losses.append(f"damaged attachments were dropped ({', '.join(self.attachments_lost)})")
        if not self.finished:
            losses.append(f"the log had no proper end ({self.torn_messages} messages came from a torn chunk, "
                          f"without a checksum)")
        lost = "; ".join(losses) or "nothing was lost"
        return f"Saved {total} messages of {len(self.topics)} topics: {lost}."


@dataclass
class _Salvage:
    """What has been found so far."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    blocks: list[bytes] = field(default_factory=list)
    damaged: list[int] = field(default_factory=list)
    lost_attachments: list[str] = field(default_factory=list)
    torn_messages: int = 0
    skipped: int = 0
    lost: dict[int, int] = field(default_factory=dict)  # channel to messages in damaged chunks
    in_damaged: bool = False
    finished: bool = False


@dataclass(frozen=True)
class Addition:
    """What can be worked out from what was saved, and is added to it.

    Attributes:
        streams: whole streams.
        metadata: entries of the run's record.
    """

    streams: tuple[Stream, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)


def recover(source: str | Path, output: str | Path, addition: Addition | None = None) -> Recovery:
    """Write everything intact in ``source``, in file order, to a whole new log.

    Args:
        source: a damaged or unfinished log.
        output: the new log's name.
        addition: what is written behind it.

    Returns:
        What was saved and what was lost.

    Raises:
        DataError: nothing can be saved.
        UsageError: a file cannot be read or written.
    """
    data = memoryview(load_bytes(Path(source)))
    found = _Salvage()
    _salvage(data, found)
    if not any(_messages(block) for block in found.blocks):
        raise DataError(f"{source} holds no intact message: nothing can be recovered from it.")
    counts = _write(found, output, addition or Addition())
    return Recovery(
        source=str(source), output=str(output), topics=_losses(found, counts),
        damaged_chunks=tuple(found.damaged), torn_messages=found.torn_messages, skipped_bytes=found.skipped,
        attachments_lost=tuple(found.lost_attachments), finished=found.finished,
    )


def _salvage(data: memoryview, found: _Salvage) -> None:
    at = len(MAGIC)
    while at < len(data) and not found.finished:
        try:
            for opcode, start, stop in walk(data, at, len(data)):
                if not _plausible(opcode, stop - start):
                    raise TornError(at, "no known record")
                at = stop
                _take(data, opcode, start, stop, found)
                if found.finished:
                    break
        except TornError:
            at = _resume(data, at, found)


def _plausible(opcode: int, length: int) -> bool:
    """Opcodes from 0x80 on are private to whoever wrote them; the rest must be known."""
    return (opcode in _KNOWN or opcode >= 0x80) and length < _LARGEST


def _resume(data: memoryview, at: int, found: _Salvage) -> int:
    """Past unreadable bytes: use what a torn chunk still gives, then seek the next one that proves itself."""
    torn = data[at] == Op.CHUNK if at < len(data) else False
    nearest = _next_chunk(data, at + 1)
    block = _inflate_torn(data[: nearest or len(data)], at) if torn else b""
    messages = len(_messages(block))
    if messages:
        _keep(block, found)
        found.torn_messages += messages
    else:
        found.skipped += (nearest or len(data)) - at
    return nearest or len(data)


def _keep(block: bytes, found: _Salvage) -> None:
    """A chunk's records and what they say about topics."""
    found.blocks.append(block)
    for opcode, start, stop in _records(block):
        _describe(memoryview(block), opcode, start, stop, found)


def _next_chunk(data: memoryview, at: int) -> int:
    """Offset of the next chunk whose checksum holds, 0 where there is none."""
    raw = bytes(data)
    names = (b"\x04\0\0\0zstd", b"\x03\0\0\0lz4")  # how a chunk names its compression
    found = [start for name in names if (start := _next_chunk_named(raw, at, name))]
    return min(found, default=0)


def _next_chunk_named(raw: bytes, at: int, name: bytes) -> int:
    data, unpack = memoryview(raw), decompressor()
    place = raw.find(name, at)
    while place >= 0:
        start = place - 28 - RECORD_HEADER
        if start >= at and raw[start] == Op.CHUNK:
            try:
                _, begin, stop = next(walk(data, start, len(data)))
                checked(read_chunk(data, begin, stop), unpack)
                return start
            except (TornError, ValueError):
                pass
        place = raw.find(name, place + 1)
    return 0


def _take(data: memoryview, opcode: int, start: int, stop: int, found: _Salvage) -> None:
    """Keep one record; a damaged one is counted, never fatal."""
    try:
        if opcode == Op.CHUNK:
            _take_chunk(data, start, stop, found)
        elif opcode == Op.MESSAGE:
            found.blocks.append(bytes(data[start - RECORD_HEADER : stop]))
        elif opcode == Op.METADATA:
            found.metadata.append(read_metadata(data, start, stop))
        elif opcode == Op.ATTACHMENT:
            _take_attachment(data, start, stop, found)
        elif opcode == Op.DATA_END:
            found.finished = True  # the summary behind it only repeats what came before
        elif opcode == Op.MESSAGE_INDEX and found.in_damaged:
            channel = int.from_bytes(data[start : start + 2], "little")
            found.lost[channel] = found.lost.get(channel, 0) + (stop - start - 6) // 16
        else:
            _describe(data, opcode, start, stop, found)
    except TornError:
        found.skipped += stop - start


def _describe(data: memoryview, opcode: int, start: int, stop: int, found: _Salvage) -> None:
    if opcode == Op.SCHEMA:
        schema = read_schema(data, start, stop)
        found.schemas.setdefault(schema.id, schema)
    elif opcode == Op.CHANNEL:
        channel = read_channel(data, start, stop)
        found.channels.setdefault(channel.id, channel)


def _take_chunk(data: memoryview, start: int, stop: int, found: _Salvage) -> None:
    try:
        block = checked(read_chunk(data, start, stop), decompressor())
    except ValueError:
        found.damaged.append(start - RECORD_HEADER)
        found.in_damaged = True
        return
    found.in_damaged = False
    _keep(_intact_part(block), found)


def _take_attachment(data: memoryview, start: int, stop: int, found: _Salvage) -> None:
    attachment = read_attachment(data, start, stop)
    if attachment.crc and zlib.crc32(attachment.covered) != attachment.crc:
        found.lost_attachments.append(attachment.name)
    else:
        found.attachments.append(attachment)


def _inflate_torn(data: memoryview, at: int) -> bytes:
    """As much of a chunk as its bytes still give, cut behind the last whole record."""
    head = bytes(data[at + RECORD_HEADER : at + RECORD_HEADER + 64])
    if len(head) < 40:
        return b""
    size = int.from_bytes(head[28:32], "little")
    if size > 8:
        return b""
    compression = head[32 : 32 + size].decode("ascii", "replace")
    body = bytes(data[at + RECORD_HEADER + 32 + size + 8 :])
    return _intact_part(_inflate(compression, body))


def _inflate(compression: str, body: bytes) -> bytes:
    import lz4.frame
    import zstandard

    if compression == "":
        return body
    if compression not in ("zstd", "lz4"):
        return b""
    machine = (zstandard.ZstdDecompressor().decompressobj() if compression == "zstd"
               else lz4.frame.LZ4FrameDecompressor())
    out = bytearray()
    for start in range(0, len(body), 512):  # small bites: an error costs only the bite it is in
        try:
            out += machine.decompress(body[start : start + 512])
        except Exception:  # the bytes behind the tear are no longer this chunk's
            break
    return bytes(out)


def _records(block: bytes) -> Iterator[tuple[int, int, int]]:
    """The whole, plausible records at the beginning of a block."""
    try:
        for opcode, start, stop in walk(memoryview(block), 0, len(block)):
            if opcode not in (Op.MESSAGE, Op.SCHEMA, Op.CHANNEL):
                return
            yield opcode, start, stop
    except TornError:
        return


def _intact_part(block: bytes) -> bytes:
    stop = 0
    for _, _, stop in _records(block):  # noqa: B007 - the last one counts
        pass
    return block[:stop]


def _messages(block: bytes) -> list[tuple[int, int]]:
    """(content start, content end) of the messages of a block."""
    return [(start, stop) for opcode, start, stop in _records(block)
            if opcode == Op.MESSAGE and stop - start >= _MESSAGE_FIELDS]


def _write(found: _Salvage, output: str | Path, addition: Addition) -> Mapping[int, np.ndarray]:
    """Write the new log; channel to (n, 2) sequence numbers and log times."""
    writer = McapWriter(output)
    try:
        for name, mapping in found.metadata:
            writer.add_metadata(name, mapping)
        for attachment in found.attachments:
            writer.add_attachment(attachment.name, attachment.data)
        seen = _write_messages(found, writer)
        _write_addition(addition, writer, found)
        writer.finish()
    except BaseException:
        writer.abandon(keep=False)
        raise
    return {channel: np.array(rows, np.int64) for channel, rows in seen.items()}


def _write_addition(addition: Addition, writer: McapWriter, found: _Salvage) -> None:
    log = LogWriter(writer.path, file=writer)
    for name, mapping in found.metadata:
        if name == METADATA_RECORD:
            log.metadata.update(mapping)
    if addition.metadata:
        log.add_metadata(addition.metadata)
    log.write_streams(addition.streams)


def _write_messages(found: _Salvage, writer: McapWriter) -> dict[int, list[tuple[int, int]]]:
    schemas = {0: 0}
    channels: dict[int, int] = {}
    for number, schema in found.schemas.items():
        text = schema.text.decode("utf-8", "replace")
        schemas[number] = writer.add_schema(schema.name, text, schema.encoding)
    for number, channel in found.channels.items():
        schema_id = schemas.get(channel.schema_id, 0)
        channels[number] = writer.add_channel(channel.topic, schema_id, channel.encoding)
    seen: dict[int, list[tuple[int, int]]] = {}
    for block in _merged(found.blocks):
        _write_block(block, channels, seen, writer)
    return seen


def _merged(blocks: list[bytes]) -> Iterator[bytes]:
    """Blocks of single messages are put together: a chunk each would be a waste."""
    kept: list[bytes] = []
    for block in blocks:
        kept.append(block)
        if sum(map(len, kept)) > 1 << 18:
            yield b"".join(kept)
            kept = []
    if kept:
        yield b"".join(kept)


def _write_block(
    block: bytes, channels: Mapping[int, int], seen: dict[int, list[tuple[int, int]]], writer: McapWriter
) -> None:
    out, offsets, ids, times = bytearray(), [], [], []
    for start, stop in _messages(block):
        number = int.from_bytes(block[start : start + 2], "little")
        if number not in channels:
            continue  # its description was lost: nobody could read the message
        when = int.from_bytes(block[start + 6 : start + 14], "little")
        seen.setdefault(number, []).append((int.from_bytes(block[start + 2 : start + 6], "little"), when))
        offsets.append(len(out))
        ids.append(channels[number])
        times.append(when)
        out += block[start - RECORD_HEADER : start] + channels[number].to_bytes(2, "little")
        out += block[start + 2 : stop]
    writer.write_chunk(bytes(out), np.array(offsets), np.array(ids, np.int64), np.array(times, np.int64))


def _losses(found: _Salvage, counts: Mapping[int, np.ndarray]) -> tuple[TopicLoss, ...]:
    nothing = np.empty((0, 2), np.int64)
    return tuple(
        _loss(channel.topic, counts.get(number, nothing), found.lost.get(number, 0))
        for number, channel in found.channels.items()
    )


def _loss(topic: str, rows: np.ndarray, in_damaged: int) -> TopicLoss:
    steps = np.diff(unwrapped(rows[:, 0].astype(np.uint32))) if len(rows) else np.empty(0, np.int64)
    missing = steps[steps > 1] - 1
    last = int(rows[-1, 1]) if len(rows) else 0
    return TopicLoss(topic, len(rows), int(missing.sum()), int(missing.max(initial=0)), last, in_damaged)
