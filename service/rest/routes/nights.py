"""Nightly recalibrations: what each concluded."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from service.audit import announce, note
from service.comparisons import find_estimate
from service.refusals import Unusable
from service.registry import robot_row
from service.rest.call import Reader, Reply, Runner
from service.rest.paging import After, Filter, Limit, Page, page_of
from service.rest.problems import problem_responses
from service.rest.views import Identifier, NightView, Text
from service.store.results import Night

router = APIRouter(tags=["nights"], responses=problem_responses(401, 403, 422, 429))


class NightRequest(BaseModel):
    """The account of a night; written by `residuum nightly`."""

    robot_serial: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", examples=["IR361-0007"])
    outcome: Literal["accepted", "proposed", "kept", "skipped", "failed"]
    sentence: str = Field(max_length=4000, pattern=r"^[^\x00]*$")
    estimate_id: Identifier | None = None
    alarms: list[dict[Literal["kind", "subject", "sentence"], Text]] = Field(default=[], max_length=100)
    diagnosis_id: Identifier | None = None


@router.get("/nights", response_model=Page[NightView])
def list_nights(
    call: Reader, limit: Limit = 50, after: After = None, robot: Filter = None, outcome: Filter = None
) -> Any:
    """List nights, newest first."""
    with call.lab.database.read() as session:
        filters = {Night.robot_serial: robot, Night.outcome: outcome}
        return page_of(session, Night.id, filters, limit, after, NightView.model_validate)


@router.post("/nights", status_code=201, response_model=NightView, responses=problem_responses(404))
def keep_night(call: Runner, body: NightRequest) -> JSONResponse:
    """Keep the account of a night; it is never changed afterwards."""

    def act(session: Session) -> Reply:
        robot_row(session, body.robot_serial)
        if body.estimate_id and find_estimate(session, body.estimate_id).robot_serial != body.robot_serial:
            raise Unusable("The estimate is of another robot", "name one of this robot")
        row = Night(
            robot_serial=body.robot_serial,
            outcome=body.outcome,
            sentence=body.sentence,
            estimate_id=body.estimate_id,
            content={"alarms": body.alarms, "diagnosis_id": body.diagnosis_id},
            created_by=call.caller.name,
        )
        session.add(row)
        session.flush()
        note(session, call.caller.name, "night.keep", row.id, robot=body.robot_serial, outcome=body.outcome)
        announce(session, f"night.{body.outcome}", row.id, robot=body.robot_serial, sentence=body.sentence)
        return Reply(201, NightView.model_validate(row).json_content())

    return call.change(body, act)
