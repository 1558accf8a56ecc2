"""Outside the catalogue: Coulomb friction that jumps at one angle of the joint."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import coulomb_nm
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class FrictionStep(Effect):
    """Outside the catalogue: Coulomb friction that jumps at one angle of the joint."""

    name = "friction_step"
    where = "I"
    size = "step_nm"
    catalogued = False

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "step_nm": Range(0.05 * coulomb_nm(plant, j), 0.4 * coulomb_nm(plant, j), "N.m"),
            "angle_rad": Range(-0.3, 0.3, "rad"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        beyond = moments.q[:, self.j] > self.p["angle_rad"]
        return self.column(self.p["step_nm"] * beyond * moments.direction[:, self.j])
