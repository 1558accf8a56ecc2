"""Cables bent by the joint: k (q - q0) + k3 (q - q0)^3."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import noise_nm
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class CableStiffness(Effect):
    """Cables bent by the joint: k (q - q0) + k3 (q - q0)^3."""

    name = "cable_stiffness"
    where = "I"
    size = "stiffness_nm_rad"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "stiffness_nm_rad": Range(0.3 * noise_nm(plant, j), 6.0 * noise_nm(plant, j), "N.m/rad"),
            "cubic_nm_rad3": Range(0.0, 0.0, "N.m/rad3"),
            "rest_rad": Range(-0.3, 0.3, "rad"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        bend = moments.q[:, self.j] - self.p["rest_rad"]
        return self.column(self.p["stiffness_nm_rad"] * bend + self.p["cubic_nm_rad3"] * bend**3)
