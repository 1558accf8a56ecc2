"""Collect the TPDOs between two own SYNC echoes into one sample: exactly one of each, or a flag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.canopen.frame import TPDO1, TPDO2, Frame
from drivers.canopen.objects import MOTION_MAP, STATUS_MAP
from drivers.canopen.sample import Flag

_STATUS = STATUS_MAP.layout
_MOTION = MOTION_MAP.layout


@dataclass(frozen=True, slots=True)
class Harvest:
    """The frames of one interval, decoded; None where missing."""

    status: tuple[tuple[int, int, int] | None, ...]  # status word, position, current
    motion: tuple[tuple[int, int] | None, ...]  # demand, velocity
    stamp_ns: tuple[int | None, ...]
    flags: list[int]


class CycleAssembler:
    """Counts frames a COB-ID between SYNC echoes.

    Args:
        nodes: CANopen node of each axis, in axis order.
    """

    def __init__(self, nodes: Sequence[int]) -> None:
        axes = len(nodes)
        self._axes = axes
        self._slot = {TPDO1 + node: axis for axis, node in enumerate(nodes)}
        self._slot.update({TPDO2 + node: axes + axis for axis, node in enumerate(nodes)})
        self._frame: list[Frame | None] = [None] * (2 * axes)
        self._count = [0] * (2 * axes)
        self._short = [0] * axes
        self._was_missing = [False] * (2 * axes)

    @property
    def identifiers(self) -> frozenset[int]:
        """The identifiers this assembler takes."""
        return frozenset(self._slot)

    def add(self, frame: Frame) -> None:
        """Take one TPDO of the present interval."""
        slot = self._slot[frame.identifier]
        if len(frame.data) != 8:
            self._short[slot % self._axes] = Flag.WRONG_LENGTH
            return
        self._count[slot] += 1
        self._frame[slot] = frame  # of two, the later one is this interval's own

    def close(self) -> Harvest:
        """End the interval (the next own SYNC was seen) and start the next."""
        axes, frames, flags = self._axes, self._frame, self._short
        for slot, count in enumerate(self._count):
            if count != 1:
                flags[slot % axes] |= self._irregular(slot, count)
            self._was_missing[slot] = count == 0
        harvest = Harvest(
            tuple([_STATUS.unpack(frame.data) if frame else None for frame in frames[:axes]]),  # type: ignore[misc]
            tuple([_MOTION.unpack(frame.data) if frame else None for frame in frames[axes:]]),  # type: ignore[misc]
            tuple([frame.stamp_ns if frame else None for frame in frames[:axes]]),
            flags,
        )
        self._frame, self._count, self._short = [None] * (2 * axes), [0] * (2 * axes), [0] * axes
        return harvest

    def _irregular(self, slot: int, count: int) -> int:
        if count == 0:
            return Flag.MISSING_STATUS if slot < self._axes else Flag.MISSING_MOTION
        return Flag.LATE if self._was_missing[slot] else Flag.DUPLICATE
