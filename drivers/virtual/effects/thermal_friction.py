"""Friction that falls while the joint warms up: fv (1 + a exp(-t / tc)), a part of it in fc too."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class ThermalFriction(Effect):
    """Friction that falls while the joint warms up: fv (1 + a exp(-t / tc)), a part of it in fc too."""

    name = "thermal_friction"
    where = "I"
    size = "share"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "share": Range(0.05, 0.4, "1"),
            "time_constant_s": Range(40.0, 200.0, "s"),
            "coulomb_share": Range(0.0, 0.5, "1"),
        }

    def torque(self, moments: Moments, loads: RigidLoads) -> np.ndarray:
        """Extra motor torque (n, k)."""
        joint = self.plant_spec.joints[self.j]
        cold = self.p["share"] * np.exp(-np.maximum(moments.t_s, 0.0) / self.p["time_constant_s"])
        dry = self.p["coulomb_share"] * joint.coulomb_nm * moments.direction[:, self.j]
        return self.column(cold * (joint.viscous_nm_s * moments.qd[:, self.j] + dry))
