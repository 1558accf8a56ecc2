"""A channel (all where none is named) whose zero creeps: c1 t."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class PlateDrift(Effect):
    """A channel (all where none is named) whose zero creeps: c1 t."""

    name = "plate_drift"
    where = "P"
    place = "channel"
    size = "slope"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"slope": Range(2e-3, 5e-2, "N/s or N.m/s", signed=True)}

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Six channels (n, 6) as they become."""
        changed = wrench.copy()
        changed[:, self.channels] += self.p["slope"] * t_s[:, None]
        return changed
