"""Torque of the motor's magnets against its teeth: A cos(k th + phase), th the motor's angle."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import noise_nm
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class Cogging(Effect):
    """Torque of the motor's magnets against its teeth: A cos(k th + phase), th the motor's angle."""

    name = "cogging"
    where = "I"
    size = "amplitude_nm"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "amplitude_nm": Range(0.2 * noise_nm(plant, j), 2.0 * noise_nm(plant, j), "N.m"),
            "order": Range(1, 6, "1/rev of the motor", integer=True),
            "phase_rad": Range(-np.pi, np.pi, "rad"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        angle = self.plant_spec.joints[self.j].gear_ratio * moments.q[:, self.j]
        return self.column(self.p["amplitude_nm"] * np.cos(self.p["order"] * angle + self.p["phase_rad"]))
