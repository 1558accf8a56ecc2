"""Friction of a motor that turns with two joints: fc sgn(qd_j + c qd_k) + fv (qd_j + c qd_k)."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import coulomb_nm
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class CoupledTransmissionFriction(Effect):
    """Friction of a motor that turns with two joints: fc sgn(qd_j + c qd_k) + fv (qd_j + c qd_k)."""

    name = "coupled_transmission_friction"
    where = "I"
    size = "coulomb_nm"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "coulomb_nm": Range(0.1 * coulomb_nm(plant, j), 0.5 * coulomb_nm(plant, j), "N.m"),
            "viscous_nm_s": Range(0.0, 0.1 * coulomb_nm(plant, j), "N.m.s/rad"),
            "ratio": Range(0.1, 0.5, "1", signed=True),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        if len(self.plant_spec.joints) < 2 or self.p["coulomb_nm"] == 0.0:
            return np.zeros_like(moments.q)
        other, ratio = (self.j + 1 if self.j + 1 < self.width else self.j - 1), self.p["ratio"]
        speed = moments.qd[:, self.j] + ratio * moments.qd[:, other]
        friction = self.p["coulomb_nm"] * np.sign(speed) + self.p["viscous_nm_s"] * speed
        torque = self.column(friction)
        torque[:, other] = ratio * friction  # the same loss, felt through the other joint
        return torque
