"""How large things are on one robot: the scales from which default effect sizes follow."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from drivers.virtual.plant_file import LinkInertial, PlantSpec
from drivers.virtual.rigid import RigidPlant
from drivers.virtual.urdf_tree import read_tree

_RUN_S = 160.0  # sixteen periods of ten seconds (Verdonck 2001, section 4)


def coulomb_nm(plant: PlantSpec, j: int) -> float:
    """Coulomb friction of a joint, or a stand-in from its noise where it has none."""
    return plant.joints[j].coulomb_nm or 10.0 * noise_nm(plant, j)


def viscous_nm_s(plant: PlantSpec, j: int) -> float:
    """Viscous friction of a joint, or a stand-in from its Coulomb friction."""
    return plant.joints[j].viscous_nm_s or 0.5 * coulomb_nm(plant, j)


def noise_nm(plant: PlantSpec, j: int) -> float:
    """Torque noise of a joint."""
    noise = plant.noise.joint_torque_nm
    return (noise[j] if noise else 0.0) or 1.0


def current_a(plant: PlantSpec, j: int, torque_nm: float) -> float:
    """Current that makes a joint torque."""
    joint = plant.joints[j]
    return torque_nm / (joint.gear_ratio * joint.torque_constant_nm_a)


def noise_a(plant: PlantSpec, j: int) -> float:
    """Current noise of a joint."""
    return current_a(plant, j, noise_nm(plant, j))


def run_s() -> float:
    """Length of the reference run."""
    return _RUN_S


@lru_cache(maxsize=32)
def joint_inertias(plant: PlantSpec) -> tuple[float, ...]:
    """Inertia each joint sees of its links at the zero pose, without rotors [kg.m2 or kg]."""
    count = len(plant.joints)
    rigid, still = RigidPlant(plant), np.zeros((count + 1, count))
    pull = np.vstack([np.zeros((1, count)), np.eye(count)])
    torque = rigid.inverse(still, still, pull).link_nm
    return tuple(float(x) for x in np.diag(torque[1:] - torque[0]))


@lru_cache(maxsize=32)
def moving_links(plant: PlantSpec) -> tuple[LinkInertial, ...]:
    """Inertials of the links the joints carry, in joint order; the plant's own where it has them."""
    tree = read_tree(plant.urdf_text)
    own = {link.name: link for link in plant.links}
    children = [tree.joint(joint.name).child for joint in plant.joints]
    return tuple(own.get(child) or tree.inertials[child] for child in children)


def moving_mass_kg(plant: PlantSpec) -> float:
    """Mass of all moving links."""
    return sum(link.mass_kg for link in moving_links(plant))


def tip(plant: PlantSpec) -> tuple[str, np.ndarray]:
    """Last link and a point of it (3,) beyond its centre of mass, where a tool would be."""
    link = moving_links(plant)[-1]
    return link.name, 1.5 * np.array(link.com_m)
