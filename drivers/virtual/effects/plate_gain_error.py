"""A channel (all where none is named) with another gain: (1 + g) w."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class PlateGainError(Effect):
    """A channel (all where none is named) with another gain: (1 + g) w."""

    name = "plate_gain_error"
    where = "P"
    place = "channel"
    size = "share"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"share": Range(3e-3, 5e-2, "1", signed=True)}

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Six channels (n, 6) as they become."""
        changed = wrench.copy()
        changed[:, self.channels] *= 1.0 + self.p["share"]
        return changed
