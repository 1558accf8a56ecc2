"""A balancing spring nobody modelled: k A B sin(q - phi) (1 - l0 / l)."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import noise_nm
from drivers.virtual.plant_file import GravitySpring, PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments
from drivers.virtual.spring import spring_torque


class GravityCompensationSpring(Effect):
    """A balancing spring nobody modelled: k A B sin(q - phi) (1 - l0 / l)."""

    name = "gravity_compensation_spring"
    where = "I"
    size = "stiffness_n_m"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "stiffness_n_m": Range(20.0 * noise_nm(plant, j), 500.0 * noise_nm(plant, j), "N/m"),
            "radius_a_m": Range(0.4, 0.4, "m"),
            "radius_b_m": Range(0.08, 0.08, "m"),
            "rest_length_m": Range(0.2, 0.2, "m"),
            "phase_rad": Range(-0.4, 0.4, "rad"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        spring = GravitySpring(**self.p)
        return self.column(spring_torque(spring, moments.q[:, self.j]))
