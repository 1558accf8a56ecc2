"""A gear with play: the link lies on one or the other flank, by the sign of the load."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.driven import DrivenDeviation
from drivers.virtual.effects.effect import Range
from drivers.virtual.linear_filter import smooth_poles
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class Backlash(DrivenDeviation):
    """A gear with play: the link lies on one or the other flank, by the sign of the load."""

    name = "backlash"
    where = "B"
    size = "gap_rad"
    needs_loads = True

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"gap_rad": Range(2e-5, 1e-3, "rad"), "crossing_hz": Range(12.0, 12.0, "Hz")}

    def poles(self) -> np.ndarray:
        """Poles of the dynamics."""
        return smooth_poles(self.p["crossing_hz"])

    def target(self, moments: Moments, loads: RigidLoads | None) -> np.ndarray:
        """Deviation (n,) the link would settle at."""
        assert loads is not None
        return -0.5 * self.p["gap_rad"] * np.sign(loads.link_nm[:, self.j])
