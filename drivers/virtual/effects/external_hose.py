"""A hose from the ceiling that pulls at the last link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import tip
from drivers.virtual.history import History
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import OutsideForce, RigidPlant
from drivers.virtual.servo import Moments


@dataclass(frozen=True)
class _Pull:
    link: str
    point_m: np.ndarray
    stiffness_n_m: float
    anchor_m: np.ndarray

    def __call__(self, index: int, position_m: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.stiffness_n_m * (self.anchor_m - position_m), np.zeros(3)


class ExternalHose(Effect):
    """One force f = -K (p - p0) + T0 explains both models; T0 = K times the anchor's distance."""

    name = "external_hose"
    where = "B"
    place = "none"
    size = "stiffness_n_m"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges; the anchor relative to the tip at zero pose."""
        scale_n_m = plant.noise.wrench[0] or 1.0  # a pull of the noise's size per metre
        return {
            "stiffness_n_m": Range(0.5 * scale_n_m, 10.0 * scale_n_m, "N/m"),
            "anchor_x_m": Range(-0.5, 0.5, "m"),
            "anchor_y_m": Range(-0.5, 0.5, "m"),
            "anchor_z_m": Range(0.2, 0.8, "m"),
        }

    def begin(self, step_s: float, history: History, rigid: RigidPlant) -> None:
        """Find where the hose hangs."""
        link, point_m = tip(self.plant_spec)
        home = rigid.point(np.zeros(self.width), link, point_m)
        anchor = home + np.array([self.p[f"anchor_{axis}_m"] for axis in "xyz"])
        self._pull = _Pull(link, point_m, self.p["stiffness_n_m"], anchor)

    def outside(self, moments: Moments) -> Sequence[OutsideForce]:
        """The hose's pull."""
        return (self._pull,)
