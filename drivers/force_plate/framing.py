"""Finding fixed-length frames in a byte stream that may be cut, flipped or polluted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

_CHAIN_DEPTH = 3
"""Frames a chain of back-to-back candidates is followed for when two candidates overlap."""


@dataclass(frozen=True)
class FrameFormat:
    """What marks a frame.

    Attributes:
        length: bytes of a whole frame.
        anchor: constant bytes of every frame.
        anchor_offset: where in the frame the anchor sits.
        is_intact: tells by checksum, sum or syntax whether ``length`` bytes are a frame.
        is_strong: whether ``is_intact`` errs less than once in 2**15 random frames, so that a frame which
            follows directly on an intact one needs no second opinion.
    """

    length: int
    anchor: bytes
    anchor_offset: int
    is_intact: Callable[[bytes], bool]
    is_strong: bool


@dataclass(frozen=True)
class FramingCounts:
    """What became of the bytes so far."""

    frames: int = 0
    skipped_bytes: int = 0
    refused_candidates: int = 0
    overlaps: int = 0


class Framer:
    """Cuts a byte stream into intact frames, whatever the chunks it arrives in.

    A candidate that fails its check costs one byte, never a frame length, so a cut frame or an anchor
    inside a payload cannot hide the intact frame behind it. Where two intact candidates overlap, the one
    that more frames follow back to back is taken; this waits for at most three frames more. A frame that
    directly follows an intact one and passes a strong check is taken at once; should the stream then fall
    out of step, frames that began inside it are taken too, so that nothing intact is ever dropped.
    """

    def __init__(self, frame_format: FrameFormat) -> None:
        self._format = frame_format
        self._buffer = bytearray()
        self._in_step = False
        self._frames = self._skipped = self._refused = self._overlaps = 0
        self._judged = self._unread = 0

    @property
    def counts(self) -> FramingCounts:
        """Frames found, bytes skipped, candidates refused and overlaps settled."""
        return FramingCounts(self._frames, self._skipped, self._refused, self._overlaps)

    def feed(self, data: bytes) -> list[bytes]:
        """Take any bytes and return the frames they complete, in order."""
        self._buffer += data
        return self._cut(at_end=False)

    def flush(self) -> list[bytes]:
        """Settle what still waited for more bytes; an incomplete frame at the end stays in the buffer."""
        return self._cut(at_end=True)

    def _cut(self, at_end: bool) -> list[bytes]:
        frames: list[bytes] = []
        length = self._format.length
        position = self._unread
        while (start := self._next_frame(position, at_end)) is not None:
            self._skip(position, start)
            frames.append(bytes(self._buffer[start : start + length]))
            position, self._in_step = start + length, True
        if not self._must_wait_in_step(position, at_end):
            position = self._skip(position, self._wait_from(position))
        # The last frame is kept: should it prove a phantom, an intact frame may begin inside it.
        self._unread = min(position, length) if self._in_step else 0
        dropped = position - self._unread
        del self._buffer[:dropped]
        self._judged = max(self._judged - dropped, 0)
        self._frames += len(frames)
        return frames

    def _next_frame(self, position: int, at_end: bool) -> int | None:
        """Return the start of the frame to take next; None when more bytes are needed."""
        start = self._next_intact(position)
        if self._in_step and self._format.is_strong:
            if start == position:
                return start
            if self._must_wait_in_step(position, at_end):
                return None
            hidden = self._hidden_in_last_frame(position)
            if hidden is not None:
                self._overlaps += 1
                return hidden
        return start if start is None else self._settle(start, at_end)

    def _must_wait_in_step(self, position: int, at_end: bool) -> bool:
        """Whether it is still open if an intact frame follows directly on the last one."""
        is_open = len(self._buffer) < position + self._format.length
        return self._in_step and self._format.is_strong and is_open and not at_end

    def _hidden_in_last_frame(self, position: int) -> int | None:
        """Return an intact frame that began inside the last one: that was a phantom, a cut frame's head."""
        start = self._candidate(max(position - self._format.length, 0) + 1)
        while start is not None and start < position:
            if self._is_intact(start):
                return start
            start = self._candidate(start + 1)
        return None

    def _wait_from(self, position: int) -> int:
        """Return the first byte that is still needed: an unsettled candidate or a possible frame's head."""
        start = self._next_intact(position)
        return self._tail_start(position) if start is None else start

    def _skip(self, position: int, target: int) -> int:
        if target > position:
            self._skipped += target - position
            self._in_step = False
        return target

    def _next_intact(self, position: int) -> int | None:
        """Return the start of the next complete intact candidate at or after ``position``."""
        start = self._candidate(position)
        while start is not None and start + self._format.length <= len(self._buffer):
            if self._is_intact(start):
                return start
            if start >= self._judged:  # a candidate is judged again after each feed, but counted once
                self._refused += 1
                self._judged = start + 1
            start = self._candidate(start + 1)
        return None

    def _candidate(self, position: int) -> int | None:
        at = self._buffer.find(self._format.anchor, position + self._format.anchor_offset)
        return None if at < 0 else at - self._format.anchor_offset

    def _is_intact(self, start: int) -> bool:
        frame = bytes(self._buffer[start : start + self._format.length])
        return len(frame) == self._format.length and self._format.is_intact(frame)

    def _tail_start(self, position: int) -> int:
        """Return the first byte that may still belong to a frame."""
        start = self._candidate(position)
        while start is not None and start + self._format.length <= len(self._buffer):
            start = self._candidate(start + 1)
        if start is not None:
            return start
        possible = len(self._buffer) - self._format.anchor_offset - len(self._format.anchor) + 1
        return max(position, possible)

    def _settle(self, first: int, at_end: bool) -> int | None:
        """Choose between ``first`` and the candidates it overlaps; None asks for more bytes."""
        length = self._format.length
        rivals = []
        start = self._candidate(first + 1)
        while start is not None and start < first + length:
            complete = start + length <= len(self._buffer)
            if not complete or self._is_intact(start):
                rivals.append(start)
            start = self._candidate(start + 1)
        if not rivals:
            return first
        if not at_end and len(self._buffer) < first + (1 + _CHAIN_DEPTH) * length:
            return None
        intact = [start for start in rivals if self._is_intact(start)]
        self._overlaps += bool(intact)
        return max([first, *intact], key=self._credit)

    def _credit(self, start: int) -> tuple[int, bool, int]:
        """Rank rival candidates: by the frames that follow, then by an anchor that follows, then the later.

        The later, because a cut frame always has an anchor, while an anchor inside a payload is rare.
        """
        after = start + self._format.length + self._format.anchor_offset
        is_followed = self._buffer[after : after + len(self._format.anchor)] == self._format.anchor
        return self._chain(start), is_followed, start

    def _chain(self, start: int) -> int:
        """Return how many intact frames stand back to back from ``start`` on."""
        count = 0
        while count < _CHAIN_DEPTH and self._is_intact(start + count * self._format.length):
            count += 1
        return count
