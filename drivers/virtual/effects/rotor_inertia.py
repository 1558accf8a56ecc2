"""A rotor whose inertia is not the one in the robot file."""

from __future__ import annotations

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.errors import PlantError
from drivers.virtual.plant_file import PlantSpec


class RotorInertia(Effect):
    """The true rotor inertia is (1 + e) times the nominal one: n^2 in the current, n in the plate."""

    name = "rotor_inertia"
    where = "B"
    size = "share"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges."""
        return {"share": Range(0.02, 0.3, "1", signed=True)}

    def alter(self, plant: PlantSpec) -> PlantSpec:
        """The plant with its true rotor."""
        joint = plant.joints[self.j]
        if joint.rotor_inertia_kg_m2 == 0.0:
            raise PlantError(
                f"{joint.name} has no rotor inertia that could be wrong: give it one in the plant."
            )
        true = joint.model_copy(
            update={"rotor_inertia_kg_m2": joint.rotor_inertia_kg_m2 * (1.0 + self.p["share"])}
        )
        joints = (*plant.joints[: self.j], true, *plant.joints[self.j + 1 :])
        return plant.model_copy(update={"joints": joints})
