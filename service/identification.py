"""Identify a log with a robot: the one path behind the command line and the service."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq.recording import Recording
from identify.fit import Fit, FitOptions, fit
from identify.validation import Validation, validate
from service.consistency_entry import check_fit, consistency_entry, projection_entry
from service.datasets import dataset_of, open_recording
from service.errors import LogError
from service.estimate_file import estimate_content
from service.robots import LoadedRobot, build_robot, load_robot


@dataclass(frozen=True)
class Identification:
    """A fit with what it was made from.

    Attributes:
        loaded: the robot.
        recording: the log.
        fit: the fit.
        validation: held-out log and predictions, or None.
        content: ``estimate.json``.
    """

    loaded: LoadedRobot
    recording: Recording
    fit: Fit
    validation: tuple[Recording, Validation] | None
    content: dict[str, Any]


def robot_for(recording: Recording, name_or_path: str | None) -> LoadedRobot:
    """Load the robot asked for, or the one the log carries along.

    Args:
        recording: the log.
        name_or_path: preset or path; None takes the log's attachment.

    Returns:
        The robot.

    Raises:
        LogError: none is asked for and the log carries none.
    """
    if name_or_path is not None:
        return load_robot(name_or_path)
    attached = recording.attachments
    urdf = next((data for name, data in attached.items() if name.endswith(".urdf")), None)
    if "robot.toml" not in attached or urdf is None:
        raise LogError(f"{recording.source} carries no robot description; name the robot with --robot.")
    return build_robot(attached["robot.toml"].decode(), urdf.decode(), f"{recording.source} (attached robot.toml)")


def same_robot(first: Recording, second: Recording) -> None:
    """Refuse two logs of different robots.

    Args:
        first: the log identified.
        second: the log it is to be compared with.

    Raises:
        LogError: they name different robots.
    """
    names = [recording.metadata.get("robot", "") for recording in (first, second)]
    if all(names) and names[0] != names[1]:
        raise LogError(
            f"{second.source} is a log of robot '{names[1]}', but {first.source} is one of '{names[0]}'; validate with a log of the same robot."
        )


def identify_log(
    path: str | Path,
    robot: str | None,
    options: FitOptions,
    validate_path: str | Path | None = None,
    *,
    project: bool = False,
) -> Identification:
    """Identify a log.

    Args:
        path: the log.
        robot: preset name or path of the robot file; None takes the log's own.
        options: what to fit and how.
        validate_path: a held-out log to predict.
        project: whether to add the nearest physically consistent parameters.

    Returns:
        The identification.

    Raises:
        UsageError, LogError, IdentifyError, DaqError: each with one sentence.
    """
    recording = open_recording(path)
    loaded = robot_for(recording, robot)
    held_out = open_recording(validate_path) if validate_path is not None else None
    if held_out is not None:
        same_robot(recording, held_out)
    result = fit(loaded.robot, dataset_of(recording, loaded), options)
    validation = None
    if held_out is not None:
        validation = (held_out, validate(result, dataset_of(held_out, loaded)))
    consistency = check_fit(result)
    extra = {"consistency": consistency_entry(consistency)}
    if project:
        extra |= projection_entry(result.model, consistency)
    content = estimate_content(result, loaded, recording, options.estimator, validation, extra)
    return Identification(loaded, recording, result, validation, content)
