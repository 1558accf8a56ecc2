"""Any robot description with inertials becomes a virtual robot."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from drivers.virtual.errors import PlantError
from drivers.virtual.plant_file import JointPlant, NoiseSpec, PlantSpec, PlateSpec
from drivers.virtual.rigid import RigidPlant
from drivers.virtual.urdf_tree import MOVING, read_tree

# Friction where nobody knows it: the reference robot's shares of its effort limit (the reference robot).
_COULOMB_SHARE = 0.06
_VISCOUS_SHARE = 0.05
_NOISE_SHARE = 0.006
_UNKNOWN_EFFORT_NM = 100.0


def plant_from_urdf(
    name: str, urdf_text: str, joints: Sequence[JointPlant] | None = None, **fields: Any
) -> PlantSpec:
    """Make a plant of a URDF's own inertials.

    Args:
        name: name of the plant.
        urdf_text: the URDF; every moving link needs inertials.
        joints: drive and friction data; from the effort limits, without gears, where not given.
        fields: any other field of `PlantSpec`.

    Raises:
        PlantError: The URDF lacks inertials, or the data contradict it.
    """
    chosen = tuple(joints) if joints is not None else _guessed_joints(urdf_text)
    if "noise" not in fields:
        noise_nm = tuple(_NOISE_SHARE / _COULOMB_SHARE * max(joint.coulomb_nm, 1e-3) for joint in chosen)
        fields["noise"] = NoiseSpec(joint_torque_nm=noise_nm)
    try:
        spec = PlantSpec(name=name, urdf_text=urdf_text, joints=chosen, **fields)
    except ValidationError as error:
        raise PlantError(f"The plant {name} is not valid: {error.errors()[0]['msg']}.") from None
    RigidPlant(spec)  # refuses at once what cannot be simulated
    return spec


def plant_from_robot_file(path: str | Path, **fields: Any) -> PlantSpec:
    """Make a plant of a `robot.toml` and the URDF it names, whose inertials become the truth.

    Raises:
        PlantError: The file cannot be read or its URDF lacks inertials.
    """
    place = Path(path)
    try:
        table = tomllib.loads(place.read_text(encoding="utf-8"))
        urdf_text = (place.parent / table["urdf"]).read_text(encoding="utf-8")
        name, entries = table["name"], table["joint"]
    except (OSError, KeyError, tomllib.TOMLDecodeError) as error:
        raise PlantError(f"Cannot make a plant of the robot file {place}: {error}.") from None
    guesses = {joint.name: joint for joint in _guessed_joints(urdf_text)}
    joints = tuple(_joint(entry, guesses) for entry in entries)
    plate = table.get("force_plate")
    fields.setdefault("plate", None if plate is None else _plate(plate))
    fields.setdefault("gravity_m_s2", tuple(table.get("gravity", (0.0, 0.0, -9.81))))
    if any("coupling" in entry for entry in entries) or "coupling" in table:
        fields.setdefault("coupling", table.get("coupling"))
    return plant_from_urdf(name, urdf_text, joints, **fields)


def _plate(table: dict[str, Any]) -> PlateSpec:
    zero = (0.0, 0.0, 0.0)
    return PlateSpec(xyz_m=tuple(table.get("xyz", zero)), rpy_rad=tuple(table.get("rpy", zero)))


def _joint(entry: dict[str, Any], guesses: dict[str, JointPlant]) -> JointPlant:
    if entry["name"] not in guesses:
        raise PlantError(f"The robot file's joint {entry['name']} is not in its URDF.")
    known = {
        "gear_ratio": entry.get("gear_ratio"),
        "torque_constant_nm_a": entry.get("torque_constant"),
        "rotor_inertia_kg_m2": entry.get("rotor_inertia"),
        "rotor_link": entry.get("rotor_link"),
        "rotor_axis": entry.get("rotor_axis"),
    }
    return guesses[entry["name"]].model_copy(update={k: v for k, v in known.items() if v is not None})


def _guessed_joints(urdf_text: str) -> tuple[JointPlant, ...]:
    tree = read_tree(urdf_text)
    joints = []
    for joint in tree.joints:
        if joint.kind not in MOVING:
            continue
        effort_nm = joint.effort or _UNKNOWN_EFFORT_NM
        viscous_nm_s = _VISCOUS_SHARE * effort_nm / max(joint.velocity, 0.1)
        joints.append(
            JointPlant(name=joint.name, coulomb_nm=_COULOMB_SHARE * effort_nm, viscous_nm_s=viscous_nm_s)
        )
    return tuple(joints)
