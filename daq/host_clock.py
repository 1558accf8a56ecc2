"""The host's clocks, and the fixed distance between them that a run's stamps keep."""

from __future__ import annotations

import time

from daq.ports import Clock

_STEP_NS = 1_000_000
"""Time servers slew the wall clock together with the monotonic one; a change beyond this is a step."""


class HostClock:
    """This machine's clocks."""

    def now_ns(self) -> int:
        """Monotonic time [ns]."""
        return time.monotonic_ns()

    def wall_ns(self) -> int:
        """Time of day [ns since 1970]."""
        return time.time_ns()


class Epoch:
    """The offset from monotonic time to the log's stamps, taken once: a stepped wall clock cannot move it."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        before_ns, wall_ns, after_ns = clock.now_ns(), clock.wall_ns(), clock.now_ns()
        self.offset_ns = self._seen_ns = wall_ns - (before_ns + after_ns) // 2

    def step_s(self) -> float | None:
        """By how much the wall clock was stepped since the last look [s], None where it was not."""
        clock = self._clock
        before_ns, wall_ns, after_ns = clock.now_ns(), clock.wall_ns(), clock.now_ns()
        seen_ns = wall_ns - (before_ns + after_ns) // 2
        moved_ns = seen_ns - self._seen_ns
        if abs(moved_ns) < _STEP_NS + (after_ns - before_ns):
            return None
        self._seen_ns = seen_ns
        return moved_ns * 1e-9
