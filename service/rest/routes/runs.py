"""Runs: preview, confirm with the robot's name, progress, abort."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from service.rest.call import Reader, Reply, Runner
from service.rest.paging import After, Filter, Key, Limit, Page, page_of
from service.rest.problems import problem_responses
from service.rest.views import Identifier, Text, View
from service.runs import RunRequest, find_run
from service.store.work import Run

router = APIRouter(tags=["runs"], responses=problem_responses(401, 403, 422, 429))


class PreviewRequest(BaseModel):
    """A run to work out; nothing moves."""

    robot_serial: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", examples=["IR361-0007"])
    excitation_id: Identifier
    periods: int = Field(16, ge=1, le=10_000, description="Measured periods.")
    transient_periods: int = Field(1, ge=0, le=100, description="Periods before them.")
    is_validation: bool = Field(False, description="Move from point to point within the excitation's range.")
    seed: int = Field(
        0, ge=0, le=2**31 - 1, description="Of validation points, and of a virtual robot's noise."
    )
    unattended: bool = Field(False, description="Nobody is present: the robot must be cleared for that.")


class ConfirmRequest(BaseModel):
    """Permission to move."""

    robot_name: Text = Field(
        description="The robot's exact name, typed by whoever is responsible.", examples=["ir361"]
    )


class RunView(View):
    """A run."""

    id: str
    robot_serial: str
    state: str = Field(
        description="previewed, starting, recording, finished, failed, aborted, interrupted or expired."
    )
    simulated: bool
    request: dict[str, Any]
    preview: dict[str, Any] = Field(
        description="Duration, cycles, size of the log, every peak against its limit."
    )
    progress: dict[str, Any] | None
    recording_id: str | None = Field(
        description="What was recorded, also where the run was aborted or interrupted."
    )
    error: dict[str, Any] | None
    created_by: str
    created_at: datetime
    finished_at: datetime | None


@router.get("/runs", response_model=Page[RunView])
def list_runs(
    call: Reader, limit: Limit = 50, after: After = None, robot: Filter = None, state: Filter = None
) -> Any:
    """List runs, newest first."""
    with call.lab.database.read() as session:
        return page_of(
            session, Run.id, {Run.robot_serial: robot, Run.state: state}, limit, after, RunView.model_validate
        )


@router.post("/runs", status_code=201, response_model=RunView, responses=problem_responses(404, 409))
def preview(call: Runner, body: PreviewRequest) -> JSONResponse:
    """Preview a run: what it would do, against every limit. Nothing moves before it is confirmed."""

    def act(session: Session) -> Reply:
        options = body.model_dump(include={"periods", "transient_periods", "is_validation", "seed"})
        request = RunRequest(body.robot_serial, body.excitation_id, options, body.unattended)
        row = call.lab.runs.preview(session, request, call.caller.name)
        return Reply(201, RunView.model_validate(row).json_content(), f"/v1/runs/{row.id}")

    return call.change(body, act)


@router.get("/runs/{key}", response_model=RunView, responses=problem_responses(404))
def show_run(call: Reader, key: Key) -> Any:
    """Show a run and how far it is."""
    with call.lab.database.read() as session:
        return RunView.model_validate(find_run(session, key))


@router.post(
    "/runs/{key}/confirm", status_code=202, response_model=RunView, responses=problem_responses(404, 409)
)
def confirm(call: Runner, key: Key, body: ConfirmRequest) -> JSONResponse:
    """Move the robot: needs its name and your lease. The run goes on whatever happens to this connection."""
    confirmed = []

    def act(session: Session) -> Reply:
        row = call.lab.runs.confirm(session, key, body.robot_name, call.caller.name)
        confirmed.append(row.id)
        return Reply(202, RunView.model_validate(row).json_content(), f"/v1/runs/{row.id}")

    answer = call.change(body, act)
    for run_id in confirmed:
        call.lab.runs.start(run_id)
    return answer


@router.post("/runs/{key}/abort", response_model=RunView, responses=problem_responses(404, 409))
def abort(call: Runner, key: Key) -> JSONResponse:
    """Stop the robot by its stop ladder; needs no lease. What was recorded is kept."""

    def act(session: Session) -> Reply:
        return Reply(
            200, RunView.model_validate(call.lab.runs.abort(session, key, call.caller.name)).json_content()
        )

    return call.change(None, act)
