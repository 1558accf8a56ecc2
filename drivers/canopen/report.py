"""How a session ended: complete with its count, or failed with the exact missing cycles; the cause first."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

from drivers.canopen.emergency import Emergency
from drivers.canopen.ladder import Rung
from drivers.canopen.sample import CycleSample, Flag


class CauseKind(Enum):
    """Why a session stopped or failed."""

    MISSING = "frames missing"
    SYNC_LOST = "SYNC lost"
    TORN = "set points missed"
    HEARTBEAT = "heartbeat lost"
    EMERGENCY = "emergency"
    FAULT = "drive fault"
    FOLLOWING_ERROR = "following error"
    NOT_FOLLOWING = "drive ignores its target"
    BUS_OFF = "bus-off"
    LINK = "link failed"
    FOREIGN_SYNC = "second SYNC producer"
    RESTARTED = "drive restarted"
    STATE = "state deadline"
    OPERATOR = "operator"
    EXTERNAL = "external request"


@dataclass(frozen=True)
class Cause:
    """One reason, where and when, in one sentence."""

    kind: CauseKind
    sentence: str
    time_ns: int
    cycle: int
    axis: str | None = None


@dataclass(frozen=True)
class MissingCycle:
    """One cycle in which one axis lacks a value."""

    cycle: int
    axis: str
    flags: Flag


@dataclass(frozen=True)
class SessionReport:
    """The proof of a session.

    Args:
        outcome: `complete` only when every axis delivered every value of every cycle, each set point
            arrived, and nothing tripped.
        cycles: set-point cycles run.
        missing: every (cycle, axis) that lacks a value, in order.
        torn: every (cycle, axis) whose drive did not follow the set point sent.
        irregular: cycles with late or duplicate frames or frames of a wrong length.
        late_syncs: cycles whose SYNC left late (the stamps say when).
        causes: what tripped, first cause first.
        error_frames: error classes that the CAN controller reported, with their counts.
        ladder: the rungs of the stop with their times [ns].
        unconfirmed: axes that never confirmed their stop.
        tail: the samples taken while the drives were stopping.
        restore_failures: sentences on what could not be put back at close.
    """

    outcome: Literal["complete", "failed"]
    cycles: int
    missing: tuple[MissingCycle, ...] = ()
    torn: tuple[MissingCycle, ...] = ()
    irregular: tuple[MissingCycle, ...] = ()
    late_syncs: tuple[int, ...] = ()
    causes: tuple[Cause, ...] = ()
    emergencies: tuple[Emergency, ...] = ()
    error_frames: tuple[tuple[str, int], ...] = ()
    ladder: tuple[tuple[Rung, int], ...] = ()
    unconfirmed: tuple[str, ...] = ()
    tail: tuple[CycleSample, ...] = ()
    restore_failures: tuple[str, ...] = ()

    @property
    def cause(self) -> Cause | None:
        """The first cause."""
        return self.causes[0] if self.causes else None

    @property
    def missing_cycles(self) -> tuple[int, ...]:
        """Numbers of the cycles that lack anything, each once, in order."""
        return tuple(sorted({entry.cycle for entry in self.missing}))

    @property
    def stopped(self) -> bool:
        """Whether the drives confirmed that they stopped."""
        return bool(self.ladder) and self.ladder[-1][0] is Rung.STOPPED

    @property
    def sentence(self) -> str:
        """The whole outcome in one sentence."""
        if self.outcome == "complete":
            return f"The session is complete: {self.cycles} cycles, 0 missing."
        cause = f" First cause: {self.causes[0].sentence}" if self.causes else ""
        return (
            f"The session failed after {self.cycles} cycles with {len(self.missing_cycles)} missing"
            f"{_spans(self.missing_cycles)} and {len(self.torn)} missed set points.{cause}"
        )


def _spans(cycles: tuple[int, ...]) -> str:
    """Cycle numbers as spans: ' (3, 7-9)'."""
    spans: list[list[int]] = []
    for cycle in cycles:
        if spans and cycle == spans[-1][1] + 1:
            spans[-1][1] = cycle
        else:
            spans.append([cycle, cycle])
    texts = [str(a) if a == b else f"{a}-{b}" for a, b in spans]
    return f" ({', '.join(texts)})" if texts else ""
