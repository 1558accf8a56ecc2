"""Excitations: designed as a job."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from service.audit import note
from service.orders import order_design
from service.refusals import NotFound, WrongState
from service.rest.call import Reader, Reply, Runner
from service.rest.paging import After, Filter, Key, Limit, Page, page_of
from service.rest.problems import problem_responses
from service.rest.views import ExcitationView
from service.store.assets import Excitation

router = APIRouter(tags=["excitations"], responses=problem_responses(401, 403, 422, 429))
_Finite = Field(allow_inf_nan=False)


class DesignRequest(BaseModel):
    """A periodic excitation to design."""

    robot_serial: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", examples=["IR361-0007"])
    harmonics: int = Field(5, ge=1, le=20, description="Lines of the series.")
    fundamental_hz: Annotated[float, _Finite] = Field(0.1, gt=0, le=10, description="Repetition rate [Hz].")
    rate_hz: Annotated[float, _Finite] = Field(
        150.0, gt=0, le=4000, description="Sampling rate of the run [Hz]."
    )
    periods: int = Field(16, ge=2, le=10_000, description="Periods that the run will average.")
    criterion: Literal["d", "a", "condition"] = "d"
    seed: int = Field(
        0, ge=0, le=2**31, description="Of the random starts: the same seed gives the same design."
    )
    starts: int = Field(6, ge=1, le=64, description="Random starts.")
    refined: int = Field(2, ge=1, le=16, description="Starts that are optimised to the end.")
    share: float = Field(0.99, gt=0, le=1, description="Part of every joint limit that may be used.")


@router.get("/excitations", response_model=Page[ExcitationView])
def list_excitations(call: Reader, limit: Limit = 50, after: After = None, robot: Filter = None) -> Any:
    """List excitations, newest first."""
    with call.lab.database.read() as session:
        filters = {Excitation.robot_serial: robot}
        return page_of(
            session, Excitation.id, filters, limit, after, lambda row: ExcitationView.of(session, row)
        )


@router.post("/excitations", status_code=202, response_model=ExcitationView, responses=problem_responses(404))
def make_excitation(call: Runner, body: DesignRequest) -> JSONResponse:
    """Ask for an excitation inside every limit of the robot; follow it at the Location."""

    def act(session: Session) -> Reply:
        row = order_design(
            session, body.robot_serial, body.model_dump(exclude={"robot_serial"}), call.caller.name
        )
        note(session, call.caller.name, "excitation.request", row.id, robot=body.robot_serial)
        return Reply(202, ExcitationView.of(session, row).json_content(), f"/v1/excitations/{row.id}")

    return call.change(body, act)


def find_excitation(session: Session, key: str) -> Excitation:
    """Find an excitation.

    Raises:
        NotFound: no such identifier.
    """
    row = session.get(Excitation, key)
    if row is None:
        raise NotFound(f"There is no excitation {key}", "list the excitations for their identifiers")
    return row


@router.get("/excitations/{key}", response_model=ExcitationView, responses=problem_responses(404))
def show_excitation(call: Reader, key: Key) -> Any:
    """Show an excitation with its job."""
    with call.lab.database.read() as session:
        return ExcitationView.of(session, find_excitation(session, key))


@router.get(
    "/excitations/{key}/excitation.json", response_model=dict[str, Any], responses=problem_responses(404, 409)
)
def show_excitation_file(call: Reader, key: Key) -> Any:
    """Give ``excitation.json``, as `residuum record` takes it."""
    with call.lab.database.read() as session:
        content = find_excitation(session, key).content
    if content is None:
        raise WrongState(
            f"Excitation {key} has no content", "wait until its job is done, or look why it is not"
        )
    return JSONResponse(content)
