"""Robots the service knows: serial numbers, and every version of their description."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.audit import announce, note
from service.refusals import Conflict, NotFound, Unusable
from service.robots import LoadedRobot, build_robot
from service.store.assets import Robot, RobotModel

_SERIAL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")  # it becomes part of addresses and file names


@dataclass(frozen=True)
class RobotEntry:
    """What is said about a robot when it is registered.

    Attributes:
        serial: serial number of the machine.
        simulated: a virtual robot; settled for ever at the first registration.
        unattended: cleared for motion without a person present.
    """

    serial: str
    simulated: bool
    unattended: bool


def robot_row(session: Session, serial: str) -> Robot:
    """Find a robot.

    Raises:
        NotFound: no such serial.
    """
    row = session.get(Robot, serial)
    if row is None:
        raise NotFound(
            f"There is no robot with serial '{serial}'", "register it, or list the robots for their serials"
        )
    return row


def model_of(session: Session, serial: str, model_hash: str | None = None) -> RobotModel:
    """Find a version of a robot's description; the current one when no hash is given."""
    wanted = model_hash or robot_row(session, serial).model_hash
    found = session.scalar(
        select(RobotModel).where(RobotModel.robot_serial == serial, RobotModel.model_hash == wanted)
    )
    if found is None:
        raise NotFound(f"Robot {serial} has no description {wanted}", "list its models")
    return found


def load_model(model: RobotModel) -> LoadedRobot:
    """Build the robot of a stored description."""
    return build_robot(model.toml_text, model.urdf_text, f"robot {model.robot_serial}")


def write_model(model: RobotModel, folder: Path) -> Path:
    """Write a stored description where file-based functions find it.

    Args:
        model: the description.
        folder: an empty folder.

    Returns:
        Path of the robot file.
    """
    file = load_model(model).file
    urdf = folder / Path(file.urdf).name
    urdf.write_text(model.urdf_text, encoding="utf-8")
    path = folder / "robot.toml"
    text = model.toml_text
    if file.urdf != urdf.name:  # the folder is flat
        text = text.replace(f'"{file.urdf}"', f'"{urdf.name}"', 1)
    path.write_text(text, encoding="utf-8")
    return path


def register_robot(session: Session, entry: RobotEntry, loaded: LoadedRobot, by: str) -> tuple[Robot, bool]:
    """Register a robot, or a new version of its description.

    Args:
        session: a writing transaction.
        entry: serial and standing.
        loaded: the checked description.
        by: token name.

    Returns:
        The robot, and whether it is new.

    Raises:
        Unusable: a serial that cannot be an address.
        Conflict: it would turn a real robot into a simulated one, or another robot into this one.
    """
    if not _SERIAL.fullmatch(entry.serial):
        raise Unusable(
            f"'{entry.serial}' cannot be a serial", "use up to 64 letters, digits, dots, dashes, underscores"
        )
    row = session.get(Robot, entry.serial)
    is_new = row is None
    if row is None:
        row = Robot(
            serial=entry.serial, name=loaded.name, simulated=entry.simulated, model_hash=loaded.model_hash
        )
        session.add(row)
        session.flush()
    if row.simulated != entry.simulated:
        raise Conflict(
            f"Robot {entry.serial} is registered as {_kind(row)}, which never changes",
            "register the other one under its own serial",
        )
    if row.name != loaded.name:
        raise Conflict(f"Robot {entry.serial} is a '{row.name}', not a '{loaded.name}'", "use another serial")
    row.model_hash, row.unattended = loaded.model_hash, entry.unattended
    _keep_model(session, entry.serial, loaded)
    note(
        session, by, "robot.register", entry.serial, model_hash=loaded.model_hash, unattended=entry.unattended
    )
    announce(session, "robot.registered", entry.serial, model_hash=loaded.model_hash)
    return row, is_new


def _kind(row: Robot) -> str:
    return "simulated" if row.simulated else "real"


def _keep_model(session: Session, serial: str, loaded: LoadedRobot) -> None:
    known = select(RobotModel.id).where(
        RobotModel.robot_serial == serial, RobotModel.model_hash == loaded.model_hash
    )
    if session.scalar(known) is None:
        session.add(
            RobotModel(
                robot_serial=serial,
                model_hash=loaded.model_hash,
                toml_text=loaded.toml_text,
                urdf_text=loaded.urdf_text,
            )
        )
        session.flush()
