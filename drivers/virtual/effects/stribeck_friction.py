"""Friction that is higher at low speed: (fs - fc) exp(-(|qd| / vs)^d) sgn."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import coulomb_nm
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class StribeckFriction(Effect):
    """Friction that is higher at low speed: (fs - fc) exp(-(|qd| / vs)^d) sgn."""

    name = "stribeck_friction"
    where = "I"
    size = "excess_nm"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "excess_nm": Range(0.05 * coulomb_nm(plant, j), 0.4 * coulomb_nm(plant, j), "N.m"),
            "speed_rad_s": Range(0.03, 0.15, "rad/s"),
            "exponent": Range(2.0, 2.0, "1"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        slow = (np.abs(moments.qd[:, self.j]) / self.p["speed_rad_s"]) ** self.p["exponent"]
        return self.column(self.p["excess_nm"] * np.exp(-slow) * moments.direction[:, self.j])
