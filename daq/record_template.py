"""Message records of one fixed layout: filled in place one at a time, or all rows at once."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

import numpy as np

from daq.cdr import Layout, template
from daq.errors import UsageError
from daq.mcap_records import MESSAGE_HEADER, RECORD_HEADER, Op
from daq.messages import fields

_HEAD = struct.Struct("<IQQ")  # sequence, log time, publish time
_HEAD_AT = 11
_STAMP = struct.Struct("<iI")
_STAMP_AT = MESSAGE_HEADER + 4
# numpy's own letters depend on the platform: its "l" has 8 bytes, the standard one of struct 4
_LETTERS = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q",
            "f4": "f", "f8": "d"}
_SECOND_NS = 1_000_000_000


class RecordTemplate:
    """A whole MCAP message record whose numbers alone change from sample to sample.

    Args:
        channel: channel id.
        schema: message type.
        texts: every string field.
        counts: length of every numeric sequence.
    """

    def __init__(
        self, channel: int, schema: str, texts: Mapping[str, str | Sequence[str]], counts: Mapping[str, int]
    ) -> None:
        message, layout = template(fields(schema), texts, counts)
        length = MESSAGE_HEADER - RECORD_HEADER + len(message)
        head = struct.pack("<BQHIQQ", Op.MESSAGE, length, channel, 0, 0, 0)
        self.schema, self.channel = schema, channel
        self._record = bytearray(head + message)
        self._groups = _groups(layout)
        self._packers = [
            (name, MESSAGE_HEADER + offset,
             struct.Struct(f"<{count or 1}{_LETTERS[dtype.str[1:]]}"), count is None)
            for name, (offset, dtype, count) in self._groups.items()
        ]

    def fill(
        self, stamp_ns: int, log_time_ns: int, sequence: int, values: Mapping[str, object]
    ) -> bytearray:
        """One record; the same buffer every time.

        Raises:
            UsageError: a value is missing, has another length, or does not fit its type.
        """
        out = self._record
        try:
            _HEAD.pack_into(out, _HEAD_AT, sequence, log_time_ns, max(stamp_ns, 0))
            _STAMP.pack_into(out, _STAMP_AT, *divmod(stamp_ns, _SECOND_NS))
            for name, offset, packer, scalar in self._packers:
                value = values[name]
                packer.pack_into(out, offset, *((value,) if scalar else value))  # type: ignore[misc]
        except (struct.error, KeyError, TypeError) as error:
            raise UsageError(f"a {self.schema} message cannot be written ({error!s}); "
                             f"it needs {', '.join(self._groups) or 'no numbers'}.") from error
        return out

    def rows(
        self, stamp_ns: np.ndarray, log_time_ns: np.ndarray, sequence: np.ndarray,
        values: Mapping[str, np.ndarray],
    ) -> np.ndarray:
        """All records of a stream at once: (n, bytes) uint8."""
        size = len(self._record)
        names, formats, offsets = ["sequence", "log", "publish", "sec", "nanosec"], [], [11, 15, 23, 35, 39]
        formats = ["<u4", "<u8", "<u8", "<i4", "<u4"]
        for name, (offset, dtype, count) in self._groups.items():
            names.append(name)
            formats.append((dtype, (count,)) if count is not None else dtype)
            offsets.append(MESSAGE_HEADER + offset)
        layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})
        raw = np.tile(np.frombuffer(bytes(self._record), np.uint8), (len(stamp_ns), 1))
        table = raw.view(layout)[:, 0]
        table["sequence"], table["log"] = sequence, log_time_ns
        table["publish"] = np.maximum(stamp_ns, 0)
        table["sec"], table["nanosec"] = np.divmod(stamp_ns, _SECOND_NS)
        for name in self._groups:
            table[name] = values[name]
        return raw


def _groups(layout: Layout) -> dict[str, tuple[int, np.dtype, int | None]]:
    """Numbers that are filled together: a sequence, a scalar, or the components x, y, z of a vector."""
    found: dict[str, tuple[int, np.dtype, int | None]] = {}
    for name, slot in layout.slots.items():
        if name.startswith("header."):
            continue
        parent = name.rsplit(".", 1)[0]
        if parent != name and parent in found:
            offset, dtype, count = found[parent]
            found[parent] = (offset, dtype, (count or 0) + 1)
        elif parent != name:
            found[parent] = (slot.offset, slot.dtype, 1)
        elif slot.count != 0:
            found[name] = (slot.offset, slot.dtype, slot.count)
    return found
