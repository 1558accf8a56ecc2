"""Estimates, calibrations, comparisons, torque constants over time."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from service import calibrations
from service.calibrations import Change
from service.comparisons import compare_estimates, find_estimate, torque_constant_history
from service.rest.call import Accepter, Reader, Reply, Runner
from service.rest.paging import After, Filter, Key, Limit, Page, Serial, page_of
from service.rest.problems import problem_responses
from service.rest.views import CalibrationView, EstimateSummary, EstimateView, Identifier, Text
from service.store.results import Calibration, Estimate

router = APIRouter(responses=problem_responses(401, 403, 422, 429))
_IdQuery = Annotated[str, Query(pattern="^[0-9a-f]{1,64}$", description="Identifier of an estimate.")]


class ProposalRequest(BaseModel):
    """An estimate to put forward."""

    estimate_id: Identifier
    reason: Text = Field("", examples=["after the gearbox was changed"])


class DecisionRequest(BaseModel):
    """Why a calibration is accepted, rejected or rolled back."""

    reason: Text = Field("", examples=["held-out error is at the noise"])


@router.get("/estimates", response_model=Page[EstimateSummary], tags=["estimates"])
def list_estimates(
    call: Reader, limit: Limit = 50, after: After = None, robot: Filter = None, recording: Filter = None
) -> Any:
    """List estimates with their torque constants, newest first."""
    with call.lab.database.read() as session:
        filters = {Estimate.robot_serial: robot, Estimate.recording_id: recording}
        return page_of(session, Estimate.id, filters, limit, after, EstimateSummary.of)


@router.get(
    "/estimates/{key}", response_model=EstimateView, responses=problem_responses(404), tags=["estimates"]
)
def show_estimate(call: Reader, key: Key) -> Any:
    """Show parameters, torque constants and covariance."""
    with call.lab.database.read() as session:
        return EstimateView.of(find_estimate(session, key))


@router.get(
    "/estimates/{key}/estimate.json",
    response_model=dict[str, Any],
    responses=problem_responses(404),
    tags=["estimates"],
)
def show_estimate_file(call: Reader, key: Key) -> Any:
    """Give the whole ``estimate.json``, as the command line writes it."""
    with call.lab.database.read() as session:
        return JSONResponse(find_estimate(session, key).content)


@router.get("/calibrations", response_model=Page[CalibrationView], tags=["calibrations"])
def list_calibrations(call: Reader, limit: Limit = 50, after: After = None, robot: Filter = None) -> Any:
    """List calibrations with their state and history, newest first."""
    with call.lab.database.read() as session:
        filters = {Calibration.robot_serial: robot}
        return page_of(
            session, Calibration.id, filters, limit, after, lambda row: CalibrationView.of(session, row)
        )


@router.post(
    "/calibrations",
    status_code=201,
    response_model=CalibrationView,
    responses=problem_responses(404, 409),
    tags=["calibrations"],
)
def propose(call: Runner, body: ProposalRequest) -> JSONResponse:
    """Propose an estimate; nothing is applied until somebody accepts it."""

    def act(session: Session) -> Reply:
        row = calibrations.propose(session, body.estimate_id, Change(call.caller.name, body.reason))
        return Reply(201, CalibrationView.of(session, row).json_content(), f"/v1/calibrations/{row.id}")

    return call.change(body, act)


@router.get(
    "/calibrations/{key}",
    response_model=CalibrationView,
    responses=problem_responses(404),
    tags=["calibrations"],
)
def show_calibration(call: Reader, key: Key) -> Any:
    """Show a calibration with every change it went through."""
    with call.lab.database.read() as session:
        return CalibrationView.of(session, calibrations.find_calibration(session, key))


@router.post(
    "/calibrations/{key}/accept",
    response_model=CalibrationView,
    responses=problem_responses(404, 409),
    tags=["calibrations"],
)
def accept(call: Accepter, key: Key, body: DecisionRequest) -> JSONResponse:
    """Put a calibration in force. A simulated result is never accepted for a real robot."""

    def act(session: Session) -> Reply:
        row = calibrations.accept(session, key, Change(call.caller.name, body.reason))
        return Reply(200, CalibrationView.of(session, row).json_content())

    return call.change(body, act)


@router.post(
    "/calibrations/{key}/reject",
    response_model=CalibrationView,
    responses=problem_responses(404, 409),
    tags=["calibrations"],
)
def reject(call: Accepter, key: Key, body: DecisionRequest) -> JSONResponse:
    """Turn a proposed calibration down."""

    def act(session: Session) -> Reply:
        row = calibrations.reject(session, key, Change(call.caller.name, body.reason))
        return Reply(200, CalibrationView.of(session, row).json_content())

    return call.change(body, act)


@router.post(
    "/robots/{serial}/rollback",
    response_model=CalibrationView,
    responses=problem_responses(404, 409),
    tags=["calibrations"],
)
def roll_back(call: Accepter, serial: Serial, body: DecisionRequest) -> JSONResponse:
    """Withdraw the calibration in force and restore the one before it."""

    def act(session: Session) -> Reply:
        row = calibrations.roll_back(session, serial, Change(call.caller.name, body.reason))
        return Reply(200, CalibrationView.of(session, row).json_content())

    return call.change(body, act)


@router.get(
    "/comparisons", response_model=dict[str, Any], responses=problem_responses(404), tags=["comparisons"]
)
def compare(
    call: Reader,
    first: _IdQuery,
    second: _IdQuery,
    level: Annotated[
        float | None, Query(gt=0, lt=1, description="Significance level; that of one night when left out.")
    ] = None,
) -> Any:
    """Test whether two estimates differ by more than covariances and scatter between nights explain."""
    with call.lab.database.read() as session:
        return compare_estimates(session, first, second, level, call.lab.config.nightly).to_json()


@router.get(
    "/robots/{serial}/calibration",
    response_model=CalibrationView | None,
    responses=problem_responses(404),
    tags=["calibrations"],
)
def show_accepted(call: Reader, serial: Serial) -> Any:
    """Show the calibration in force; null where there is none."""
    with call.lab.database.read() as session:
        calibrations.robot_row(session, serial)
        row = calibrations.accepted(session, serial)
        return CalibrationView.of(session, row) if row else None


@router.get(
    "/robots/{serial}/torque-constants",
    response_model=dict[str, Any],
    responses=problem_responses(404),
    tags=["estimates"],
)
def show_torque_constants(call: Reader, serial: Serial) -> Any:
    """Show torque constants over time, and the trend of each joint with its test."""
    with call.lab.database.read() as session:
        calibrations.robot_row(session, serial)
        return torque_constant_history(session, serial, call.lab.config.nightly)
