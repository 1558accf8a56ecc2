"""Friction of a bearing that carries a tilting moment: mu_b |moment across the axis| sgn."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class BearingMomentFriction(Effect):
    """Friction of a bearing that carries a tilting moment: mu_b |moment across the axis| sgn."""

    name = "bearing_moment_friction"
    where = "I"
    size = "coefficient"
    needs_tilting = True

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"coefficient": Range(0.01, 0.06, "1")}

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        assert loads.tilting_nm is not None
        moment = loads.tilting_nm[:, self.j]
        return self.column(self.p["coefficient"] * moment * moments.direction[:, self.j])
