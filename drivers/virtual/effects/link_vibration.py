"""A link that swings at its own frequency when it is accelerated: x'' + 2 z w x' + w^2 x = -g qdd."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.driven import DrivenDeviation
from drivers.virtual.effects.effect import Range
from drivers.virtual.linear_filter import resonant_poles
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads
from drivers.virtual.servo import Moments


class LinkVibration(DrivenDeviation):
    """A link that swings at its own frequency when it is accelerated: x'' + 2 z w x' + w^2 x = -g qdd."""

    name = "link_vibration"
    where = "B"
    size = "share"
    needs_loads = False

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "share": Range(0.1, 1.0, "1"),
            "frequency_hz": Range(8.0, 30.0, "Hz"),
            "damping": Range(0.03, 0.1, "1"),
        }

    def poles(self) -> np.ndarray:
        """Poles of the dynamics."""
        return resonant_poles(self.p["frequency_hz"], self.p["damping"])

    def target(self, moments: Moments, loads: RigidLoads | None) -> np.ndarray:
        """Deviation (n,) the link would settle at."""
        natural = 2.0 * np.pi * self.p["frequency_hz"]
        return -self.p["share"] * moments.qdd[:, self.j] / natural**2
