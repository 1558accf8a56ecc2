"""``estimate.json`` read back: the robot it describes, its model and its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.consistency import Consistency, check_consistency
from identify.model import Model, build_model
from service.errors import UsageError
from service.estimate_file import SCHEMA_VERSION
from service.files import read_json
from service.robots import LoadedRobot, build_robot

FloatArray = np.ndarray


@dataclass(frozen=True)
class Estimate:
    """An estimate with the model that gives its numbers their meaning.

    Attributes:
        source: the file.
        content: the file's content.
        loaded: the robot it describes.
        model: the model of its kind.
        theta: parameters, nan where not identifiable, shape (P,).
        covariance: of (parameters, torque constants), nan where not identifiable, shape (P + n, P + n).
        torque_constants: [N.m/A], nan where there is none, shape (n,).
    """

    source: str
    content: dict[str, Any]
    loaded: LoadedRobot
    model: Model
    theta: FloatArray
    covariance: FloatArray
    torque_constants: FloatArray

    @property
    def simulated(self) -> bool:
        """Whether it comes from simulated data."""
        return bool(self.content.get("simulated", False))

    def consistency(self) -> Consistency:
        """Check its physical consistency."""
        return check_consistency(self.model, self.theta, self.covariance, self.torque_constants)


def _array(values: Any, shape: tuple[int, ...], what: str, source: str) -> FloatArray:
    try:
        result = np.array(values, dtype=float)  # None becomes nan
    except (TypeError, ValueError) as error:
        raise UsageError(f"Estimate {source}: {what} holds something that is no number: {error}.") from error
    if result.shape != shape:
        raise UsageError(
            f"Estimate {source}: {what} has shape {result.shape}, but its model has {shape}; "
            "identify the run again with this version."
        )
    return result


def read_estimate(path: Path | str) -> Estimate:
    """Read an estimate and rebuild its model.

    Args:
        path: ``estimate.json``, or ``diagnosis.json`` for the augmented estimate in it.

    Returns:
        The estimate.

    Raises:
        UsageError: missing or malformed, or not of the model its robot description gives.
    """
    content, source = read_json(path, "the estimate"), str(path)
    if isinstance(content.get("estimate"), dict):
        content = content["estimate"]
    if content.get("schema_version") != SCHEMA_VERSION:
        raise UsageError(
            f"Estimate {source} has schema_version {content.get('schema_version')!r}, but this version reads "
            f"{SCHEMA_VERSION}; identify the run again."
        )
    try:
        description, parameters = content["description"], content["parameters"]
        toml_text, urdf_text = description["robot_toml"], description["urdf"]
        names, values = [p["name"] for p in parameters], [p["value"] for p in parameters]
        constants, covariance = [k["value"] for k in content["torque_constants"]], content["covariance"]
        kind = content["model"]
    except (KeyError, TypeError) as error:
        raise UsageError(
            f"Estimate {source} lacks {error}; give a file that residuum identify wrote."
        ) from error
    loaded = build_robot(toml_text, urdf_text, f"{source} (description)")
    model = build_model(loaded.robot, kind)
    if names != [parameter.name for parameter in model.parameters]:
        raise UsageError(
            f"Estimate {source}: its parameters are not those of the {kind} model of robot '{loaded.name}' "
            "that it describes; identify the run again with this version."
        )
    size, n = len(names), loaded.robot.n
    return Estimate(
        source,
        content,
        loaded,
        model,
        _array(values, (size,), "'parameters'", source),
        _array(covariance, (size + n, size + n), "'covariance'", source),
        _array(constants, (n,), "'torque_constants'", source),
    )
