"""Friction that gives elastically before it slides (Dahl)."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.history import History
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads, RigidPlant
from drivers.virtual.servo import Moments


class PreslidingFriction(Effect):
    """Coulomb friction that builds up over a small slide: z' = qd (1 - sgn z / xs), friction fc z / xs.

    Between two reversals the state relaxes with the distance, not with time, so it is stepped exactly:
    rate independent, with memory.
    """

    name = "presliding_friction"
    where = "I"
    size = "slide_rad"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"slide_rad": Range(2e-4, 5e-3, "rad")}

    def begin(self, step_s: float, history: History, rigid: RigidPlant) -> None:
        """Start unloaded."""
        self._history, self._state, self._angle = history, 0.0, None

    def tick(self, moments: Moments, loads: RigidLoads | None) -> None:
        """Carry the state (as a share of its limit) from tick to tick."""
        if self.p["slide_rad"] == 0.0:
            return
        angle = moments.q[:, self.j]
        before = angle[:1] if self._angle is None else np.array([self._angle])
        move = np.diff(np.concatenate([before, angle]))
        keep, side = np.exp(-np.abs(move) / self.p["slide_rad"]).tolist(), np.sign(move).tolist()
        state, states = self._state, []
        for factor, sign in zip(keep, side, strict=True):
            state = sign + (state - sign) * factor if sign else state
            states.append(state)
        self._state, self._angle = state, float(angle[-1])
        self._history.append(**{self.key: np.array(states)})

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """What replaces the ideal Coulomb friction, minus it (n, k)."""
        if self.p["slide_rad"] == 0.0:
            return np.zeros_like(moments.q)
        move = moments.q[:, self.j] - self._history.series("q")[moments.tick, self.j]
        keep, side = np.exp(-np.abs(move) / self.p["slide_rad"]), np.sign(move)
        start = self._history.series(self.key)[moments.tick]
        state = np.where(side == 0.0, start, side + (start - side) * keep)
        coulomb = self.plant_spec.joints[self.j].coulomb_nm
        return self.column(coulomb * (state - moments.direction[:, self.j]))
