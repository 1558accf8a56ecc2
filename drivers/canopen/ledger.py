"""The book of a session: what was irregular in which cycle, and what was the first reason to stop."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.canopen.emergency import Emergency
from drivers.canopen.report import Cause, CauseKind, MissingCycle
from drivers.canopen.sample import CycleSample, Flag

_MISSING = int(Flag.MISSING_STATUS | Flag.MISSING_MOTION)
_IRREGULAR = int(Flag.LATE | Flag.DUPLICATE | Flag.WRONG_LENGTH)
_TORN = int(Flag.TORN)


class Ledger:
    """Books samples, judges them, keeps causes in order of time.

    Args:
        names: the axes' names.
        missing_in_row: so many cycles in a row without a value, or torn, trip the session.
    """

    def __init__(self, names: Sequence[str], missing_in_row: int) -> None:
        self.names = tuple(names)
        self.armed = False
        self.cycle = -1
        self.cycles = 0
        self.causes: list[Cause] = []
        self.emergencies: list[Emergency] = []
        self.error_frames: dict[str, int] = {}
        self.missing: list[MissingCycle] = []
        self.torn: list[MissingCycle] = []
        self.irregular: list[MissingCycle] = []
        self.late_syncs: list[int] = []
        self._limit = missing_in_row
        self._row = [0] * len(names)
        self._torn_row = [0] * len(names)

    @property
    def tripped(self) -> bool:
        """Whether there is a reason to stop."""
        return bool(self.causes)

    def trip(self, kind: CauseKind, sentence: str, now_ns: int, axis: str | None = None) -> None:
        """Note a reason to stop; before `armed` nothing moves, so nothing trips."""
        known = any(cause.kind is kind and cause.axis == axis for cause in self.causes)
        if self.armed and not known:
            self.causes.append(Cause(kind, sentence, now_ns, self.cycle, axis))

    def book(self, sample: CycleSample) -> None:
        """Enter one cycle of the session and judge it."""
        self.cycles += 1
        if sample.late_sync:
            self.late_syncs.append(sample.cycle)
        if any(sample.flags):
            for axis, flags in enumerate(sample.flags):
                self._enter(sample, axis, flags)
        elif any(self._row) or any(self._torn_row):
            self._row = [0] * len(self.names)
            self._torn_row = [0] * len(self.names)

    def book_lost(self) -> None:
        """Enter a cycle that the link's failure cut short: no axis has its values."""
        self.cycles += 1
        flags = Flag.MISSING_STATUS | Flag.MISSING_MOTION | Flag.NO_SYNC
        self.missing += [MissingCycle(self.cycle, name, flags) for name in self.names]

    def _enter(self, sample: CycleSample, axis: int, flags: int) -> None:
        entry = MissingCycle(sample.cycle, self.names[axis], Flag(flags))
        for mask, book in ((_MISSING, self.missing), (_TORN, self.torn), (_IRREGULAR, self.irregular)):
            if flags & mask:
                book.append(entry)
        self._row[axis] = self._row[axis] + 1 if flags & _MISSING else 0
        self._torn_row[axis] = self._torn_row[axis] + 1 if flags & _TORN else 0
        self._judge(sample, axis, flags)

    def _judge(self, sample: CycleSample, axis: int, flags: int) -> None:
        name, now_ns = self.names[axis], sample.sync_ns
        if flags & Flag.FAULT:
            self.trip(CauseKind.FAULT, f"The drive of {name} reports a fault.", now_ns, name)
        if flags & Flag.FOLLOWING_ERROR:
            text = f"The drive of {name} reports a following error: it cannot follow its set points."
            self.trip(CauseKind.FOLLOWING_ERROR, text, now_ns, name)
        if flags & Flag.NOT_FOLLOWING:
            text = f"The drive of {name} left 'operation enabled' or ignores its set points."
            self.trip(CauseKind.NOT_FOLLOWING, text, now_ns, name)
        if self._row[axis] >= self._limit:
            self._trip_missing(sample, axis, flags)
        if self._torn_row[axis] >= self._limit:
            text = f"The drive of {name} missed {self._limit} set points in a row."
            self.trip(CauseKind.TORN, text, now_ns, name)

    def _trip_missing(self, sample: CycleSample, axis: int, flags: int) -> None:
        if flags & Flag.NO_SYNC:
            text = f"SYNC was not on the bus {self._limit} times in a row; check the adapter and the cable."
            self.trip(CauseKind.SYNC_LOST, text, sample.sync_ns)
            return
        name = self.names[axis]
        text = f"The drive of {name} sent nothing usable for {self._limit} cycles in a row."
        self.trip(CauseKind.MISSING, text, sample.sync_ns, name)
