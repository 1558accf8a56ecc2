"""Viscous friction that is no straight line: c |qd|^p sgn."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import viscous_nm_s
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class NonlinearViscousFriction(Effect):
    """Viscous friction that is no straight line: c |qd|^p sgn."""

    name = "nonlinear_viscous_friction"
    where = "I"
    size = "coefficient"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "coefficient": Range(0.1 * viscous_nm_s(plant, j), 0.6 * viscous_nm_s(plant, j), "N.m.(s/rad)^p"),
            "power": Range(2.0, 3.0, "1"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        speed = moments.qd[:, self.j]
        return self.column(self.p["coefficient"] * np.abs(speed) ** self.p["power"] * np.sign(speed))
