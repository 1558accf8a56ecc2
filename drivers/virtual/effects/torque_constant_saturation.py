"""A motor whose iron saturates: torque = K i (1 - beta i^2)."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import coulomb_nm, current_a, joint_inertias
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class TorqueConstantSaturation(Effect):
    """A motor whose iron saturates: torque = K i (1 - beta i^2)."""

    name = "torque_constant_saturation"
    where = "I"
    size = "coefficient_1_a2"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {
            "coefficient_1_a2": Range(0.01 / _peak_a(plant, j) ** 2, 0.04 / _peak_a(plant, j) ** 2, "1/A^2")
        }

    def current(self, moments: Moments, current_a: np.ndarray) -> np.ndarray:
        """Motor currents (n, k) as they become."""
        changed = current_a.copy()
        own = current_a[:, self.j]
        beta, amps = self.p["coefficient_1_a2"], own.copy()
        most = 1.0 / np.sqrt(3.0 * max(beta, 1e-300))  # beyond this more current gives less torque
        for _ in range(8):  # Newton on i (1 - beta i^2) = i0; where the motor cannot give it, its most
            amps -= (amps * (1.0 - beta * amps**2) - own) / np.maximum(1.0 - 3.0 * beta * amps**2, 0.1)
            amps = np.clip(amps, -most, most)
        changed[:, self.j] = amps
        return changed


def _peak_a(plant: PlantSpec, j: int) -> float:
    """Current of a brisk move: twice the Coulomb friction and 3 rad/s2 on the links' inertia."""
    return current_a(plant, j, 2.0 * coulomb_nm(plant, j) + 3.0 * joint_inertias(plant)[j])
