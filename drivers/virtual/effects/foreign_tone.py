"""Outside the catalogue: a machine nearby that shakes a channel at its own frequency."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class ForeignTone(Effect):
    """Outside the catalogue: a machine nearby that shakes a channel at its own frequency."""

    name = "foreign_tone"
    where = "P"
    place = "channel"
    size = "amplitude"
    catalogued = False

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "amplitude": Range(1.0, 10.0, "N or N.m"),
            "frequency_hz": Range(2.0, 20.0, "Hz"),
            "phase_rad": Range(-np.pi, np.pi, "rad"),
        }

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Six channels (n, 6) as they become."""
        tone = self.p["amplitude"] * np.sin(2.0 * np.pi * self.p["frequency_hz"] * t_s + self.p["phase_rad"])
        changed = wrench.copy()
        changed[:, self.channels] += tone[:, None]
        return changed
