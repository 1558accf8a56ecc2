"""A plate whose clock was not corrected: its lateness grows through the run."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class ClockDrift(Effect):
    """A plate whose clock was not corrected: its lateness grows through the run."""

    name = "clock_drift"
    where = "S"
    place = "none"
    size = "rate_ppm"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"rate_ppm": Range(5.0, 100.0, "ppm")}

    def instants(self, stream: str, t_s: np.ndarray) -> np.ndarray:
        """True instants of the samples of a stream."""
        return t_s - 1e-6 * self.p["rate_ppm"] * np.maximum(t_s, 0.0) if stream == "wrench" else t_s
