"""The air's resistance against a turning link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import viscous_nm_s
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import OutsideForce
from drivers.virtual.servo import Moments
from drivers.virtual.urdf_tree import read_tree


@dataclass(frozen=True)
class _Drag:
    link: str
    point_m: np.ndarray
    axis: np.ndarray
    torque_nm: np.ndarray

    def __call__(self, index: int, position_m: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(3), self.torque_nm[index] * (axes @ self.axis)


class AirDrag(Effect):
    """A torque -c qd |qd| from the world on the joint's link, which the plate feels too."""

    name = "air_drag"
    where = "B"
    size = "coefficient_nm_s2"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        scale = viscous_nm_s(plant, j)
        return {"coefficient_nm_s2": Range(0.05 * scale, 0.6 * scale, "N.m.s2/rad2")}

    def outside(self, moments: Moments) -> Sequence[OutsideForce]:
        """The air's torque at every moment."""
        joint = read_tree(self.plant_spec.urdf_text).joint(self.plant_spec.joints[self.j].name)
        speed = moments.qd[:, self.j]
        torque_nm = -self.p["coefficient_nm_s2"] * speed * np.abs(speed)
        return (_Drag(joint.child, np.zeros(3), joint.axis, torque_nm),)
