"""Time as the drivers see it: a port, so that a session can run in real or in virtual time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A monotonic clock in nanoseconds."""

    def now_ns(self) -> int:
        """Present time [ns]; never goes back."""
        ...


class MonotonicClock:
    """The monotonic clock of this machine."""

    def now_ns(self) -> int:
        """Present monotonic time [ns]."""
        return time.monotonic_ns()


class ManualClock:
    """A clock that moves only when told to; for state machines under test and simulated segments."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Present time of this clock [ns]."""
        return self._now_ns

    def advance_to(self, time_ns: int) -> None:
        """Move forward to `time_ns` [ns]; a time already past leaves the clock where it is."""
        self._now_ns = max(self._now_ns, time_ns)
