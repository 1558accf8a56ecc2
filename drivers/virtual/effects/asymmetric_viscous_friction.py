"""Viscous friction that differs between the two directions: d |qd|."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import viscous_nm_s
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class AsymmetricViscousFriction(Effect):
    """Viscous friction that differs between the two directions: d |qd|."""

    name = "asymmetric_viscous_friction"
    where = "I"
    size = "difference_nm_s"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "difference_nm_s": Range(0.03 * viscous_nm_s(plant, j), 0.3 * viscous_nm_s(plant, j), "N.m.s/rad")
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        return self.column(self.p["difference_nm_s"] * np.abs(moments.qd[:, self.j]))
