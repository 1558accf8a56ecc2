"""The object dictionary of a fake drive: types, access rights, PDO rules, and who listens to a write."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

NO_OBJECT, NO_SUB_INDEX = 0x06020000, 0x06090011
READ_ONLY, WRONG_LENGTH, UNSUPPORTED = 0x06010002, 0x06070010, 0x06010000
NOT_MAPPABLE, PDO_TOO_LONG, OUT_OF_RANGE = 0x06040041, 0x06040042, 0x06090030

_INVALID = 1 << 31
_LONGEST_PDO_BITS = 64


class Abort(Exception):
    """The server refuses with an SDO abort code."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"{code:#010x}")


@dataclass(frozen=True)
class Slot:
    """One entry: number format (a `struct` letter), access, whether a PDO may carry it."""

    format: str
    writable: bool = False
    mappable: bool = False


def key(index: int, sub: int = 0) -> int:
    """One number for index and sub-index."""
    return index << 8 | sub


class Dictionary:
    """Values by `key`, with the checks a device makes."""

    def __init__(self) -> None:
        self.values: dict[int, int] = {}
        self.texts: dict[int, bytes] = {}
        self.on_write: dict[int, Callable[[int], None]] = {}
        self.before_read: Callable[[], None] = lambda: None
        self._slots: dict[int, Slot] = {}
        self._defaults: dict[int, int] = {}

    def add(self, index: int, sub: int, slot: Slot, value: int = 0) -> None:
        """Create an entry with its default."""
        self._slots[key(index, sub)] = slot
        self._defaults[key(index, sub)] = self.values[key(index, sub)] = value

    def reset_communication(self) -> None:
        """Put 1000h to 1FFFh back to their defaults, as NMT 'reset communication' does."""
        for address, value in self._defaults.items():
            if 0x1000 <= address >> 8 < 0x2000:
                self.values[address] = value

    def read(self, index: int, sub: int) -> bytes:
        """Bytes of an entry.

        Raises:
            Abort: no such entry.
        """
        address = key(index, sub)
        if address in self.texts:
            return self.texts[address]
        slot = self._slot(index, sub)
        self.before_read()
        return struct.pack("<" + slot.format, self.values[address])

    def write(self, index: int, sub: int, data: bytes) -> None:
        """Set an entry after every check, then tell who listens.

        Raises:
            Abort: no such entry, read-only, wrong length, or against the rules of PDOs.
        """
        slot, address = self._slot(index, sub), key(index, sub)
        if not slot.writable:
            raise Abort(READ_ONLY)
        if len(data) != struct.calcsize("<" + slot.format):
            raise Abort(WRONG_LENGTH)
        (value,) = struct.unpack("<" + slot.format, data)
        self._check_pdo(index, sub, value)
        listener = self.on_write.get(address)
        if listener is not None:
            listener(value)  # may refuse
        self.values[address] = value

    def mapped(self, mapping_index: int) -> list[tuple[int, str]]:
        """Entries a PDO carries: (key, format)."""
        count = self.values[key(mapping_index)]
        words = [self.values[key(mapping_index, sub)] for sub in range(1, count + 1)]
        return [(word >> 8, self._slots[word >> 8].format) for word in words]

    def _slot(self, index: int, sub: int) -> Slot:
        slot = self._slots.get(key(index, sub))
        if slot is None:
            known = any(address >> 8 == index for address in self._slots)
            raise Abort(NO_SUB_INDEX if known else NO_OBJECT)
        return slot

    def _check_pdo(self, index: int, sub: int, value: int) -> None:
        if not (0x1600 <= index < 0x1604 or 0x1A00 <= index < 0x1A04):
            return
        if not self.values[key(index - 0x200, 1)] & _INVALID:
            raise Abort(UNSUPPORTED)  # a PDO in use is not remapped
        if sub == 0:
            bits = sum(self.values[key(index, entry)] & 0xFF for entry in range(1, value + 1))
            if bits > _LONGEST_PDO_BITS:
                raise Abort(PDO_TOO_LONG)
            return
        if self.values[key(index, 0)]:
            raise Abort(UNSUPPORTED)
        slot = self._slots.get(value >> 8)
        if slot is None or not slot.mappable or struct.calcsize("<" + slot.format) * 8 != value & 0xFF:
            raise Abort(NOT_MAPPABLE)
