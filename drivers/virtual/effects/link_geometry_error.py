"""A link that is longer than the robot file says."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np

from drivers.virtual.effects.effect import Effect, Range
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.urdf_tree import read_tree


class LinkGeometryError(Effect):
    """The joint's origin on its parent lies off by a length along axis 0, 1 or 2 of the parent's frame."""

    name = "link_geometry_error"
    where = "B"
    size = "length_m"

    @classmethod
    def ranges(cls, plant: PlantSpec, j: int) -> dict[str, Range]:
        """Parameters and their default ranges; the direction along the link itself."""
        origin = np.abs(read_tree(plant.urdf_text).joint(plant.joints[j].name).xyz_m)
        along = int(np.argmax(origin))
        return {
            "length_m": Range(1e-3, 2e-2, "m", signed=True),
            "axis": Range(along, along, "index", integer=True),
        }

    def alter(self, plant: PlantSpec) -> PlantSpec:
        """The plant with its true geometry."""
        robot = ElementTree.fromstring(plant.urdf_text)
        for element in robot.findall("joint"):
            if element.get("name") != self.spec.joint:
                continue
            origin = element.find("origin")
            if origin is None:
                origin = ElementTree.SubElement(element, "origin")
            xyz_m = [float(word) for word in origin.get("xyz", "0 0 0").split()]
            xyz_m[int(self.p["axis"])] += self.p["length_m"]
            origin.set("xyz", " ".join(repr(value) for value in xyz_m))
        return plant.model_copy(update={"urdf_text": ElementTree.tostring(robot, encoding="unicode")})
