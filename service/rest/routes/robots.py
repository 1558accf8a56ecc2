"""Robots, their descriptions and their leases."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.leases import end_lease, take_lease
from service.refusals import Unusable
from service.registry import RobotEntry, model_of, register_robot, robot_row
from service.rest.call import Admin, Reader, Reply, Runner
from service.rest.paging import Serial
from service.rest.problems import problem_responses
from service.rest.views import LeaseView, RobotView, Text
from service.robots import build_robot, load_robot, preset_names
from service.store.assets import Robot, RobotModel

router = APIRouter(tags=["robots"], responses=problem_responses(401, 403, 422, 429))
_LongText = Annotated[str, Field(max_length=4_000_000, pattern=r"^[^\x00]*$")]


class RobotRequest(BaseModel):
    """A robot to register: a preset's name, or robot file and URDF."""

    serial: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", examples=["IR361-0007"])
    preset: Text | None = Field(
        None, description="Name of a preset that ships with the program.", examples=["ir361"]
    )
    robot_toml: _LongText | None = Field(None, description="Text of robot.toml.")
    urdf: _LongText | None = Field(None, description="Text of the URDF.")
    simulated: bool = Field(False, description="A virtual robot; settled for ever at the first registration.")
    unattended: bool = Field(False, description="Cleared for motion without a person present.")


class LeaseRequest(BaseModel):
    """A robot for a while."""

    minutes: float = Field(60.0, gt=0, allow_inf_nan=False, description="From now [min].")
    purpose: Text = Field(
        "", description="Shown to whoever else wants the robot.", examples=["excitation run"]
    )


class RobotModelView(BaseModel):
    """A description of a robot."""

    model_hash: str
    robot_toml: str
    urdf: str


@router.get("/robots", response_model=list[RobotView])
def list_robots(call: Reader) -> Any:
    """List every robot with its lease."""
    with call.lab.database.read() as session:
        return [RobotView.of(session, row) for row in session.scalars(select(Robot).order_by(Robot.serial))]


@router.post("/robots", status_code=201, response_model=RobotView, responses=problem_responses(409))
def make_robot(call: Admin, body: RobotRequest) -> JSONResponse:
    """Register a robot, or a new version of its description (admin: it decides about motion)."""
    if (body.preset is None) == (body.robot_toml is None or body.urdf is None):
        raise Unusable("A robot needs either a preset or both robot_toml and urdf", "send one of the two")
    if body.preset is not None and body.preset not in preset_names():
        raise Unusable(f"There is no preset '{body.preset}'", f"choose one of: {', '.join(preset_names())}")
    if body.preset is not None:
        loaded = load_robot(body.preset)
    else:
        loaded = build_robot(body.robot_toml or "", body.urdf or "", f"robot {body.serial}")

    def act(session: Session) -> Reply:
        entry = RobotEntry(body.serial, body.simulated, body.unattended)
        row, is_new = register_robot(session, entry, loaded, call.caller.name)
        return Reply(
            201 if is_new else 200, RobotView.of(session, row).json_content(), f"/v1/robots/{row.serial}"
        )

    return call.change(body, act)


@router.get("/robots/{serial}", response_model=RobotView, responses=problem_responses(404))
def show_robot(call: Reader, serial: Serial) -> Any:
    """Show one robot."""
    with call.lab.database.read() as session:
        return RobotView.of(session, robot_row(session, serial))


@router.get("/robots/{serial}/models", response_model=list[str], responses=problem_responses(404))
def list_models(call: Reader, serial: Serial) -> Any:
    """List the digests of every description the robot ever had, newest first."""
    with call.lab.database.read() as session:
        robot_row(session, serial)
        wanted = select(RobotModel.model_hash).where(RobotModel.robot_serial == serial)
        return list(session.scalars(wanted.order_by(RobotModel.id.desc())))


@router.get("/robots/{serial}/model", response_model=RobotModelView, responses=problem_responses(404))
def show_model(call: Reader, serial: Serial) -> Any:
    """Show the current robot file and URDF."""
    with call.lab.database.read() as session:
        model = model_of(session, serial)
        return RobotModelView(model_hash=model.model_hash, robot_toml=model.toml_text, urdf=model.urdf_text)


@router.post("/robots/{serial}/lease", response_model=LeaseView, responses=problem_responses(404, 409))
def make_lease(call: Runner, serial: Serial, body: LeaseRequest) -> JSONResponse:
    """Take a robot for yourself, or renew your lease."""
    limit = call.lab.config.access.lease_limit_min

    def act(session: Session) -> Reply:
        lease = take_lease(session, serial, call.caller.name, body.minutes, body.purpose, limit)
        return Reply(200, LeaseView.model_validate(lease).json_content())

    return call.change(body, act)


@router.delete("/robots/{serial}/lease", responses=problem_responses(404, 409))
def delete_lease(call: Runner, serial: Serial) -> JSONResponse:
    """Give a robot back; an admin can end anybody's lease."""

    def act(session: Session) -> Reply:
        robot_row(session, serial)
        end_lease(session, serial, call.caller.name, is_admin="admin" in call.caller.scopes)
        return Reply(200, {})

    return call.change(None, act)
