"""A motor whose torque constant is K (1 + e): it needs another current for the same torque."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class TorqueConstantError(Effect):
    """A motor whose torque constant is K (1 + e): it needs another current for the same torque."""

    name = "torque_constant_error"
    where = "I"
    size = "share"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"share": Range(0.02, 0.2, "1", signed=True)}

    def current(self, moments: Moments, current_a: np.ndarray) -> np.ndarray:
        """Motor currents (n, k) as they become."""
        changed = current_a.copy()
        own = current_a[:, self.j]
        changed[:, self.j] = own / (1.0 + self.p["share"])
        return changed
