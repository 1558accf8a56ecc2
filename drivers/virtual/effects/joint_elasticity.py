"""A gear that gives way: q_link = q - tau_l / K, with the resonance of the link on that spring."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.driven import DrivenDeviation
from drivers.virtual.effects.effect import Range
from drivers.virtual.effects.scales import joint_inertias
from drivers.virtual.linear_filter import resonant_poles
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class JointElasticity(DrivenDeviation):
    """A gear that gives way: q_link = q - tau_l / K, with the resonance of the link on that spring."""

    name = "joint_elasticity"
    where = "B"
    size = "compliance_rad_nm"
    needs_loads = True

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        inertia = joint_inertias(plant)[j]
        stiff, soft = (1.0 / (inertia * (2.0 * np.pi * hz) ** 2) for hz in (20.0, 8.0))
        return {"compliance_rad_nm": Range(stiff, soft, "rad/(N.m)"), "damping": Range(0.05, 0.15, "1")}

    def poles(self) -> np.ndarray:
        """Poles of the dynamics."""
        inertia = joint_inertias(self.plant_spec)[self.j]
        frequency_hz = 1.0 / (2.0 * np.pi * np.sqrt(inertia * self.p["compliance_rad_nm"]))
        return resonant_poles(frequency_hz, self.p["damping"])

    def target(self, moments: Moments, loads: RigidLoads | None) -> np.ndarray:
        """Deviation (n,) the link would settle at."""
        assert loads is not None
        return -self.p["compliance_rad_nm"] * loads.link_nm[:, self.j]
