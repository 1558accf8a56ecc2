"""A gear that does not transmit the angle evenly."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.servo import Moments


class TransmissionError(Effect):
    """The link turns ahead by A sin(m th + phase), th the motor's angle; the plate feels it."""

    name = "transmission_error"
    where = "B"
    size = "amplitude_rad"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        per_rad = 1.0 / max(2.0 * plant.joints[j].gear_ratio, 4.0) ** 2  # rad for 1 rad/s2 at 1 rad/s
        return {
            "amplitude_rad": Range(0.02 * per_rad, 0.5 * per_rad, "rad"),
            "order": Range(2, 2, "1/rev of the motor", integer=True),
            "phase_rad": Range(-np.pi, np.pi, "rad"),
        }

    def deviation(self, moments: Moments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Link minus motor (n, k) and derivatives, by the chain rule."""
        rate = self.p["order"] * self.plant_spec.joints[self.j].gear_ratio
        angle = rate * moments.q[:, self.j] + self.p["phase_rad"]
        speed, pull = rate * moments.qd[:, self.j], rate * moments.qdd[:, self.j]
        sine, cosine = self.p["amplitude_rad"] * np.sin(angle), self.p["amplitude_rad"] * np.cos(angle)
        return self.column(sine), self.column(cosine * speed), self.column(cosine * pull - sine * speed**2)
