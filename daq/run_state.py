"""Where a run stands: one table of allowed changes, one `advance`, every change numbered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from daq.errors import UsageError


class RunState(Enum):
    """States of a run; the last five are final."""

    QUEUED = "queued"
    PREFLIGHT = "preflight"
    ARMED = "armed"
    RECORDING = "recording"
    FINALISING = "finalising"
    ABORTING = "aborting"
    RECORDED = "recorded"
    FAILED = "failed"
    ABORTED = "aborted"
    INTERRUPTED = "interrupted"


class RunEvent(Enum):
    """What moves a run on."""

    STARTED = "started"
    PASSED = "every check passed"
    ENABLED = "drives follow their set points"
    MOVED = "the motion is over"
    COMPLETE = "the log is whole and proves itself"
    FAULT = "something failed"
    SETTLED = "hardware is at rest and the log is closed"
    ABORT = "abort asked for"
    DIED = "the process ended without a word"


_S, _E = RunState, RunEvent
TABLE: dict[tuple[RunState, RunEvent], RunState] = {
    (_S.QUEUED, _E.STARTED): _S.PREFLIGHT,
    (_S.QUEUED, _E.ABORT): _S.ABORTED,
    (_S.QUEUED, _E.DIED): _S.INTERRUPTED,
    (_S.PREFLIGHT, _E.PASSED): _S.ARMED,
    (_S.PREFLIGHT, _E.FAULT): _S.FINALISING,
    (_S.PREFLIGHT, _E.ABORT): _S.ABORTING,
    (_S.PREFLIGHT, _E.DIED): _S.INTERRUPTED,
    (_S.ARMED, _E.ENABLED): _S.RECORDING,
    (_S.ARMED, _E.FAULT): _S.FINALISING,
    (_S.ARMED, _E.ABORT): _S.ABORTING,
    (_S.ARMED, _E.DIED): _S.INTERRUPTED,
    (_S.RECORDING, _E.MOVED): _S.FINALISING,
    (_S.RECORDING, _E.FAULT): _S.FINALISING,
    (_S.RECORDING, _E.ABORT): _S.ABORTING,
    (_S.RECORDING, _E.DIED): _S.INTERRUPTED,
    (_S.FINALISING, _E.COMPLETE): _S.RECORDED,
    (_S.FINALISING, _E.SETTLED): _S.FAILED,
    (_S.FINALISING, _E.FAULT): _S.FINALISING,
    (_S.FINALISING, _E.ABORT): _S.FINALISING,  # nothing moves any more: what is there is written to its end
    (_S.FINALISING, _E.DIED): _S.INTERRUPTED,
    (_S.ABORTING, _E.SETTLED): _S.ABORTED,
    (_S.ABORTING, _E.FAULT): _S.ABORTING,
    (_S.ABORTING, _E.ABORT): _S.ABORTING,
    (_S.ABORTING, _E.DIED): _S.INTERRUPTED,
}

FINAL = frozenset({_S.RECORDED, _S.FAILED, _S.ABORTED, _S.INTERRUPTED})


@dataclass(frozen=True)
class Change:
    """One change of state.

    Attributes:
        number: counted from 1 within the run.
        event: what happened.
        before: the state before.
        after: the state since.
        reason: in words, empty where the event says it all.
    """

    number: int
    event: RunEvent
    before: RunState
    after: RunState
    reason: str = ""


class RunStatus:
    """The state of one run; listeners hear every change in the thread that makes it."""

    def __init__(self, *listeners: Callable[[Change], None]) -> None:
        self.state = RunState.QUEUED
        self.changes: list[Change] = []
        self._listeners = listeners

    @property
    def is_final(self) -> bool:
        """Whether the run is over."""
        return self.state in FINAL

    def advance(self, event: RunEvent, reason: str = "") -> RunState:
        """Let an event act.

        Raises:
            UsageError: the event means nothing in this state.
        """
        after = TABLE.get((self.state, event))
        if after is None:
            raise UsageError(f"A run that is {self.state.value} cannot take the event '{event.value}'.")
        change = Change(len(self.changes) + 1, event, self.state, after, reason)
        self.state = after
        self.changes.append(change)
        for listener in self._listeners:
            listener(change)
        return after
