"""One drive whose current is sampled late: what is stamped t was true at t - T."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class CurrentDelay(Effect):
    """One drive whose current is sampled late: what is stamped t was true at t - T."""

    name = "current_delay"
    where = "I"
    place = "joint"
    size = "delay_s"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"delay_s": Range(2e-4, 4e-3, "s")}

    def instants(self, stream: str, t_s: np.ndarray) -> np.ndarray:
        """True instants of the samples of a stream."""
        if stream != "current":
            return t_s
        late = np.zeros(self.width)
        late[self.j] = self.p["delay_s"]
        return (t_s[:, None] if t_s.ndim == 1 else t_s) - late
