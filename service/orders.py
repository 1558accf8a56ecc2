"""Requests to compute: each becomes a row and a job, then an order, then a result."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from service.archive import Archive
from service.files import write_text
from service.jobs import queue_job
from service.refusals import Conflict, NotFound, Unusable
from service.registry import model_of, robot_row
from service.store.assets import Excitation, Recording
from service.store.base import new_id
from service.store.results import Diagnosis, Estimate, Fit
from service.store.work import Job


def find_recording(session: Session, recording_id: str) -> Recording:
    """Find a recording.

    Raises:
        NotFound: no such identifier.
    """
    row = session.get(Recording, recording_id)
    if row is None:
        raise NotFound(
            f"There is no recording {recording_id}", "upload it, or list the recordings for their identifiers"
        )
    return row


def order_analysis(
    session: Session,
    kind: str,
    recording_id: str,
    validation_id: str | None,
    options: dict[str, Any],
    by: str,
) -> Fit | Diagnosis:
    """Ask for a fit or a diagnosis of a recording.

    Args:
        session: a writing transaction.
        kind: fit or diagnosis.
        recording_id: what to identify.
        validation_id: held-out recording of the same robot, or None.
        options: of the fit.
        by: token name.

    Returns:
        The row, with its queued job.
    """
    recording = find_recording(session, recording_id)
    if (
        validation_id is not None
        and find_recording(session, validation_id).robot_serial != recording.robot_serial
    ):
        raise Unusable("The validation recording is of another robot", "name one of the same robot")
    if validation_id == recording_id:
        raise Unusable("A recording cannot validate its own fit", "name another recording, or none")
    subject = new_id()
    job = queue_job(session, kind, subject, recording.robot_serial, by)
    table = Fit if kind == "fit" else Diagnosis
    row = table(
        id=subject,
        job_id=job.id,
        robot_serial=recording.robot_serial,
        recording_id=recording_id,
        validation_id=validation_id,
        options=options,
    )
    session.add(row)
    session.flush()
    return row


def order_design(session: Session, serial: str, options: dict[str, Any], by: str) -> Excitation:
    """Ask for an excitation of a robot."""
    robot = robot_row(session, serial)
    subject = new_id()
    job = queue_job(session, "design", subject, serial, by)
    row = Excitation(
        id=subject, job_id=job.id, robot_serial=serial, model_hash=robot.model_hash, options=options
    )
    session.add(row)
    session.flush()
    return row


def order_for(session: Session, job: Job, archive: Archive) -> dict[str, Any]:
    """Gather what a worker needs for a job.

    Args:
        session: a transaction.
        job: the job.
        archive: where recordings lie.

    Returns:
        Plain values.
    """
    if job.kind == "design":
        excitation = session.get_one(Excitation, job.subject_id)
        return _robot_texts(session, job, excitation.model_hash) | {"options": excitation.options}
    row = session.get_one(Fit if job.kind == "fit" else Diagnosis, job.subject_id)
    recording = find_recording(session, row.recording_id)
    validation = find_recording(session, row.validation_id) if row.validation_id else None
    return _robot_texts(session, job, None) | {
        "options": row.options,
        "recording": str(archive.path_of(recording.sha256)),
        "label": recording.label,
        "validation": str(archive.path_of(validation.sha256)) if validation else None,
        "validation_label": validation.label if validation else None,
    }


def _robot_texts(session: Session, job: Job, model_hash: str | None) -> dict[str, Any]:
    model = model_of(session, job.robot_serial, model_hash)
    return {
        "robot_serial": model.robot_serial,
        "model_hash": model.model_hash,
        "toml_text": model.toml_text,
        "urdf_text": model.urdf_text,
    }


def keep_result(
    session: Session, job: Job, order: dict[str, Any], result: dict[str, Any], reports: Path
) -> None:
    """Keep what a worker found, in the transaction that finishes its job.

    Args:
        session: a writing transaction.
        job: the job.
        order: what the worker was given.
        result: what it returned.
        reports: folder of report pages.
    """
    content = result["content"]
    if job.kind == "design":
        session.get_one(Excitation, job.subject_id).content = content
    elif job.kind == "fit":
        fit = session.get_one(Fit, job.subject_id)
        estimate = Estimate(
            fit_id=fit.id,
            robot_serial=fit.robot_serial,
            recording_id=fit.recording_id,
            model_hash=order["model_hash"],
            simulated=_is_simulated(session, fit, content),
            intervals_valid=bool(content["intervals_valid"]),
            content=content,
        )
        session.add(estimate)
        session.flush()
        fit.estimate_id = estimate.id
    else:
        diagnosis = session.get_one(Diagnosis, job.subject_id)
        write_text(reports / f"{diagnosis.id}.html", result["report"], "the report")
        diagnosis.content, diagnosis.verdict = content, content["verdict"]
        diagnosis.simulated = _is_simulated(session, diagnosis, content)


def _is_simulated(session: Session, row: Fit | Diagnosis, content: dict[str, Any]) -> bool:
    """Simulated if anything it was made from is: marks only ever add up."""
    sources = [find_recording(session, key) for key in (row.recording_id, row.validation_id) if key]
    return bool(content["simulated"]) or any(source.simulated for source in sources)


def refuse_foreign_log(facts: dict[str, Any], robot_name: str) -> None:
    """Refuse a log of another robot.

    Raises:
        Conflict: the log names another robot.
    """
    if facts["robot"] and facts["robot"] != robot_name:
        raise Conflict(
            f"The log is one of robot '{facts['robot']}', not of '{robot_name}'",
            "upload it to the robot it was recorded on",
        )
