"""A joint whose zero is not where the robot file says."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class JointZeroOffset(Effect):
    """The encoder reads the link's angle plus d."""

    name = "joint_zero_offset"
    where = "B"
    size = "offset_rad"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"offset_rad": Range(2e-3, 5e-2, "rad", signed=True)}

    def deviation(self, moments: Moments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Link minus motor (n, k): constant."""
        still = np.zeros_like(moments.q)
        return self.column(np.full(len(still), -self.p["offset_rad"])), still, still
