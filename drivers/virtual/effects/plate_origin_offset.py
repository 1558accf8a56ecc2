"""A plate whose true moment centre lies elsewhere: M + r x F."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class PlateOriginOffset(Effect):
    """A plate whose true moment centre lies elsewhere: M + r x F."""

    name = "plate_origin_offset"
    where = "P"
    place = "none"
    size = "distance_m"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "distance_m": Range(2e-3, 5e-2, "m"),
            "azimuth_rad": Range(-np.pi, np.pi, "rad"),
            "elevation_rad": Range(-0.5 * np.pi, 0.5 * np.pi, "rad"),
        }

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Six channels (n, 6) as they become."""
        flat = np.cos(self.p["elevation_rad"])
        way = (flat * np.cos(self.p["azimuth_rad"]), flat * np.sin(self.p["azimuth_rad"]))
        arm = self.p["distance_m"] * np.array([*way, np.sin(self.p["elevation_rad"])])
        changed = wrench.copy()
        changed[:, 3:] += np.cross(arm, wrench[:, :3])
        return changed
