"""``diagnosis.json``: what a diagnosis found, in the form other programs read."""

from __future__ import annotations

import math
from typing import Any

from daq.recording import Recording
from identify.diagnosis.findings import Diagnosis, Finding
from identify.fit import Fit
from service.augmented_file import augmented_content
from service.diagnosis_plots import curve_entries, map_entries
from service.robots import LoadedRobot

SCHEMA_VERSION = 1


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _finding(item: Finding) -> dict[str, Any]:
    return {
        "effect": item.effect,
        "joint": item.joint,
        "channel": item.channel,
        "parameters": [
            {"name": p.name, "value": _number(p.value), "std": _number(p.std), "unit": p.unit} for p in item.parameters
        ],
        "p_value": item.p_value,
        "delta_chi2": _number(item.delta_chi2),
        "alternatives": list(item.alternatives),
        "where": {"channels": list(item.where.channels), "region": item.where.region, "lines_hz": list(item.where.lines_hz)},
        "sentence": item.sentence,
    }


def _fit_tables(diagnosis: Diagnosis) -> dict[str, Any]:
    training, held = diagnosis.training, diagnosis.held_out
    result: dict[str, Any] = {
        "training": {key: {c: _number(v) for c, v in getattr(training, key).items()} for key in ("before", "after", "noise")},
        "validation": {"before": {}, "after": {}, "noise": {}},
    }
    if held is not None:
        for channel, gain in held.channels.items():
            for key in ("before", "after", "noise"):
                result["validation"][key][channel] = _number(getattr(gain, key))
        result["validation"]["gain_interval"] = {c: [_number(g.low), _number(g.high)] for c, g in held.channels.items()}
        result["validation"]["notes"] = list(held.notes)
    return result


def _blind_spots(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    result = []
    for spot in diagnosis.blind_spots:
        entry: dict[str, Any] = {
            "effect": spot.effect,
            "smallest_detectable": _number(spot.smallest_detectable),
            "unit": spot.unit,
            "confused_with": list(spot.confused_with),
            "place": spot.place or None,
            "by_place": {key: _number(value) for key, value in spot.by_place.items()},
            "swallowed": _number(spot.swallowed),
        }
        if spot.reason:
            entry["reason"] = spot.reason
        result.append(entry)
    return result


def diagnosis_content(diagnosis: Diagnosis, fit: Fit, loaded: LoadedRobot, recordings: list[Recording]) -> dict[str, Any]:
    """Arrange a diagnosis as the content of ``diagnosis.json``.

    Args:
        diagnosis: the diagnosis.
        fit: the baseline it started from.
        loaded: the robot.
        recordings: the run, then the held-out recording where there is one.

    Returns:
        A JSON object.
    """
    rest = diagnosis.unexplained
    location = diagnosis.location
    simulated = any(recording.metadata.get("simulated", "").lower() == "true" for recording in recordings)
    return {
        "schema_version": SCHEMA_VERSION,
        "robot": loaded.name,
        "simulated": simulated,
        "model": fit.model.kind,
        "verdict": diagnosis.verdict,
        "findings": [_finding(item) for item in diagnosis.findings],
        "unexplained": None
        if rest is None
        else {"channels": list(rest.channels), "depends_on": list(rest.depends_on), "p_value": rest.p_value, "sentence": rest.sentence},
        "blind_spots": _blind_spots(diagnosis),
        "fit": _fit_tables(diagnosis),
        "next_experiment": diagnosis.next_experiment,
        "curves": curve_entries(diagnosis),
        "map": map_entries(diagnosis),
        "estimate": augmented_content(diagnosis, fit, loaded, recordings[0]),
        "location": {
            "internal_p": _number(location.internal_p),
            "external_p": _number(location.external_p),
            "agreement_p": _number(location.agreement_p),
            "verdict": location.verdict,
        },
        "lack_of_fit": {"chi2": fit.lack_of_fit.chi2, "dof": fit.lack_of_fit.dof, "p": fit.lack_of_fit.p, "reason": fit.lack_of_fit.reason or None},
        "structures": [
            {
                "channel": s.channel, "variable": s.variable, "p_value": s.p_value,
                "centres": [_number(v) for v in s.centres], "curve": [_number(v) for v in s.curve], "band": [_number(v) for v in s.band],
            }
            for s in diagnosis.structures[:24]
        ],
        "warnings": [*recordings[0].warnings, *diagnosis.warnings],
        "provenance": {
            "run": {"path": recordings[0].source, "sha256": recordings[0].sha256},
            "validation": {"path": recordings[1].source, "sha256": recordings[1].sha256} if len(recordings) > 1 else None,
            "robot_model_hash": loaded.model_hash,
        },
    }
