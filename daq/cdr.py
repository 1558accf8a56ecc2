"""CDR, the wire form of ROS 2 messages: where each field of a message lies, and templates to write them.

Source: OMG DDSI-RTPS 2.5, 10.2 (encapsulation identifiers); OMG DDS-XTypes 1.3, 7.4.3 (plain CDR 1 and 2).
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq.messages import Field

ENCAPSULATION = 4  # bytes before the payload; alignment counts from behind them
# identifier -> (byte order, largest alignment); plain CDR 2 aligns 8-byte numbers to 4
_ENCODINGS = {0: (">", 8), 1: ("<", 8), 6: (">", 4), 7: ("<", 4)}
_NUMBERS = {
    "bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}


class CdrError(ValueError):
    """Bytes that do not hold the message they should."""


@dataclass(frozen=True)
class Slot:
    """A place of numbers in a message: byte offset, dtype, and count (None for a scalar)."""

    offset: int
    dtype: np.dtype
    count: int | None


@dataclass(frozen=True)
class Layout:
    """Where everything lies in one message; messages that share the constant bytes share the layout.

    Attributes:
        size: bytes of the message, encapsulation included.
        slots: field name to its numbers.
        texts: field name to its string or strings.
        constants: byte ranges (start, stop) that fix the layout: byte order, lengths, strings.
    """

    size: int
    slots: Mapping[str, Slot]
    texts: Mapping[str, str | tuple[str, ...]]
    constants: tuple[tuple[int, int], ...]

    def dtype(self) -> np.dtype:
        """Structured dtype over one whole message."""
        shapes = [slot.dtype if slot.count is None else (slot.dtype, (slot.count,))
                  for slot in self.slots.values()]
        return np.dtype({"names": list(self.slots), "formats": shapes, "itemsize": self.size,
                         "offsets": [slot.offset for slot in self.slots.values()]})


class _Walker:
    """Steps through one message and notes what it passes."""

    def __init__(self, message: bytes, align_empty: bool) -> None:
        if len(message) < ENCAPSULATION:
            raise CdrError(f"{len(message)} bytes are too few for a CDR message")
        identifier = message[0] << 8 | message[1]
        if identifier not in _ENCODINGS:
            raise CdrError(f"encapsulation {identifier:#06x} is not plain CDR")
        self.message, self.at, self.align_empty = message, ENCAPSULATION, align_empty
        self.order, self.largest = _ENCODINGS[identifier]
        self.constants: list[tuple[int, int]] = [(0, 2)]
        self._length = struct.Struct(self.order + "I")

    def align(self, size: int) -> None:
        size = min(size, self.largest)
        self.at += -(self.at - ENCAPSULATION) % size

    def take(self, size: int) -> int:
        start, self.at = self.at, self.at + size
        if self.at > len(self.message):
            raise CdrError(f"message ends at byte {len(self.message)} inside a field")
        return start

    def length(self) -> int:
        self.align(4)
        start = self.take(4)
        self._note(start, self.at)
        return self._length.unpack_from(self.message, start)[0]

    def text(self) -> str:
        size = self.length()
        start = self.take(size)
        self._note(start, self.at)
        try:
            return self.message[start : self.at].rstrip(b"\0").decode()
        except UnicodeDecodeError as error:
            raise CdrError(f"string at byte {start} is not UTF-8") from error

    def numbers(self, kind: str, sequence: bool) -> Slot:
        dtype = np.dtype(self.order + _NUMBERS[kind])
        count = self.length() if sequence else None
        if count != 0 or self.align_empty:
            self.align(dtype.itemsize)
        size = dtype.itemsize * (1 if count is None else count)
        return Slot(self.take(size), dtype, count)

    def _note(self, start: int, stop: int) -> None:
        """Neighbouring constants are compared as one range."""
        if self.constants[-1][1] == start:
            start = self.constants.pop()[0]
        self.constants.append((start, stop))


def _walk(fields: Sequence[Field], message: bytes, align_empty: bool) -> Layout:
    walker = _Walker(message, align_empty)
    slots: dict[str, Slot] = {}
    texts: dict[str, str | tuple[str, ...]] = {}
    for field in fields:
        if field.kind != "string":
            slots[field.name] = walker.numbers(field.kind, field.sequence)
        elif field.sequence:
            count = walker.length()
            if count > len(message):
                raise CdrError(f"{field.name} claims {count} strings")
            texts[field.name] = tuple(walker.text() for _ in range(count))
        else:
            texts[field.name] = walker.text()
    if len(message) - walker.at > 7:  # encoders pad the end to at most the largest alignment
        raise CdrError(f"{len(message) - walker.at} bytes are left over behind the last field")
    return Layout(len(message), slots, texts, tuple(walker.constants))


def layout_of(fields: Sequence[Field], message: bytes) -> Layout:
    """Find where the fields of one message lie.

    Encoders disagree on whether an empty sequence is followed by its elements' alignment: both are tried.

    Raises:
        CdrError: the bytes do not hold these fields.
    """
    try:
        return _walk(fields, message, align_empty=False)
    except CdrError as error:
        try:
            return _walk(fields, message, align_empty=True)
        except CdrError:
            raise error from None


def template(
    fields: Sequence[Field], texts: Mapping[str, str | Sequence[str]], counts: Mapping[str, int]
) -> tuple[bytes, Layout]:
    """A little-endian message with every number zero, to be filled in place.

    Args:
        fields: the type's primitives.
        texts: every string field's content.
        counts: every numeric sequence's length.

    Returns:
        The message's bytes and its layout.
    """
    out = bytearray(b"\0\1\0\0")
    for field in fields:
        if field.kind == "string":
            _put_text(out, field, texts[field.name])
            continue
        size = np.dtype(_NUMBERS[field.kind]).itemsize
        count = 1
        if field.sequence:
            count = counts[field.name]
            _put_number(out, count)
        if count:
            _pad(out, size)
        out += bytes(size * count)
    return bytes(out), _walk(fields, bytes(out), align_empty=False)


def _put_text(out: bytearray, field: Field, content: str | Sequence[str]) -> None:
    if field.sequence:
        _put_number(out, len(content))
    for text in content if field.sequence else (content,):
        raw = str(text).encode() + b"\0"
        _put_number(out, len(raw))
        out += raw


def _put_number(out: bytearray, value: int) -> None:
    _pad(out, 4)
    out += struct.pack("<I", value)


def _pad(out: bytearray, size: int) -> None:
    out += bytes(-(len(out) - ENCAPSULATION) % size)
