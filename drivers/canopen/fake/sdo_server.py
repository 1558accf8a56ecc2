"""The SDO server of a fake drive: expedited and segmented transfers both ways."""

from __future__ import annotations

import struct

from drivers.canopen.fake.dictionary import Abort, Dictionary

_HEAD = struct.Struct("<BHB")
_BAD_COMMAND, _TOGGLE_ERROR = 0x05040001, 0x05030000
_EXPEDITED, _SIZED = 0x02, 0x01


class SdoServer:
    """Answers one request frame with one answer frame."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._address = (0, 0)
        self._left = b""
        self._taken = bytearray()
        self._toggle = 0

    def answer(self, request: bytes) -> bytes | None:
        """The answer to a request; None for an abort, which has none."""
        command = request[0] >> 5
        handlers = {0: self._take_segment, 1: self._download, 2: self._upload, 3: self._give_segment}
        if command == 4:
            return None
        if command in (1, 2):
            self._address = struct.unpack_from("<HB", request, 1)  # type: ignore[assignment]
        try:
            handler = handlers.get(command)
            if handler is None or len(request) != 8:
                raise Abort(_BAD_COMMAND)
            return handler(request)
        except Abort as abort:
            return _HEAD.pack(0x80, *self._address) + struct.pack("<I", abort.code)

    def _upload(self, request: bytes) -> bytes:
        data = self._dictionary.read(*self._address)
        if len(data) <= 4:
            command = 0x40 | (4 - len(data)) << 2 | _EXPEDITED | _SIZED
            return _HEAD.pack(command, *self._address) + data.ljust(4, b"\0")
        self._left, self._toggle = data, 0
        return _HEAD.pack(0x40 | _SIZED, *self._address) + struct.pack("<I", len(data))

    def _give_segment(self, request: bytes) -> bytes:
        self._turn(request[0])
        part, self._left = self._left[:7], self._left[7:]
        command = request[0] & 0x10 | (7 - len(part)) << 1 | (not self._left)
        return bytes([command]) + part.ljust(7, b"\0")

    def _download(self, request: bytes) -> bytes:
        if request[0] & _EXPEDITED:
            unused = request[0] >> 2 & 3 if request[0] & _SIZED else 0
            self._dictionary.write(*self._address, request[4 : 8 - unused])
        else:
            self._taken, self._toggle = bytearray(), 0
        return _HEAD.pack(0x60, *self._address) + bytes(4)

    def _take_segment(self, request: bytes) -> bytes:
        self._turn(request[0])
        self._taken += request[1 : 8 - (request[0] >> 1 & 7)]
        if request[0] & 1:
            self._dictionary.write(*self._address, bytes(self._taken))
        return bytes([0x20 | request[0] & 0x10]) + bytes(7)

    def _turn(self, command: int) -> None:
        if command & 0x10 != self._toggle:
            raise Abort(_TOGGLE_ERROR)
        self._toggle ^= 0x10
