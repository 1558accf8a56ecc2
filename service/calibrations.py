"""Calibrations: an estimate is proposed, a person or a policy accepts it, nothing is ever overwritten."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.audit import announce, note
from service.refusals import Conflict, NotFound, SimulatedResult, Unusable, WrongState
from service.registry import robot_row
from service.states import advance
from service.store.assets import Robot
from service.store.results import Calibration, CalibrationEvent, Estimate


@dataclass(frozen=True)
class Change:
    """Who changes a calibration, and why."""

    by: str
    reason: str


def find_calibration(session: Session, calibration_id: str) -> Calibration:
    """Find a calibration.

    Raises:
        NotFound: no such identifier.
    """
    row = session.get(Calibration, calibration_id)
    if row is None:
        raise NotFound(
            f"There is no calibration {calibration_id}", "list the calibrations for their identifiers"
        )
    return row


def history(session: Session, calibration_id: str) -> list[CalibrationEvent]:
    """Every change of a calibration, oldest first."""
    found = select(CalibrationEvent).where(CalibrationEvent.calibration_id == calibration_id)
    return list(session.scalars(found.order_by(CalibrationEvent.id)))


def state_of(session: Session, calibration_id: str) -> str:
    """The state that its last event led to."""
    return history(session, calibration_id)[-1].state


def states(session: Session, serial: str | None = None) -> dict[str, str]:
    """State of every calibration, of one robot or of all."""
    last = select(func.max(CalibrationEvent.id)).group_by(CalibrationEvent.calibration_id)
    if serial is not None:
        last = last.where(CalibrationEvent.robot_serial == serial)
    rows = session.execute(
        select(CalibrationEvent.calibration_id, CalibrationEvent.state).where(CalibrationEvent.id.in_(last))
    )
    return {calibration_id: state for calibration_id, state in rows}


def accepted(session: Session, serial: str) -> Calibration | None:
    """The calibration in force, if any."""
    found = [key for key, state in states(session, serial).items() if state == "accepted"]
    return find_calibration(session, found[0]) if found else None


def propose(session: Session, estimate_id: str, change: Change) -> Calibration:
    """Put an estimate forward.

    Raises:
        NotFound: no such estimate.
        Unusable: its intervals mean nothing, or it is of another description of the robot.
        Conflict: it has been proposed before.
    """
    estimate = session.get(Estimate, estimate_id)
    if estimate is None:
        raise NotFound(f"There is no estimate {estimate_id}", "list the estimates for their identifiers")
    robot = _locked(session, estimate.robot_serial)
    if estimate.model_hash != robot.model_hash:
        raise Unusable(
            f"Estimate {estimate_id} was made with another description of robot {robot.serial}",
            "fit the recording again with the current one",
        )
    if session.scalar(select(Calibration.id).where(Calibration.estimate_id == estimate_id)) is not None:
        raise Conflict(f"Estimate {estimate_id} has been proposed before", "use its calibration")
    row = Calibration(
        robot_serial=robot.serial,
        model_hash=estimate.model_hash,
        estimate_id=estimate_id,
        simulated=estimate.simulated,
        created_by=change.by,
    )
    session.add(row)
    session.flush()
    _add(session, row, robot, "propose", "proposed", change)
    return row


def accept(session: Session, calibration_id: str, change: Change) -> Calibration:
    """Put a proposed calibration in force; the one before is superseded.

    Raises:
        SimulatedResult: the estimate is simulated and the robot is real.
        WrongState: it is not proposed, or the robot's description has changed since.
    """
    row = find_calibration(session, calibration_id)
    robot = _locked(session, row.robot_serial)
    _refuse_simulated(row, robot)
    state = advance("calibration", state_of(session, row.id), "accept")
    _refuse_other_model(row, robot)
    before = accepted(session, row.robot_serial)
    if before is not None:
        why = Change(change.by, f"superseded by {row.id}")
        _add(session, before, robot, "supersede", advance("calibration", "accepted", "supersede"), why)
    _add(session, row, robot, "accept", state, change)
    return row


def reject(session: Session, calibration_id: str, change: Change) -> Calibration:
    """Turn a proposed calibration down."""
    row = find_calibration(session, calibration_id)
    robot = _locked(session, row.robot_serial)
    _add(session, row, robot, "reject", advance("calibration", state_of(session, row.id), "reject"), change)
    return row


def roll_back(session: Session, serial: str, change: Change) -> Calibration:
    """Withdraw the calibration in force and restore the one before it.

    Returns:
        The restored calibration.

    Raises:
        WrongState: there is none in force, or none before it.
    """
    robot = _locked(session, robot_row(session, serial).serial)
    current, before = accepted(session, serial), _accepted_before(session, serial)
    if current is None:
        raise WrongState(f"Robot {serial} has no accepted calibration", "accept one first")
    if before is None:
        raise WrongState(
            f"Robot {serial} has no calibration before {current.id}",
            "propose and accept a better one",
        )
    _refuse_simulated(before, robot)
    _refuse_other_model(before, robot)
    why = Change(change.by, f"{change.reason} (rolled back to {before.id})".strip())
    _add(session, current, robot, "withdraw", advance("calibration", "accepted", "withdraw"), why)
    _add(session, before, robot, "restore", advance("calibration", "superseded", "restore"), change)
    return before


def _accepted_before(session: Session, serial: str) -> Calibration | None:
    """The latest calibration that was in force and is superseded now."""
    current = states(session, serial)
    found = select(CalibrationEvent).where(
        CalibrationEvent.robot_serial == serial, CalibrationEvent.event.in_(("accept", "restore"))
    )
    for event in session.scalars(found.order_by(CalibrationEvent.id.desc())):
        if current[event.calibration_id] == "superseded":
            return find_calibration(session, event.calibration_id)
    return None


def _locked(session: Session, serial: str) -> Robot:
    """The robot, locked: two acceptances at once must not both win."""
    return session.scalars(select(Robot).where(Robot.serial == serial).with_for_update()).one()


def _refuse_simulated(row: Calibration, robot: Robot) -> None:
    if row.simulated and not robot.simulated:
        raise SimulatedResult(
            f"Calibration {row.id} comes from simulated data, and robot {robot.serial} is real",
            "record the robot itself; simulated results can never be accepted for a real robot",
        )


def _refuse_other_model(row: Calibration, robot: Robot) -> None:
    if row.model_hash != robot.model_hash:
        raise WrongState(
            f"Calibration {row.id} belongs to description {row.model_hash}, "
            f"but robot {robot.serial} now has {robot.model_hash}",
            "fit a recording with the current description",
        )


def _add(session: Session, row: Calibration, robot: Robot, event: str, state: str, change: Change) -> None:
    session.add(
        CalibrationEvent(
            calibration_id=row.id,
            robot_serial=robot.serial,
            event=event,
            state=state,
            simulated=row.simulated,
            robot_simulated=robot.simulated,
            reason=change.reason,
            by=change.by,
        )
    )
    session.flush()
    note(session, change.by, f"calibration.{event}", row.id, robot=robot.serial, reason=change.reason)
    announce(session, f"calibration.{state}", row.id, robot=robot.serial, event=event, by=change.by)
