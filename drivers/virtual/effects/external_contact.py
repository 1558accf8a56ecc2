"""Something the last link pushes against, in one place of a joint's travel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import tip
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import OutsideForce
from drivers.virtual.servo import Moments


@dataclass(frozen=True)
class _Push:
    link: str
    point_m: np.ndarray
    force_n: np.ndarray
    way: np.ndarray

    def __call__(self, index: int, position_m: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.force_n[index] * self.way, np.zeros(3)


class ExternalContact(Effect):
    """A soft bump: it pushes in one fixed direction while the joint is within a width of its place."""

    name = "external_contact"
    where = "B"
    size = "force_n"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        scale_n = plant.noise.wrench[0] or 1.0
        return {
            "force_n": Range(0.5 * scale_n, 10.0 * scale_n, "N"),
            "angle_rad": Range(-0.3, 0.3, "rad"),
            "width_rad": Range(0.05, 0.2, "rad"),
            "azimuth_rad": Range(-np.pi, np.pi, "rad"),
        }

    def outside(self, moments: Moments) -> Sequence[OutsideForce]:
        """The push at every moment."""
        away = (moments.q[:, self.j] - self.p["angle_rad"]) / self.p["width_rad"]
        force_n = self.p["force_n"] * np.maximum(1.0 - away**2, 0.0) ** 2
        level = 0.8  # mostly sideways, a little up
        way = np.array([level * np.cos(self.p["azimuth_rad"]), level * np.sin(self.p["azimuth_rad"]), 0.6])
        return (_Push(*tip(self.plant_spec), force_n, way),)
