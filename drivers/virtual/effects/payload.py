"""A load at the last link that nobody told the model of."""

from __future__ import annotations

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.effects.scales import moving_links, moving_mass_kg, tip
from drivers.virtual.plant_file import LinkInertial, PlantSpec


class Payload(Effect):
    """A solid ball of lead fixed beyond the last link's centre of mass."""

    name = "payload"
    where = "B"
    place = "none"
    size = "mass_kg"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        mass_kg = moving_mass_kg(plant)
        return {"mass_kg": Range(0.005 * mass_kg, 0.08 * mass_kg, "kg"), "radius_m": Range(0.05, 0.05, "m")}

    def alter(self, plant: PlantSpec) -> PlantSpec:
        """The plant with the load on its last link."""
        link = moving_links(plant)[-1]
        mass_kg, place = self.p["mass_kg"], tip(plant)[1]
        total_kg = link.mass_kg + mass_kg
        centre = (link.mass_kg * np.array(link.com_m) + mass_kg * place) / total_kg
        own = _about(link.mass_kg, np.array(link.com_m) - centre)
        load = _about(mass_kg, place - centre)
        ball = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) * 0.4 * mass_kg * self.p["radius_m"] ** 2
        inertia = tuple(float(x) for x in np.array(link.inertia_kg_m2) + own + load + ball)
        loaded = LinkInertial(
            name=link.name, mass_kg=total_kg, com_m=tuple(centre.tolist()), inertia_kg_m2=inertia
        )
        links = (*(other for other in plant.links if other.name != link.name), loaded)
        return plant.model_copy(update={"links": links})


def _about(mass_kg: float, arm: np.ndarray) -> np.ndarray:
    """Inertia (6,) xx, yy, zz, xy, xz, yz of a point mass at `arm` (3,)."""
    x, y, z = arm
    squares = np.array([y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])
    return np.asarray(mass_kg * squares)
