"""A device's wrapping counter made into one that never wraps, with its losses."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

_LONGEST_GAP_S = 30.0
"""A forward jump of a wide counter beyond this is a restart of the device, not a loss."""

_WORST_DRIFT = 300e-6
"""Rate by which two quartz clocks may part (consumer quartz: 100 ppm each, with a margin)."""

_WHILE_NS = 50_000_000
"""Longer than any converter clumps (16 ms) and than most pauses of a busy host."""

_TURN_SHARE = 0.75
"""Part of a turn that must have gone by on the host before a missed turn is believed."""


@dataclass(frozen=True)
class Tick:
    """Where one sample stands: unwrapped ticks, clock segment and samples lost just before it."""

    ticks: int
    segment: int
    lost: int


class CounterUnwrapper:
    """Follows a counter modulo ``modulus`` that advances by ``step`` ticks of ``tick_s`` a sample.

    A wide counter tells a restart of the device by a jump backwards. A narrow one (a decimal digit, say)
    repeats so soon that whole turns may be missed: they are restored from the host's time, judged by the
    freshest samples within a while, because the older ones of a clump, and the last before a hole, are late
    without any loss. A restored turn thus shows a while after the hole; the total is exact.
    """

    def __init__(self, modulus: int, step: float, tick_s: float) -> None:
        self._modulus, self._step, self._tick_s = modulus, step, tick_s
        self._is_wide = modulus * tick_s > 2 * _LONGEST_GAP_S
        self._last: int | None = None
        self._ticks = self._segment = 0
        self._read_ns = self._origin_ns = 0
        self._floor_ticks = 0.0
        self._behind: deque[tuple[int, float]] = deque()  # of late reads: when, how late in ticks

    def advance(self, counters: Sequence[int], read_ns: int = 0) -> list[Tick]:
        """Take the counters of one read and return where their samples stand.

        Args:
            counters: as sent, in order of arrival.
            read_ns: host monotonic instant of the read, 0 when unknown (then no turn is restored).
        """
        if not counters:
            return []
        missed = 0 if self._is_wide else self._missed_turns(counters, read_ns)
        ticks = []
        for counter in counters:
            ticks.append(self._step_to(counter, missed))
            missed = 0
        return ticks

    def _step_to(self, counter: int, missed_turns: int) -> Tick:
        last, self._last = self._last, counter
        if last is None:
            self._ticks = counter
            return Tick(counter, 0, 0)
        delta = (counter - last) % self._modulus
        if self._is_wide and (delta == 0 or delta * self._tick_s > _LONGEST_GAP_S):
            self._segment += 1
            self._ticks = counter
            return Tick(counter, self._segment, 0)
        delta = (delta or self._modulus) + missed_turns * self._modulus
        self._ticks += delta
        return Tick(self._ticks, self._segment, max(round(delta / self._step) - 1, 0))

    def _missed_turns(self, counters: Sequence[int], read_ns: int) -> int:
        if not read_ns:
            return 0
        if self._last is None:
            self._origin_ns = self._read_ns = read_ns
            self._floor_ticks = -float(counters[0] + self._span(counters[0], counters[1:]))
            self._behind.append((read_ns, self._floor_ticks))
            return 0
        elapsed_ticks = (read_ns - self._origin_ns) * 1e-9 / self._tick_s
        behind = elapsed_ticks - self._ticks - self._span(self._last, counters)
        self._floor_ticks += _WORST_DRIFT * (read_ns - self._read_ns) * 1e-9 / self._tick_s
        self._read_ns = read_ns
        self._behind.append((read_ns, behind))
        while len(self._behind) > 1 and self._behind[1][0] <= read_ns - _WHILE_NS:
            self._behind.popleft()
        least = min(late for _, late in self._behind)
        turns = max(int((least - self._floor_ticks) / self._modulus + 1 - _TURN_SHARE), 0)
        if turns:
            self._behind = deque((when, late - turns * self._modulus) for when, late in self._behind)
        self._floor_ticks = min(self._floor_ticks, least - turns * self._modulus)
        return turns

    def _span(self, last: int, counters: Sequence[int]) -> int:
        span = 0
        for counter in counters:
            span += (counter - last) % self._modulus or self._modulus
            last = counter
        return span
