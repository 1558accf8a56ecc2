"""A drive that loses a little current around zero: d sign(i) on top."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import noise_a
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class CurrentDeadZone(Effect):
    """A drive that loses a little current around zero: d sign(i) on top."""

    name = "current_dead_zone"
    where = "I"
    size = "width_a"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"width_a": Range(0.1 * noise_a(plant, j), 1.5 * noise_a(plant, j), "A")}

    def current(self, moments: Moments, current_a: np.ndarray) -> np.ndarray:
        """Motor currents (n, k) as they become."""
        changed = current_a.copy()
        own = current_a[:, self.j]
        changed[:, self.j] = own + self.p["width_a"] * np.sign(own)
        return changed
