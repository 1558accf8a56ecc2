"""Diagnose a log with a robot: the one path behind the command line and the service."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq.recording import Recording
from identify.diagnosis.diagnose import DiagnoseOptions, diagnose
from identify.diagnosis.findings import Diagnosis
from identify.fit import Fit, FitOptions, fit
from service.datasets import dataset_of, open_recording
from service.diagnosis_file import diagnosis_content
from service.identification import robot_for, same_robot
from service.robots import LoadedRobot


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
) -> Diagnosed:
    """Diagnose a log.

    Args:
        path: the run.
        robot: preset name or path of the robot file; None takes the log's own.
        validate_path: a recording that is not to be used in the fit.
        fit_options: how to fit the baseline.
        options: effects and levels.

    Returns:
        The diagnosis.
    """
    recordings = [open_recording(path)]
    loaded = robot_for(recordings[0], robot)
    if validate_path is not None:
        recordings.append(open_recording(validate_path))
        same_robot(*recordings)
    baseline = fit(loaded.robot, dataset_of(recordings[0], loaded), fit_options)
    other = dataset_of(recordings[1], loaded) if len(recordings) > 1 else None
    found = diagnose(baseline, other, options)
    return Diagnosed(loaded, recordings, baseline, found, diagnosis_content(found, baseline, loaded, recordings))
