"""A platform that swings on the plate: a resonance at 1/(2 pi sqrt(s2)) Hz between robot and reading."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.history import History
from drivers.virtual.linear_filter import PoleFilter, resonant_poles
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidPlant


class PlatformCompliance(Effect):
    """A platform that swings on the plate: a resonance at 1/(2 pi sqrt(s2)) Hz between robot and reading."""

    name = "platform_compliance"
    where = "P"
    place = "none"
    size = "inverse_square_s2"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "inverse_square_s2": Range(
                1.0 / (2.0 * np.pi * 35.0) ** 2, 1.0 / (2.0 * np.pi * 15.0) ** 2, "s^2"
            ),
            "damping": Range(0.05, 0.15, "1"),
        }

    def begin(self, step_s: float, history: History, rigid: RigidPlant) -> None:
        """Let the platform come to rest."""
        self._filter: PoleFilter | None = None

    def plate(self, t_s: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Six channels (n, 6) as they become."""
        if self.p["inverse_square_s2"] == 0.0:
            return wrench
        if self._filter is None:
            rate_hz = self.plant_spec.sampling.rate_hz
            frequency_hz = 1.0 / (2.0 * np.pi * np.sqrt(self.p["inverse_square_s2"]))
            self._filter = PoleFilter(resonant_poles(frequency_hz, self.p["damping"]), 1.0 / rate_hz, 6)
            self._filter.settle(wrench[0])
        return self._filter.advance(wrench)[0]
