"""A current sensor whose zero creeps: c1 t."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import noise_a, run_s
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class CurrentOffsetDrift(Effect):
    """A current sensor whose zero creeps: c1 t."""

    name = "current_offset_drift"
    where = "I"
    size = "slope_a_s"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "slope_a_s": Range(
                0.3 * noise_a(plant, j) / run_s(), 3.0 * noise_a(plant, j) / run_s(), "A/s", signed=True
            )
        }

    def current(self, moments: Moments, current_a: np.ndarray) -> np.ndarray:
        """Motor currents (n, k) as they become."""
        changed = current_a.copy()
        own = current_a[:, self.j]
        changed[:, self.j] = own + self.p["slope_a_s"] * moments.t_s
        return changed
