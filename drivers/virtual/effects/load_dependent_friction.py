"""Friction of the loaded gear: mu |tau_l| sgn, tau_l the links' torque through the gear."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class LoadDependentFriction(Effect):
    """Friction of the loaded gear: mu |tau_l| sgn, tau_l the links' torque through the gear."""

    name = "load_dependent_friction"
    where = "I"
    size = "coefficient"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"coefficient": Range(0.02, 0.15, "1")}

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        load = np.abs(loads.link_nm[:, self.j])
        return self.column(self.p["coefficient"] * load * moments.direction[:, self.j])
