"""What a design reads besides the robot: an estimate's noise and values, obstacles, names of effects."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from identify.excitation.workspace import (
    Box,
    Sphere,
    Workspace,
    always_meeting,
    box_around_plate,
    distant_pairs,
    urdf_spheres,
)
from service.errors import UsageError
from service.files import read_json
from service.robot_file import NotNegative, Positive, Vector3, first_fault
from service.robots import LoadedRobot


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class SphereSection(_Section):
    """A ball on a link of the URDF."""

    link: str
    center: Vector3 = (0.0, 0.0, 0.0)
    radius: NotNegative = 0.0


class BoxSection(_Section):
    """An obstacle along the base frame's axes."""

    lower: Vector3
    upper: Vector3
    name: str = "a box"


class WorkspaceFile(_Section):
    """The workspace file: where the robot may not be."""

    floor: float | None = None
    margin: NotNegative = 0.01
    plate_size: tuple[Positive, Positive, Positive] | None = None
    self_collision: bool = True
    sphere: Annotated[tuple[SphereSection, ...], Field(default_factory=tuple)]
    box: Annotated[tuple[BoxSection, ...], Field(default_factory=tuple)]


def _read_workspace(path: Path) -> WorkspaceFile:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(
            f"The workspace file {path} cannot be read: {error.strerror}; check the path."
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"The workspace file {path} is not valid TOML: {error}.") from error
    try:
        return WorkspaceFile.model_validate(content)
    except ValidationError as error:
        raise UsageError(first_fault(error, WorkspaceFile, f"Workspace file {path}")) from error


def robot_workspace(loaded: LoadedRobot, path: Path | None) -> Workspace:
    """Collect bodies and obstacles: collision spheres of the URDF, and a workspace file.

    Args:
        loaded: the robot.
        path: the workspace file, None for the URDF's spheres alone.

    Returns:
        The workspace; empty where neither says anything.

    Raises:
        UsageError: the file is wrong.
    """
    file = WorkspaceFile(sphere=(), box=()) if path is None else _read_workspace(path)
    chain = loaded.chain
    spheres = list(urdf_spheres(loaded.urdf_text, chain))
    for section in file.sphere:
        if section.link not in chain.link_of:
            raise UsageError(
                f"Workspace file {path}: link '{section.link}' is not in the URDF, which has: "
                f"{', '.join(chain.link_of)}."
            )
        rotation, translation = chain.pose_of[section.link]
        center = translation + rotation @ np.array(section.center)
        spheres.append(Sphere(chain.link_of[section.link], center, section.radius, section.link))
    boxes = [Box(np.minimum(b.lower, b.upper), np.maximum(b.lower, b.upper), b.name) for b in file.box]
    plate = box_around_plate(loaded.robot, file.plate_size) if file.plate_size else None
    if plate is not None:
        boxes.append(plate)
    pairs = distant_pairs(tuple(spheres)) if file.self_collision else ()
    pairs = tuple(pair for pair in pairs if pair not in always_meeting(loaded.robot, tuple(spheres), pairs))
    return Workspace(tuple(spheres), file.floor, tuple(boxes), pairs, file.margin)


def estimate_noise(path: Path) -> dict[str, float]:
    """Read the noise levels of an estimate."""
    content = read_json(path, "the estimate")
    noise = content.get("noise")
    if not isinstance(noise, dict) or not noise:
        raise UsageError(
            f"The estimate {path} holds no noise levels; give an estimate.json of residuum identify."
        )
    return {name: float(level) for name, level in noise.items() if level is not None and float(level) > 0.0}


def estimate_values(path: Path) -> dict[str, float]:
    """Read the parameter values of an estimate."""
    content = read_json(path, "the estimate")
    try:
        return {p["name"]: float(p["value"]) for p in content["parameters"] if p["value"] is not None}
    except (KeyError, TypeError, ValueError) as error:
        raise UsageError(
            f"The estimate {path} holds no parameters; give an estimate.json of residuum identify."
        ) from error
