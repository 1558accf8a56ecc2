"""Links that move a little otherwise than their motors, because something elastic or loose lies between."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect
from drivers.virtual.history import History
from drivers.virtual.linear_filter import PoleFilter
from drivers.virtual.rigid import RigidLoads, RigidPlant
from drivers.virtual.servo import Moments


class DrivenDeviation(Effect):
    """An effect whose link deviation follows a target through linear dynamics."""

    def poles(self) -> np.ndarray:
        """Poles of the dynamics [rad/s]."""
        raise NotImplementedError

    def target(self, moments: Moments, loads: RigidLoads | None) -> np.ndarray:
        """Deviation (n,) the link would settle at."""
        raise NotImplementedError

    def begin(self, step_s: float, history: History, rigid: RigidPlant) -> None:
        """Prepare the dynamics; a size of zero needs none."""
        self._history = history
        self._filter = PoleFilter(self.poles(), step_s, 1) if self.p[self.size] != 0.0 else None
        self._started = False

    def tick(self, moments: Moments, loads: RigidLoads | None) -> None:
        """Drive the dynamics through the new ticks."""
        if self._filter is None:
            return
        level = self.target(moments, loads)[:, None]
        if not self._started:
            self._filter.settle(level[0])
            self._started = True
        value, slope, bend = self._filter.advance(level)
        self._history.append(**{self.key: value, self.key + "_d": slope, self.key + "_dd": bend})

    def deviation(self, moments: Moments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Link minus motor (n, k) and derivatives."""
        if self._filter is None:
            none = np.zeros_like(moments.q)
            return none, none, none
        parts = self._history.smooth(self.key, moments.tick, moments.fraction)
        value, slope, bend = (self.column(part[:, 0]) for part in parts)
        return value, slope, bend
