"""An encoder disk that turns off its centre."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class EncoderEccentricity(Effect):
    """The reading is q + e sin(q + phase)."""

    name = "encoder_eccentricity"
    where = "S"
    size = "amplitude_rad"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "amplitude_rad": Range(2e-4, 4e-3, "rad", signed=True),
            "phase_rad": Range(-np.pi, np.pi, "rad"),
        }

    def encoder(self, moments: Moments, reading: np.ndarray) -> np.ndarray:
        """Encoder readings (n, k) as they become."""
        angle = moments.q[:, self.j]
        return reading + self.column(self.p["amplitude_rad"] * np.sin(angle + self.p["phase_rad"]))
