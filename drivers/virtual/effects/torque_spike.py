"""Outside the catalogue: a torque spike at one time of every period."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import noise_nm
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class TorqueSpike(Effect):
    """Outside the catalogue: a torque spike at one time of every period."""

    name = "torque_spike"
    where = "I"
    size = "height_nm"
    catalogued = False

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "height_nm": Range(2.0 * noise_nm(plant, j), 20.0 * noise_nm(plant, j), "N.m"),
            "time_s": Range(1.0, 9.0, "s"),
            "width_s": Range(0.02, 0.1, "s"),
            "period_s": Range(10.0, 10.0, "s"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        since = np.mod(moments.t_s - self.p["time_s"], self.p["period_s"])
        near = np.minimum(since, self.p["period_s"] - since) / self.p["width_s"]
        return self.column(self.p["height_nm"] * np.exp(-(near**2)))
