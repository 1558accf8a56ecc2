"""What a report draws, as numbers in ``diagnosis.json``: a curve for each effect, and the map of the misfit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from identify.diagnosis.adequacy import examine
from identify.diagnosis.augmented import Augmented
from identify.diagnosis.curves import finding_curves
from identify.diagnosis.findings import Diagnosis
from identify.diagnosis.problem import Problem


def _numbers(values: np.ndarray) -> list[float | None]:
    return [float(v) if math.isfinite(v) else None for v in values]


def curve_entries(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Measured residual against the model, for every finding that is part of the joint fit."""
    problem, augmented = diagnosis.model.get("renewed", diagnosis.model["problem"]), diagnosis.model["augmented"]
    assert isinstance(problem, Problem)
    assert isinstance(augmented, Augmented)
    return [
        {
            "finding": curve.index,
            "channel": curve.channel,
            "variable": curve.variable,
            "unit": curve.unit,
            "value_unit": curve.value_unit,
            "x": _numbers(curve.x),
            "measured": _numbers(curve.measured),
            "band": _numbers(curve.band),
            "model": _numbers(curve.model),
            "explains": curve.explains,
        }
        for curve in finding_curves(problem, augmented)
    ]


def map_entries(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Where the baseline misfits: per channel and state the residual in std of the noise, region by region."""
    problem = diagnosis.model["problem"]
    assert isinstance(problem, Problem)
    found = examine(problem, problem.basis, problem.residual)
    result = []
    for item in found.structures:
        if item.variable == "time" or len(item.centres) == 0:
            continue
        sigma = np.divide(item.curve, item.band, out=np.zeros_like(item.curve), where=item.band > 0)
        result.append(
            {
                "channel": item.channel,
                "variable": item.variable,
                "p_value": item.p_value,
                "excess": float((item.gain - item.width) / math.sqrt(2.0 * max(item.width, 1))),
                "centres": _numbers(item.centres),
                "sigma": _numbers(sigma),
            }
        )
    return result
