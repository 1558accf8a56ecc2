"""Friction that changes along the joint's turn: A cos(m q - phase) sgn."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import coulomb_nm
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class PositionDependentFriction(Effect):
    """Friction that changes along the joint's turn: A cos(m q - phase) sgn."""

    name = "position_dependent_friction"
    where = "I"
    size = "amplitude_nm"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "amplitude_nm": Range(0.03 * coulomb_nm(plant, j), 0.25 * coulomb_nm(plant, j), "N.m"),
            "order": Range(2, 6, "1/rev", integer=True),
            "phase_rad": Range(-np.pi, np.pi, "rad"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        turn = self.p["order"] * moments.q[:, self.j] - self.p["phase_rad"]
        return self.column(self.p["amplitude_nm"] * np.cos(turn) * moments.direction[:, self.j])
