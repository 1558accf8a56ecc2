"""``estimate.json``: what a fit found, in the form other programs read."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any

import numpy as np

from daq.recording import Recording
from identify.fit import Fit
from identify.validation import Validation
from service.robots import LoadedRobot

SCHEMA_VERSION = 1
_UNSEEN = "the motion of this run does not show it separately: its std is infinite"


def _number(value: float) -> float | None:
    """A finite number, or None: JSON has no infinity."""
    return float(value) if math.isfinite(value) else None


def _parameters(fit: Fit) -> list[dict[str, Any]]:
    result = []
    for parameter, value, std in zip(fit.model.parameters, fit.theta, fit.std, strict=True):
        entry: dict[str, Any] = {
            "name": parameter.name,
            "group": parameter.group,
            "value": _number(value),
            "std": _number(std),
            "unit": parameter.unit,
            "definition": dict(parameter.definition),
        }
        if entry["value"] is None:
            entry["reason"] = _UNSEEN
        result.append(entry)
    return result


def _torque_constants(fit: Fit) -> list[dict[str, Any]]:
    result = []
    for constant in fit.torque_constants:
        entry: dict[str, Any] = {
            "joint": constant.joint,
            "value": constant.value,
            "std": constant.std,
            "unit": "N.m/A",
            "nominal": constant.nominal,
        }
        if constant.reason:
            entry["reason"] = constant.reason
        result.append(entry)
    return result


def _covariance(fit: Fit) -> list[list[float | None]]:
    return [[_number(value) for value in row] for row in fit.covariance]


def _rms(fit: Fit, validation: Validation | None) -> dict[str, Any]:
    result: dict[str, Any] = {"training": {key: _number(value) for key, value in fit.residual_rms.items()}}
    result["validation"] = {key: _number(value) for key, value in validation.rms.items()} if validation else {}
    return result


def _provenance(recording: Recording, loaded: LoadedRobot, validation: Recording | None) -> dict[str, Any]:
    result = {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "run": {"path": recording.source, "sha256": recording.sha256, "run_id": recording.metadata.get("run_id")},
        "robot_model_hash": loaded.model_hash,
        "robot_serial": loaded.file.serial,
    }
    if validation is not None:
        result["validation"] = {"path": validation.source, "sha256": validation.sha256}
    return result


def _method(fit: Fit, estimator: str) -> dict[str, Any]:
    result: dict[str, Any] = {"estimator": estimator, "periodic": fit.window is not None}
    if fit.window is not None and fit.trajectory is not None:
        result |= {
            "fundamental_hz": fit.window.fundamental_hz,
            "fundamental_inferred": fit.window.inferred,
            "periods": fit.window.periods,
            "lines": [int(line) for line in fit.trajectory.lines],
            "encoder_noise": {
                joint: float(std) for joint, std in zip(fit.model.robot.joint_names, fit.trajectory.noise_std, strict=True)
            },
        }
    elif fit.motion is not None:
        result["bandwidth_hz"] = fit.motion.bandwidth_hz
    return result


def estimate_content(
    fit: Fit,
    loaded: LoadedRobot,
    recording: Recording,
    estimator: str,
    validation: tuple[Recording, Validation] | None = None,
    extra: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Arrange a fit as the content of ``estimate.json``.

    Args:
        fit: the fit.
        loaded: the robot.
        recording: the log it comes from.
        estimator: which estimator.
        validation: the held-out log and the predictions of it.
        extra: further members, such as the physical consistency.

    Returns:
        A JSON object; what cannot be identified is null, with its reason.
    """
    test = fit.lack_of_fit
    lack: dict[str, Any] = {"chi2": test.chi2, "dof": test.dof, "p": test.p}
    if test.reason:
        lack["reason"] = test.reason
    warnings = [*recording.warnings, *fit.warnings]
    content: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "robot": loaded.name,
        "model": fit.model.kind,
        "simulated": fit.data.simulated or bool(validation and validation[0].metadata.get("simulated", "").lower() == "true"),
        "parameters": _parameters(fit),
        "covariance": _covariance(fit),
        "torque_constants": _torque_constants(fit),
        "counts": dict(fit.model.structure.counts),
        "noise": {key: _number(value) for key, value in fit.noise_std.items()},
        "lack_of_fit": lack,
        "intervals_valid": fit.intervals_valid,
        "warnings": warnings,
        "rms": _rms(fit, validation[1] if validation else None),
        "relative_error_percent": {key: _number(value) for key, value in fit.relative_error.items()},
        "condition_number": _number(fit.solution.condition_number),
        "method": _method(fit, estimator),
        "provenance": _provenance(recording, loaded, validation[0] if validation else None),
        "description": {"robot_toml": loaded.toml_text, "urdf": loaded.urdf_text},
    }
    if validation:
        content["validation"] = _validation(validation[1])
    return content | (extra or {})


def _validation(validation: Validation) -> dict[str, Any]:
    return {
        "bandwidth_hz": validation.bandwidth_hz,
        "notes": list(validation.notes),
        "channels": {
            item.channel: {
                "rms": _number(item.rms),
                "noise": _number(item.noise_std),
                "relative_error_percent": _number(item.relative_error),
                "scored_share": float(np.mean(item.scored)),
            }
            for item in validation.channels
        },
    }
