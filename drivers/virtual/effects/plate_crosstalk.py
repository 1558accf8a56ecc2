"""One channel that follows another: w_to += c w_from."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec


class PlateCrosstalk(Effect):
    """One channel that follows another: w_to += c w_from."""

    name = "plate_crosstalk"
    where = "P"
    place = "crosstalk"
    size = "coefficient"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"coefficient": Range(3e-3, 4e-2, "1, m or 1/m", signed=True)}

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Six channels (n, 6) as they become."""
        source, sink = self.channels
        changed = wrench.copy()
        changed[:, sink] += self.p["coefficient"] * wrench[:, source]
        return changed
