"""Diagnose a log with a robot: the one path behind the command line and the service."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq.recording import Recording
from identify.diagnosis.diagnose import DiagnoseOptions, diagnose
from identify.diagnosis.findings import Diagnosis
from identify.fit import Fit, FitOptions, fit
from service.against import against_estimate, suitable
from service.against_simulation import against_simulation
from service.datasets import dataset_of, open_recording
from service.diagnosis_file import diagnosis_content
from service.estimate_reading import Estimate, read_estimate
from service.held_out_checks import proven_only
from service.identification import robot_for, same_robot
from service.robots import LoadedRobot
from service.saturation import without_saturation

_MCAP = b"\x89MCAP"


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis with what it was made from.

    Attributes:
        loaded: the robot.
        recordings: the run, then the held-out recording where there is one.
        fit: the baseline.
        diagnosis: the diagnosis.
        content: ``diagnosis.json``.
    """

    loaded: LoadedRobot
    recordings: list[Recording]
    fit: Fit
    diagnosis: Diagnosis
    content: dict[str, Any]


def diagnose_log(
    path: str | Path,
    robot: str | None,
    validate_path: str | Path | None = None,
    fit_options: FitOptions | None = None,
    options: DiagnoseOptions | None = None,
    against: str | Path | None = None,
) -> Diagnosed:
    """Diagnose a log.

    Args:
        path: the run.
        robot: preset name or path of the robot file; None takes the log's own.
        validate_path: a recording that is not to be used in the fit.
        fit_options: how to fit the baseline.
        options: effects and levels.
        against: an earlier estimate (JSON), or a simulator's log (MCAP).

    Returns:
        The diagnosis.
    """
    recordings = [open_recording(path)]
    loaded = robot_for(recordings[0], robot)
    if validate_path is not None:
        recordings.append(open_recording(validate_path))
        same_robot(*recordings)
    cleaned = [without_saturation(recording) for recording in recordings]
    clipped = tuple(warning for _, warnings in cleaned for warning in warnings)
    data = dataset_of(cleaned[0][0], loaded)
    reference = None if against is None else _reference(against)
    if isinstance(reference, Estimate):
        fit_options = suitable(reference, loaded, fit_options or FitOptions(), data.wrench is not None)
    elif reference is not None:
        same_robot(recordings[0], reference)
    baseline = fit(loaded.robot, data, fit_options)
    other = dataset_of(cleaned[1][0], loaded) if len(recordings) > 1 else None
    found, strange = proven_only(diagnose(baseline, other, options), baseline, other)
    found, compared = _compared(found, baseline, loaded, reference)
    content = diagnosis_content(found, baseline, loaded, recordings)
    content["warnings"] = [*clipped, *(item.sentence for item in strange), *content["warnings"]]
    content["fit"]["validation"]["rejected"] = [{"kind": item.kind, "sentence": item.sentence} for item in strange]
    content["against"] = compared
    return Diagnosed(loaded, recordings, baseline, found, content)


def _reference(path: str | Path) -> Estimate | Recording:
    """Read what to compare with: a log by its first bytes, else an estimate."""
    try:
        with open(path, "rb") as stream:
            is_log = stream.read(len(_MCAP)) == _MCAP
    except OSError:
        is_log = False  # the reader of estimates says what is wrong with the path
    return open_recording(path) if is_log else read_estimate(path)


def _compared(
    found: Diagnosis, baseline: Fit, loaded: LoadedRobot, reference: Estimate | Recording | None
) -> tuple[Diagnosis, dict[str, Any] | None]:
    if reference is None:
        return found, None
    if isinstance(reference, Estimate):
        return against_estimate(found, baseline, loaded, reference)
    return found, against_simulation(found, baseline, loaded, reference)
