"""What happened at the ticks so far: arrays that grow, and smooth interpolation between the ticks."""

from __future__ import annotations

import numpy as np

from drivers.virtual.errors import PlantError


class History:
    """Named (ticks, k) series on a uniform tick grid; the oldest are dropped when `keep_s` is exceeded."""

    def __init__(self, step_s: float, start_s: float, keep_s: float) -> None:
        self.step_s = step_s
        self._first_s = start_s
        self._keep = max(64, round(keep_s / step_s))
        self._series: dict[str, np.ndarray] = {}
        self._filled: dict[str, int] = {}

    def append(self, **blocks: np.ndarray) -> None:
        """Add the next ticks of some series, all blocks of one length."""
        for name, block in blocks.items():
            filled = self._filled.get(name, 0)
            store = self._series.get(name)
            if store is None:
                store = np.empty((max(256, len(block)), *block.shape[1:]), dtype=block.dtype)
            if filled + len(block) > len(store):
                grown = np.empty((2 * (filled + len(block)), *store.shape[1:]), dtype=store.dtype)
                grown[:filled] = store[:filled]
                store = grown
            store[filled : filled + len(block)] = block
            self._series[name], self._filled[name] = store, filled + len(block)

    def forget(self) -> None:
        """Drop the older half once twice the kept span is stored, alike in all series."""
        if min(self._filled.values()) < 2 * self._keep:
            return
        for name, store in self._series.items():
            filled = self._filled[name]
            store[: filled - self._keep] = store[self._keep : filled].copy()
            self._filled[name] = filled - self._keep
        self._first_s += self._keep * self.step_s

    def __contains__(self, name: str) -> bool:
        return name in self._series

    def series(self, name: str) -> np.ndarray:
        """All kept ticks of one series."""
        return self._series[name][: self._filled[name]]

    def locate(self, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tick (n,) before each instant and the fraction (n,) of a tick since."""
        place = (np.asarray(t_s) - self._first_s) / self.step_s
        last = min(self._filled.values()) - 1
        if place.size and (place.min() < -1e-6 or place.max() > last + 1e-6):
            raise PlantError(
                f"The virtual robot knows {self._first_s:.3f} to {self._first_s + last * self.step_s:.3f} s, "
                f"asked for {np.min(t_s):.3f} s to {np.max(t_s):.3f} s: advance it first."
            )
        tick = np.minimum(np.maximum(place.astype(np.int64), 0), max(last - 1, 0))
        return tick, place - tick

    def smooth(
        self, name: str, tick: np.ndarray, fraction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Value, slope and bend (n, k) of the quintic through series `name`, `name_d`, `name_dd`."""
        h = self.step_s
        y, v, a = (self.series(name + suffix) for suffix in ("", "_d", "_dd"))
        after, half = np.minimum(tick + 1, len(y) - 1), h * h / 2.0
        y0, v0, a0 = y[tick], v[tick] * h, a[tick] * half
        gap_y = y[after] - (y0 + v0 + a0)
        gap_v = v[after] * h - (v0 + 2.0 * a0)
        gap_a = a[after] * half - a0
        c3 = 10.0 * gap_y - 4.0 * gap_v + gap_a
        c4 = -15.0 * gap_y + 7.0 * gap_v - 2.0 * gap_a
        c5 = 6.0 * gap_y - 3.0 * gap_v + gap_a
        u = fraction[:, None]
        value = y0 + u * (v0 + u * (a0 + u * (c3 + u * (c4 + u * c5))))
        slope = (v0 + u * (2.0 * a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h
        bend = (2.0 * a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (h * h)
        return value, slope, bend

    def straight(self, name: str, tick: np.ndarray, fraction: np.ndarray) -> np.ndarray:
        """Linear interpolation of a series."""
        y = self.series(name)
        u = fraction.reshape(-1, *([1] * (y.ndim - 1)))
        return np.asarray((1.0 - u) * y[tick] + u * y[np.minimum(tick + 1, len(y) - 1)])
