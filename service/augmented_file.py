"""The augmented estimate: an estimate with the named effects in it, as ``diagnosis.json`` carries it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from daq.recording import Recording
from identify.diagnosis.augmented import Addition, Augmented
from identify.diagnosis.augmented_fit import augmented_fit
from identify.diagnosis.between import Progress
from identify.diagnosis.findings import Diagnosis
from identify.fit import Fit
from identify.physics.effect import Place
from identify.robot import WRENCH_CHANNELS, Robot
from service.estimate_file import estimate_content
from service.robots import LoadedRobot


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _place(place: Place, robot: Robot) -> dict[str, Any]:
    def name(index: int | None) -> str | None:
        return None if index is None else robot.joints[index].name

    return {"joint": name(place.joint), "channel": place.channel, "partner": name(place.partner)}


def _units(units: Iterable[tuple[str, str]], place: Place, robot: Robot) -> dict[str, str]:
    sliding = place.joint is not None and robot.joints[place.joint].prismatic
    return {name: unit.replace("N.m", "N").replace("rad", "m") if sliding else unit for name, unit in units}


def _addition(item: Addition, robot: Robot) -> dict[str, Any]:
    names = [c.name for c in item.effect.coefficients]
    units = [(c.name, c.unit) for c in item.effect.coefficients] + [
        (s.name, s.unit) for s in item.effect.shapes
    ]
    return {
        "effect": item.effect.name,
        **_place(item.place, robot),
        "coefficients": {name: float(value) for name, value in zip(names, item.values, strict=True)},
        "std": {name: _number(float(value)) for name, value in zip(names, item.value_std, strict=True)},
        "shape": {name: float(value) for name, value in item.shape.items()},
        "shape_std": {name: _number(value) for name, value in item.shape_std.items()},
        "units": _units(units, item.place, robot),
        "delta_chi2": _number(item.delta_chi2),
        "course": None,
    }


def _progress(item: Progress, fit: Fit) -> dict[str, Any]:
    assert fit.window is not None
    robot, dying = fit.model.robot, item.effect.settling is not None
    named = _starts(item) if dying else [(c.name, c.unit) for c in item.effect.coefficients]
    names, per = [name for name, _ in named], "/s" if item.course == "ramp" else ""
    return {
        "effect": item.effect.name,
        **_place(item.place, robot),
        "coefficients": {name: float(value) for name, value in zip(names, item.values, strict=True)},
        "std": {name: _number(float(value)) for name, value in zip(names, item.std, strict=True)},
        "shape": {s.name: s.grid[len(s.grid) // 2] for s in item.effect.shapes},
        "shape_std": {s.name: None for s in item.effect.shapes},
        "units": _units([(name, unit + per) for name, unit in named], item.place, robot),
        "delta_chi2": _number(item.gain),
        "course": {
            "kind": "dying_out" if dying else item.course,
            "time_constant_s": _number(item.time_constant_s),
            "start_s": float(fit.window.start_s),
            "span_s": float(fit.window.stop_s - fit.window.start_s),
        },
    }


def _starts(item: Progress) -> list[tuple[str, str]]:
    """What stood at the start and dies out: one amount a wrench channel, or one a column."""
    if len(item.values) == len(WRENCH_CHANNELS):
        return [(f"start.{channel}", "N" if channel.startswith("force") else "N.m") for channel in WRENCH_CHANNELS]
    return [(f"start_{k + 1}", "") for k in range(len(item.values))]


def _rms(diagnosis: Diagnosis) -> dict[str, Any]:
    held = diagnosis.held_out
    return {
        "training": {channel: _number(value) for channel, value in diagnosis.training.after.items()},
        "validation": {}
        if held is None
        else {channel: _number(gain.after) for channel, gain in held.channels.items()},
    }


def augmented_content(
    diagnosis: Diagnosis, fit: Fit, loaded: LoadedRobot, recording: Recording, estimator: str = "markov"
) -> dict[str, Any]:
    """Arrange the joint fit of a diagnosis like ``estimate.json``, with its effects.

    Args:
        diagnosis: the diagnosis.
        fit: the baseline it started from.
        loaded: the robot.
        recording: the run.
        estimator: of the baseline.

    Returns:
        A JSON object: an estimate, ``effects``, and the ``joint_covariance`` of parameters, torque constants and
        the effects' parameters. What changes over the run stands in ``effects`` with its ``course``.
    """
    augmented, progress = diagnosis.model["augmented"], diagnosis.model["progress"]
    assert isinstance(augmented, Augmented)
    joint = augmented_fit(fit, augmented, diagnosis.unexplained is None)
    content = estimate_content(joint.fit, loaded, recording, estimator)
    content["rms"] = _rms(diagnosis)
    content.pop(
        "relative_error_percent", None
    )  # of the parameters alone: says nothing of the augmented model
    content["warnings"] = [*recording.warnings, *diagnosis.warnings]
    content["effects"] = [_addition(item, fit.model.robot) for item in joint.additions]
    content["effects"] += [_progress(item, fit) for item in progress]  # type: ignore[attr-defined]
    content["joint_covariance"] = {
        "order": list(joint.order),
        "matrix": [[_number(value) for value in row] for row in joint.covariance.tolist()],
    }
    return content
