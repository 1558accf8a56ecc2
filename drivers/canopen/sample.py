"""What one SYNC cycle brought: raw numbers, stamps and flags; nothing filled in."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag


class Flag(IntFlag):
    """What was wrong with one axis in one cycle."""

    MISSING_STATUS = 1  # TPDO1: status word, position, current
    MISSING_MOTION = 2  # TPDO2: demand, velocity
    LATE = 4  # two frames where the cycle before had none: the first belongs there
    DUPLICATE = 8  # two frames though the cycle before had its own
    WRONG_LENGTH = 16  # a frame of another length was rejected
    TORN = 32  # 6062h is not the set point sent: the drive missed its RPDO
    FAULT = 64  # status word bit 3
    FOLLOWING_ERROR = 128  # status word bit 13
    NOT_FOLLOWING = 256  # status word bit 12 is clear though enabled
    NO_SYNC = 512  # the SYNC of this cycle never appeared on the bus

    @property
    def missing(self) -> bool:
        """Whether this axis lacks a value in this cycle."""
        return bool(self & (Flag.MISSING_STATUS | Flag.MISSING_MOTION))


@dataclass(frozen=True, slots=True)
class CycleSample:
    """One SYNC cycle of all axes; tuples are in axis order, None where a frame is missing.

    Args:
        cycle: 0 at the first set point of the session; negative while enabling.
        sync: SYNCs since the bus started, never reset.
        sync_ns: the sampling instant: own SYNC seen on the bus [ns, link clock].
        status_word, position, current, demand, velocity: raw (6041h, 6064h, 6078h, 6062h, 606Ch).
        stamp_ns: when the frame with the position arrived [ns].
        flags: one `Flag` an axis.
        target: 607Ah as sent in this cycle (it acts at the next SYNC) [counts].
        late_sync: this SYNC came more than a fifth of a period off its place.
    """

    cycle: int
    sync: int
    sync_ns: int
    status_word: tuple[int | None, ...]
    position: tuple[int | None, ...]
    current: tuple[int | None, ...]
    demand: tuple[int | None, ...]
    velocity: tuple[int | None, ...]
    stamp_ns: tuple[int | None, ...]
    flags: tuple[int, ...]
    target: tuple[int, ...]
    late_sync: bool = False

    @property
    def complete(self) -> bool:
        """Whether every axis delivered every value."""
        return not any(Flag(flag).missing for flag in self.flags)
