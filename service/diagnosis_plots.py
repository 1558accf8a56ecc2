"""What a report draws, as numbers in ``diagnosis.json``: a curve for each effect, and the map of the misfit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from identify.diagnosis.adequacy import Structure, examine, variables_of
from identify.diagnosis.augmented import Augmented
from identify.diagnosis.curves import finding_curves
from identify.diagnosis.findings import Diagnosis
from identify.diagnosis.problem import Problem

_REGIONS = 12  # of the map, alike in samples


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


def _scores(problem: Problem, item: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Middle of every region of a state, and the whitened residual summed there over its std."""
    channel, variable = item.channel, item.variable
    index = next(k for k, block in enumerate(problem.blocks) if channel in block.channels)
    block = problem.blocks[index]
    states = variables_of(problem.scenes[index])
    if variable not in states:  # a curve that is no plain mean over regions of a state
        return item.centres, np.divide(item.curve, item.band, out=np.zeros_like(item.curve), where=item.band > 0)
    values = states[variable]
    if problem.fit.thinning is not None:
        values = problem.fit.thinning.pick(values)
    used = np.flatnonzero(block.usable[block.channels.index(channel)])
    rest = problem.residual[problem.channel_slices[channel]]
    groups = np.array_split(used[np.argsort(values[used], kind="stable")], _REGIONS)
    sigma = [rest[g].sum() / math.sqrt(max(len(g), 1)) for g in groups]
    return np.array([values[g].mean() if len(g) else np.nan for g in groups]), np.array(sigma)


def map_entries(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Where the baseline misfits: per channel and state the residual in std of the noise, region by region."""
    problem = diagnosis.model["problem"]
    assert isinstance(problem, Problem)
    found = examine(problem, problem.basis, problem.residual)
    result = []
    for item in found.structures:
        if item.variable == "time" or len(item.centres) == 0:
            continue
        centres, sigma = _scores(problem, item)
        result.append(
            {
                "channel": item.channel,
                "variable": item.variable,
                "p_value": item.p_value,
                "excess": float((item.gain - item.width) / math.sqrt(2.0 * max(item.width, 1))),
                "centres": _numbers(centres),
                "sigma": _numbers(sigma),
            }
        )
    return result
