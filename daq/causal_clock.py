"""The time base while the run lasts: the same hull, over the arrivals so far."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from daq.lower_hull import Line, lower_hull, supporting_line
from daq.timebase import STAMP_DRIFT, WINDOW_S, Transport, hidden_s

_BLOCK = 256
"""Arrivals between two renewals of the line."""

_FIRST = 32
"""Arrivals until the line is first renewed; before that each new lowest arrival moves it."""

_EXTRAPOLATION = 2.0
"""The line is read at its end, where it is twice as uncertain as in its middle."""

_KEPT_LOWEST = 16
"""Lowest arrivals of each block that are kept, for the hull and for the uncertainty."""

_ORDER = 15
"""The how-manieth smallest residual bounds the line, as in `daq.timebase`."""

_JUMP_S = 0.5


@dataclass(frozen=True)
class LiveInstant:
    """A sampling instant as known when the sample arrived."""

    stamp_ns: int
    uncertainty_s: float


class CausalClock:
    """Maps each sample when it arrives, from the arrivals up to it; for display and for stopping.

    Args of the constructor are those of `map_to_host`.
    """

    def __init__(
        self, tick_s: float, wire_s: float, transport: Transport, largest_drift: float = STAMP_DRIFT
    ) -> None:
        self._tick_s, self._transport, self._largest_drift = tick_s, transport, largest_drift
        self._shift_s = wire_s + transport.floor_s
        self._restart(0, 0)

    def _restart(self, ticks: int, read_ns: int) -> None:
        self._ticks0, self._read0_ns = ticks, read_ns
        self._blocks: deque[tuple[np.ndarray, np.ndarray]] = deque()
        self._ranges_s: deque[float] = deque()
        self._x: list[float] = []
        self._y: list[float] = []
        self._line: Line | None = None
        self._spread_s = 0.0
        self._since = 0

    def update(self, ticks: int, read_ns: int) -> LiveInstant:
        """Take one arrival and return its sampling instant.

        Args:
            ticks: unwrapped device stamp or sample count; a step backwards starts anew.
            read_ns: host monotonic instant of the read.
        """
        if self._line is None or self._is_reset(ticks, read_ns):
            self._restart(ticks, read_ns)
        x = (ticks - self._ticks0) * self._tick_s
        y = (read_ns - self._read0_ns) * 1e-9 - x
        self._x.append(x)
        self._y.append(y)
        self._since += 1
        if self._is_renewal_due() or self._line is None:
            self._renew()
        elif y < self._line.at(x):
            self._line = Line(x, y, self._line.slope)
        assert self._line is not None
        host_s = x + float(self._line.at(x)) - self._shift_s
        stamp_ns = self._read0_ns + round(host_s * 1e9)
        return LiveInstant(stamp_ns, self._spread_s + self._transport.floor_uncertainty_s)

    def _is_reset(self, ticks: int, read_ns: int) -> bool:
        if not self._x and not self._blocks:
            return False
        x = (ticks - self._ticks0) * self._tick_s
        last = self._x[-1] if self._x else float(self._blocks[-1][0][-1])
        assert self._line is not None
        y = (read_ns - self._read0_ns) * 1e-9 - x
        return bool(x < last - self._tick_s or y < self._line.at(x) - _JUMP_S)

    def _is_renewal_due(self) -> bool:
        count = len(self._x)
        return count >= _BLOCK or (not self._blocks and count >= _FIRST and count % _FIRST == 0)

    def _renew(self) -> None:
        x, y = np.array(self._x), np.array(self._y)
        if len(x) >= _BLOCK:
            self._blocks.append(_essence(x, y))
            self._ranges_s.append(float(np.quantile(y, 0.99) - np.min(y)))
            self._x, self._y = [], []
            while self._blocks[0][0][-1] < x[-1] - WINDOW_S:
                self._blocks.popleft()
                self._ranges_s.popleft()
        pieces = list(self._blocks) + ([(x, y)] if self._x else [])
        x = np.concatenate([piece[0] for piece in pieces])
        y = np.concatenate([piece[1] for piece in pieces])
        self._line = supporting_line(x, y, self._largest_drift)
        self._spread_s = self._bound(x, y)

    def _bound(self, x: np.ndarray, y: np.ndarray) -> float:
        """Return the tenth smallest residual of the latest third, and what the transport may hide."""
        assert self._line is not None
        residual = y - self._line.at(x)
        recent = residual[x >= x[-1] - (x[-1] - x[0]) / 3]
        order = min(_ORDER, len(recent)) - 1
        bound = _EXTRAPOLATION * float(np.partition(recent, order)[order])
        if not self._blocks:
            return max(bound, self._transport.period_s)
        return bound + hidden_s(max(self._ranges_s), float(x[-1] - x[0]), self._transport)


def _essence(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of a block that can ever matter: its hull's corners and its lowest points."""
    trend = (y[-1] - y[0]) / (x[-1] - x[0]) if x[-1] > x[0] else 0.0
    lowest = np.argsort(y - trend * x)[:_KEPT_LOWEST]
    chosen = np.unique(np.concatenate((lower_hull(x, y), lowest)))
    return x[chosen], y[chosen]
