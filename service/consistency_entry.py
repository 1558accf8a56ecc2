"""The members of ``estimate.json`` about physical consistency."""

from __future__ import annotations

from typing import Any

import numpy as np

from identify.consistency import CONFIDENCE, Consistency, check_consistency
from identify.fit import Fit
from identify.model import Model
from identify.rotations import FloatArray


def check_fit(fit: Fit) -> Consistency:
    """Check a fit's physical consistency."""
    constants = np.array([np.nan if k.value is None else k.value for k in fit.torque_constants])
    return check_consistency(fit.model, fit.theta, fit.covariance, constants)


def consistency_entry(found: Consistency) -> dict[str, Any]:
    """Arrange the verdict.

    Args:
        found: the verdict.

    Returns:
        The member ``consistency``.
    """
    return {
        "consistent": found.consistent,
        "within_uncertainty": found.within_uncertainty,
        "distance": found.distance,
        "limit": found.limit if np.isfinite(found.limit) else None,
        "confidence": CONFIDENCE,
        "violations": list(found.violations),
        "sentence": found.sentence,
    }


def projection_entry(model: Model, found: Consistency) -> dict[str, Any]:
    """Arrange the nearest consistent parameters; the estimate itself stays as the data gave it.

    Args:
        model: the model of the estimate.
        found: the verdict.

    Returns:
        The members ``projected`` and ``projection`` (the statement in words).
    """
    names = [parameter.name for parameter in model.parameters]
    names += [f"{joint}.torque_constant" for joint in model.robot.joint_names]
    values: FloatArray = np.concatenate([found.projected, found.projected_constants])
    projected = [
        {"name": name, "value": float(value), "shift": float(shift)}
        for name, value, shift in zip(names, values, found.shift, strict=True)
        if np.isfinite(value)
    ]
    return {"projected": projected, "projection": _statement(found)}


def _statement(found: Consistency) -> str:
    if found.consistent:
        return "The estimate is physically consistent as it is: the projection changes nothing."
    return (
        "The projected parameters are the physically consistent ones nearest to the estimate in the metric "
        f"of its covariance, {found.distance:.3g} std away; 'shift' is in std of each parameter. They are not"
        " what the data say best, and the covariance given is that of the estimate, not of the projection."
    )
