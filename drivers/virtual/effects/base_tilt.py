"""A base that does not stand level."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class BaseTilt(Effect):
    """Gravity has a share along the base's x and y axes."""

    name = "base_tilt"
    where = "B"
    place = "none"
    size = "angle_rad"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"angle_rad": Range(1e-3, 3e-2, "rad"), "azimuth_rad": Range(-np.pi, np.pi, "rad")}

    def alter(self, plant: PlantSpec) -> PlantSpec:
        """The plant with gravity turned about the horizontal axis across the azimuth (Rodrigues)."""
        axis = np.array([-np.sin(self.p["azimuth_rad"]), np.cos(self.p["azimuth_rad"]), 0.0])
        gravity = np.array(plant.gravity_m_s2)
        sine, cosine = np.sin(self.p["angle_rad"]), np.cos(self.p["angle_rad"])
        turned = cosine * gravity + sine * np.cross(axis, gravity) + (1.0 - cosine) * axis * (axis @ gravity)
        return plant.model_copy(update={"gravity_m_s2": tuple(turned.tolist())})
