"""Jobs: queued in the database, claimed by a worker slot, finished with their result in one transaction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.audit import announce
from service.refusals import NotFound
from service.states import advance
from service.store.base import now
from service.store.work import Job


def queue_job(session: Session, kind: str, subject_id: str, serial: str, by: str) -> Job:
    """Queue a job, in the transaction of the request that asks for it.

    Args:
        session: a writing transaction.
        kind: fit, diagnosis or design.
        subject_id: the fit, diagnosis or excitation it fills.
        serial: the robot.
        by: token name.
    """
    job = Job(kind=kind, subject_id=subject_id, robot_serial=serial, created_by=by)
    session.add(job)
    session.flush()
    announce(session, "job.queued", job.id, job=kind, subject=subject_id)
    return job


def find_job(session: Session, job_id: str) -> Job:
    """Find a job.

    Raises:
        NotFound: no such identifier.
    """
    job = session.get(Job, job_id)
    if job is None:
        raise NotFound(f"There is no job {job_id}", "list the jobs for their identifiers")
    return job


def claim_job(session: Session) -> Job | None:
    """Take the oldest queued job; two slots never get the same one."""
    oldest = select(Job).where(Job.state == "queued").order_by(Job.created_at, Job.id).limit(1)
    job = session.scalars(oldest.with_for_update(skip_locked=True)).first()
    if job is not None:
        job.attempts, job.started_at, job.progress, job.stage = job.attempts + 1, now(), 0.0, "starting"
        move_job(session, job, "start")
    return job


def move_job(session: Session, job: Job, event: str, fault: Mapping[str, Any] | None = None) -> None:
    """Change a job's state by the table, and tell listeners."""
    job.state = advance("job", job.state, event)
    if fault is not None:
        job.error = dict(fault)
    if job.state in ("done", "failed", "cancelled"):
        job.finished_at = now()
    if job.state == "done":
        job.progress, job.stage = 1.0, "done"
    announce(session, f"job.{job.state}", job.id, job=job.kind, subject=job.subject_id, error=job.error)


def cancel_job(session: Session, job_id: str) -> Job:
    """Cancel a queued job at once; ask the worker of a running one to stop.

    Raises:
        WrongState: it is over.
    """
    job = session.scalars(select(Job).where(Job.id == job_id).with_for_update()).first() or find_job(
        session, job_id
    )
    if job.state == "running":
        job.cancel_requested = True
    else:
        move_job(session, job, "cancel")
    return job


def show_progress(session: Session, job_id: str, stage: str, share: float) -> None:
    """Keep how far a running job is."""
    job = find_job(session, job_id)
    if job.state == "running" and (stage, share) != (job.stage, job.progress):
        job.stage, job.progress = stage, share
        announce(session, "job.progress", job.id, stage=stage, progress=share)


def resume_jobs(session: Session, attempts: int) -> list[Job]:
    """After a start: find jobs that a stop of the server cut off, queue them again while attempts are left.

    Args:
        session: a writing transaction.
        attempts: starts allowed a job.

    Returns:
        The jobs found; their state says whether they were queued again.
    """
    found = list(session.scalars(select(Job).where(Job.state == "running").order_by(Job.id)))
    for job in found:
        fault = {
            "code": "interrupted",
            "cause": f"The server stopped during attempt {job.attempts} of this job",
            "remedy": "it starts again by itself" if job.attempts < attempts else "ask for it anew",
        }
        move_job(session, job, "lose", fault)
        if job.attempts < attempts:
            job.stage = f"waiting for a worker, interrupted {job.attempts} times"
            move_job(session, job, "requeue")
        else:
            job.finished_at = now()
    return found
