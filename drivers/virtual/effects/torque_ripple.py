"""Torque that ripples with the motor's angle and its current: i a cos(k th + phase)."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class TorqueRipple(Effect):
    """Torque that ripples with the motor's angle and its current: i a cos(k th + phase)."""

    name = "torque_ripple"
    where = "I"
    size = "share"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "share": Range(0.01, 0.08, "1"),
            "order": Range(1, 6, "1/rev of the motor", integer=True),
            "phase_rad": Range(-np.pi, np.pi, "rad"),
        }

    def current(self, moments: Moments, current_a: np.ndarray) -> np.ndarray:
        """Motor currents (n, k) as they become."""
        changed = current_a.copy()
        own = current_a[:, self.j]
        angle = self.plant_spec.joints[self.j].gear_ratio * moments.q[:, self.j]
        wave = np.cos(self.p["order"] * angle + self.p["phase_rad"])
        changed[:, self.j] = own * (1.0 + self.p["share"] * wave)
        return changed
