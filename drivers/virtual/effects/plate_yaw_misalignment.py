"""A plate turned about its vertical axis."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class PlateYawMisalignment(Effect):
    """A plate turned about its vertical axis."""

    name = "plate_yaw_misalignment"
    where = "P"
    place = "none"
    size = "angle_rad"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"angle_rad": Range(2e-3, 3e-2, "rad", signed=True)}

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Six channels (n, 6) as they become."""
        cosine, sine = np.cos(self.p["angle_rad"]), np.sin(self.p["angle_rad"])
        changed = wrench.copy()
        for x, y in ((0, 1), (3, 4)):
            changed[:, x] = cosine * wrench[:, x] + sine * wrench[:, y]
            changed[:, y] = cosine * wrench[:, y] - sine * wrench[:, x]
        return changed
