"""Fits, diagnoses and their jobs."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter
from fastapi.responses import FileResponse, JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from service.audit import note
from service.jobs import cancel_job, find_job
from service.orders import order_analysis
from service.refusals import NotFound, WrongState
from service.rest.call import Reader, Reply, Runner
from service.rest.paging import After, Filter, Key, Limit, Page, page_of
from service.rest.problems import problem_responses
from service.rest.views import DiagnosisView, FitView, Identifier, JobView
from service.store.results import Diagnosis, Fit
from service.store.work import Job

router = APIRouter(responses=problem_responses(401, 403, 422, 429))


class AnalysisRequest(BaseModel):
    """A recording to identify or diagnose."""

    recording_id: Identifier
    validation_id: Identifier | None = Field(None, description="A held-out recording of the same robot.")
    model: Literal["combined", "internal", "external"] | None = Field(
        None, description="The richest the log allows when left out."
    )
    periodic: Literal[False] | None = Field(None, description="False treats the run as non-periodic.")


class FitRequest(AnalysisRequest):
    """A fit to make."""

    estimator: Literal["markov", "ols", "ml"] = "markov"
    nominal_constants: bool = Field(False, description="Take the robot file's torque constants as exact.")
    project: bool = Field(False, description="Add the nearest physically consistent parameters.")


@router.get("/fits", response_model=Page[FitView], tags=["fits"])
def list_fits(
    call: Reader, limit: Limit = 50, after: After = None, robot: Filter = None, recording: Filter = None
) -> Any:
    """List fits, newest first."""
    with call.lab.database.read() as session:
        filters = {Fit.robot_serial: robot, Fit.recording_id: recording}
        return page_of(session, Fit.id, filters, limit, after, lambda row: FitView.of(session, row))


@router.post(
    "/fits", status_code=202, response_model=FitView, responses=problem_responses(404), tags=["fits"]
)
def make_fit(call: Runner, body: FitRequest) -> JSONResponse:
    """Ask for a fit; follow it at the Location. A recording may have many."""

    def act(session: Session) -> Reply:
        options = body.model_dump(exclude={"recording_id", "validation_id"})
        row = order_analysis(session, "fit", body.recording_id, body.validation_id, options, call.caller.name)
        note(session, call.caller.name, "fit.request", row.id, recording=body.recording_id)
        return Reply(202, FitView.of(session, row).json_content(), f"/v1/fits/{row.id}")  # type: ignore[arg-type]

    return call.change(body, act)


@router.get("/fits/{key}", response_model=FitView, responses=problem_responses(404), tags=["fits"])
def show_fit(call: Reader, key: Key) -> Any:
    """Show a fit; its estimate appears when the job is done."""
    with call.lab.database.read() as session:
        row = session.get(Fit, key)
        if row is None:
            raise NotFound(f"There is no fit {key}", "list the fits for their identifiers")
        return FitView.of(session, row)


@router.get("/diagnoses", response_model=Page[DiagnosisView], tags=["diagnoses"])
def list_diagnoses(
    call: Reader,
    limit: Limit = 50,
    after: After = None,
    robot: Filter = None,
    recording: Filter = None,
    verdict: Filter = None,
) -> Any:
    """List diagnoses, newest first."""
    with call.lab.database.read() as session:
        filters = {
            Diagnosis.robot_serial: robot,
            Diagnosis.recording_id: recording,
            Diagnosis.verdict: verdict,
        }
        return page_of(
            session, Diagnosis.id, filters, limit, after, lambda row: DiagnosisView.of(session, row)
        )


@router.post(
    "/diagnoses",
    status_code=202,
    response_model=DiagnosisView,
    responses=problem_responses(404),
    tags=["diagnoses"],
)
def make_diagnosis(call: Runner, body: AnalysisRequest) -> JSONResponse:
    """Ask for a diagnosis; follow it at the Location. A recording may have many."""

    def act(session: Session) -> Reply:
        options = body.model_dump(exclude={"recording_id", "validation_id"})
        row = order_analysis(
            session, "diagnosis", body.recording_id, body.validation_id, options, call.caller.name
        )
        note(session, call.caller.name, "diagnosis.request", row.id, recording=body.recording_id)
        return Reply(202, DiagnosisView.of(session, row).json_content(), f"/v1/diagnoses/{row.id}")  # type: ignore[arg-type]

    return call.change(body, act)


def _diagnosis(session: Session, key: str) -> Diagnosis:
    row = session.get(Diagnosis, key)
    if row is None:
        raise NotFound(f"There is no diagnosis {key}", "list the diagnoses for their identifiers")
    return row


@router.get(
    "/diagnoses/{key}", response_model=DiagnosisView, responses=problem_responses(404), tags=["diagnoses"]
)
def show_diagnosis(call: Reader, key: Key) -> Any:
    """Show a diagnosis in short."""
    with call.lab.database.read() as session:
        return DiagnosisView.of(session, _diagnosis(session, key))


@router.get(
    "/diagnoses/{key}/diagnosis.json",
    response_model=dict[str, Any],
    responses=problem_responses(404, 409),
    tags=["diagnoses"],
)
def show_diagnosis_file(call: Reader, key: Key) -> Any:
    """Give the whole ``diagnosis.json``."""
    with call.lab.database.read() as session:
        content = _diagnosis(session, key).content
    if content is None:
        raise WrongState(
            f"Diagnosis {key} has no content", "wait until its job is done, or look why it is not"
        )
    return JSONResponse(content)


@router.get(
    "/diagnoses/{key}/report",
    response_class=FileResponse,
    responses=problem_responses(404),
    tags=["diagnoses"],
)
def show_report(call: Reader, key: Key) -> Any:
    """Give the report for people: one HTML page that prints."""
    with call.lab.database.read() as session:
        row = _diagnosis(session, key)
    path = call.lab.compute.reports / f"{row.id}.html"
    if not path.is_file():
        raise NotFound(f"Diagnosis {key} has no report", "wait until its job is done, or look why it is not")
    return FileResponse(path, media_type="text/html")


@router.get("/jobs", response_model=Page[JobView], tags=["jobs"])
def list_jobs(
    call: Reader,
    limit: Limit = 50,
    after: After = None,
    robot: Filter = None,
    state: Filter = None,
    kind: Filter = None,
) -> Any:
    """List jobs, newest first."""
    with call.lab.database.read() as session:
        filters = {Job.robot_serial: robot, Job.state: state, Job.kind: kind}
        return page_of(session, Job.id, filters, limit, after, JobView.model_validate)


@router.get("/jobs/{key}", response_model=JobView, responses=problem_responses(404), tags=["jobs"])
def show_job(call: Reader, key: Key) -> Any:
    """Show how far a job is."""
    with call.lab.database.read() as session:
        return JobView.model_validate(find_job(session, key))


@router.post(
    "/jobs/{key}/cancel", response_model=JobView, responses=problem_responses(404, 409), tags=["jobs"]
)
def cancel(call: Runner, key: Key) -> JSONResponse:
    """Cancel a job: at once while it waits, within a second while it runs."""

    def act(session: Session) -> Reply:
        job = cancel_job(session, key)
        note(session, call.caller.name, "job.cancel", key)
        return Reply(200, JobView.model_validate(job).json_content())

    return call.change(None, act)
