"""A motor whose magnets weaken as they warm: K falls by a (1 - exp(-t / tc))."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class TorqueConstantDrift(Effect):
    """A motor whose magnets weaken as they warm: K falls by a (1 - exp(-t / tc))."""

    name = "torque_constant_drift"
    where = "I"
    size = "share"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"share": Range(0.01, 0.08, "1"), "time_constant_s": Range(40.0, 200.0, "s")}

    def current(self, moments: Moments, current_a: np.ndarray) -> np.ndarray:
        """Motor currents (n, k) as they become."""
        changed = current_a.copy()
        own = current_a[:, self.j]
        warm = 1.0 - np.exp(-np.maximum(moments.t_s, 0.0) / self.p["time_constant_s"])
        changed[:, self.j] = own / (1.0 - self.p["share"] * warm)
        return changed
