"""Runs: previewed, confirmed with the robot's name, recorded by a process of their own, stored."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import asdict, dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from daq.mcap_writer import PARTIAL_SUFFIX
from service.acquisition_process import LOG_NAME, read_request
from service.archive import Archive, inspect_log
from service.audit import announce, note
from service.faults import fault_of
from service.files import to_json, write_text
from service.leases import require_lease
from service.recordings import preview
from service.refusals import NotCleared, NotFound, Unusable, WrongState
from service.registry import model_of, robot_row, write_model
from service.states import advance
from service.store.assets import Excitation, Recording
from service.store.base import new_id, now
from service.store.database import Database
from service.store.work import Run

_PREVIEW_MIN = 15.0  # an older preview may not be of the cell as it stands
_LOOK_S = 0.5
_STOP_S = 30.0  # longest stop ladder and closing of the log
_ACTIVE = ("starting", "recording")


@dataclass(frozen=True)
class RunRequest:
    """What is to be recorded.

    Attributes:
        robot: serial.
        excitation: identifier.
        options: of ``service.recordings.RecordRequest``: periods, seed and the like.
        is_unattended: nobody is present.
    """

    robot: str
    excitation: str
    options: dict[str, Any]
    is_unattended: bool


class Runs:
    """The runs of a server.

    Args:
        database: where their state is.
        archive: where recordings go.
        folder: each run gets one inside.
    """

    def __init__(self, database: Database, archive: Archive, folder: Path) -> None:
        self.database, self.archive, self.folder = database, archive, folder
        self._threads: list[threading.Thread] = []
        self._ended = threading.Event()
        folder.mkdir(parents=True, exist_ok=True)

    def preview(self, session: Session, request: RunRequest, by: str) -> Run:
        """Work out a run without moving anything.

        Raises:
            NotCleared: unattended motion of a robot that is not cleared for it.
            UsageError, DaqError: the motion does not fit the robot or its limits.
        """
        robot = robot_row(session, request.robot)
        refuse_uncleared(robot.serial, robot.unattended, request.is_unattended)
        excitation = session.get(Excitation, request.excitation)
        if excitation is None or excitation.content is None:
            raise NotFound(f"There is no finished excitation {request.excitation}", "design one and wait for its job")
        if excitation.robot_serial != robot.serial or excitation.model_hash != robot.model_hash:
            raise Unusable("The excitation is of another robot or description", "design one for this robot as it is")
        run_id = new_id()
        place = self.folder / run_id
        place.mkdir()
        write_model(model_of(session, robot.serial), place)
        write_text(place / "excitation.json", to_json(excitation.content), "the excitation")
        asked = request.options | {"is_virtual": robot.simulated, "run_id": run_id}
        write_text(place / "request.json", to_json(asked), "the request")
        found = asdict(preview(read_request(place))[1])
        for peak in found["peaks"]:
            peak["limit"] = peak["limit"] if abs(peak["limit"]) < 1e300 else None
        row = Run(
            id=run_id,
            robot_serial=robot.serial,
            simulated=robot.simulated,
            preview=found | {"peaks": list(found["peaks"])},
            request=asked | {"excitation_id": request.excitation, "unattended": request.is_unattended},
            created_by=by,
        )
        session.add(row)
        session.flush()
        note(session, by, "run.preview", row.id, robot=robot.serial)
        return row

    def confirm(self, session: Session, run_id: str, robot_name: str, by: str) -> Run:
        """Allow a previewed run to move the robot; ``start`` follows after the commit.

        Raises:
            Unusable: the name is not the robot's.
            LeaseNeeded, LeaseHeld: the caller does not have the robot.
            WrongState: too late, or the robot is in another run.
        """
        run = find_run(session, run_id)
        robot = robot_row(session, run.robot_serial)
        if robot_name != robot.name:
            raise Unusable(f"'{robot_name}' is not the name of robot {robot.serial}", "confirm with its exact name")
        require_lease(session, robot.serial, by)
        refuse_uncleared(robot.serial, robot.unattended, bool(run.request["unattended"]))
        if run.state == "previewed" and run.created_at < now() - timedelta(minutes=_PREVIEW_MIN):
            raise WrongState(f"The preview is older than {_PREVIEW_MIN:g} min", "preview the run again")
        other = select(Run.id).where(Run.robot_serial == robot.serial, Run.state.in_(_ACTIVE))
        if session.scalar(other) is not None:
            raise WrongState(f"Robot {robot.serial} is in another run", "wait for it or abort it")
        move_run(session, run, "confirm")
        note(session, by, "run.confirm", run.id, robot=robot.serial)
        return run

    def start(self, run_id: str) -> None:
        """Start the process of a confirmed run, and watch it; does nothing when it was started before."""
        thread = threading.Thread(target=self._watch, args=(run_id,), name=f"run-{run_id}")
        self._threads.append(thread)
        thread.start()

    def abort(self, session: Session, run_id: str, by: str) -> Run:
        """Ask for the stop ladder; needs no lease. What was recorded is kept."""
        run = find_run(session, run_id)
        advance("run", run.state, "abort")
        note(session, by, "run.abort", run.id)
        (self.folder / run.id / "abort").touch()  # heard even while the process is only starting
        if run.process_id is not None and _is_ours(run.process_id, self.folder / run.id):
            os.kill(run.process_id, signal.SIGTERM)
        return run

    def recover(self) -> list[str]:
        """After a start: runs that the last server did not see to their end; their logs are salvaged.

        Returns:
            A sentence a run.
        """
        with self.database.write() as session:
            found = list(session.scalars(select(Run).where(Run.state.in_(_ACTIVE))))
            for old in session.scalars(select(Run).where(Run.state == "previewed")):
                move_run(session, old, "expire")  # nobody has looked at the cell since
        for run in found:
            place = self.folder / run.id
            deadline_s = time.monotonic() + _STOP_S
            while run.process_id and _is_ours(run.process_id, place) and time.monotonic() < deadline_s:
                time.sleep(0.1)  # its stop ladder runs: it has noticed that the server is gone
            cause, remedy = (
                "The server stopped while the run was recorded",
                "look at the robot, then record it again",
            )
            self._settle(run.id, "lose", {"code": "interrupted", "cause": cause, "remedy": remedy})
        return [f"Run {run.id} of robot {run.robot_serial} was interrupted." for run in found]

    def close(self) -> None:
        """Stop every run by its stop ladder and wait for it."""
        self._ended.set()
        for thread in self._threads:
            thread.join()

    def _watch(self, run_id: str) -> None:
        place = self.folder / run_id
        command = [sys.executable, "-m", "service.acquisition_process", str(place), str(os.getpid())]
        with (place / "output.txt").open("wb") as output:
            process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)
        with self.database.write() as session:
            run = find_run(session, run_id)
            run.process_id = process.pid
            move_run(session, run, "begin")
        while process.poll() is None:
            if self._ended.wait(_LOOK_S) or (place / "abort").exists():
                process.terminate()
                process.wait()
            with contextlib.suppress(SQLAlchemyError):  # a busy database may cost a progress line, never the run
                self._show(run_id, place)
        report = _read(place / "report.json")
        fault = report.get("fault")
        if not report:
            cause, remedy = "The acquisition process died", "look at the robot and at output.txt of the run"
            fault = {"code": "acquisition_died", "cause": cause, "remedy": remedy}
        event = "finish" if fault is None else "abort" if fault["code"] == "run_aborted" else "fail"
        self._settle(run_id, event, fault)

    def _show(self, run_id: str, place: Path) -> None:
        progress = _read(place / "progress.json")
        with self.database.write() as session:
            run = find_run(session, run_id)
            if progress and progress != run.progress:
                run.progress = progress
                announce(session, "run.progress", run_id, **progress)

    def _settle(self, run_id: str, event: str, fault: dict[str, Any] | None) -> None:
        log = self._salvaged(self.folder / run_id)
        try:
            self._conclude(run_id, event, fault, log)
        except Exception as error:  # a log that cannot be stored stays in the run's folder; the run ends all the same
            cause = f"The log of the run could not be stored: {fault_of(error)['cause']}"
            remedy = f"it is kept in {self.folder / run_id}"
            not_kept = {"code": "log_not_stored", "cause": cause, "remedy": remedy}
            self._conclude(run_id, "fail" if event == "finish" else event, fault or not_kept, None)

    def _conclude(self, run_id: str, event: str, fault: dict[str, Any] | None, log: Path | None) -> None:
        with self.database.write() as session:
            run = find_run(session, run_id)
            if log is not None:
                run.recording_id = self._keep(session, run, log).id
            run.error, run.finished_at, run.process_id = fault, now(), None
            move_run(session, run, event)
            note(session, "server", f"run.{run.state}", run.id, recording=run.recording_id)

    def _salvaged(self, place: Path) -> Path | None:
        """The run's log; made whole first where the process died over it."""
        log = place / LOG_NAME
        partial = log.with_name(log.name + PARTIAL_SUFFIX)
        if partial.is_file():
            from daq.errors import DaqError
            from daq.recovery import recover

            try:
                recover(partial, log)
                partial.unlink()
            except DaqError:
                return None  # nothing in it; it stays in the run's folder
        return log if log.is_file() else None

    def _keep(self, session: Session, run: Run, log: Path) -> Recording:
        incoming = self.archive.receive(is_limited=False)  # what was measured is never refused for its size
        try:
            with log.open("rb") as stream:
                while block := stream.read(1 << 20):
                    incoming.write(block)
            sha256 = incoming.finish()
            known = session.scalar(select(Recording).where(Recording.sha256 == sha256))
            if known is not None:
                return known
            facts = inspect_log(str(incoming.path))
            row = Recording(
                sha256=sha256,
                label=f"run-{run.id}.mcap",
                size_bytes=incoming.size_bytes,
                robot_serial=run.robot_serial,
                kind=facts["kind"],
                simulated=facts["simulated"] or run.simulated,
                facts=facts,
                created_by=run.created_by,
            )
            self.archive.keep(incoming.path, sha256)
            session.add(row)
            session.flush()
            announce(session, "recording.stored", row.id, robot=run.robot_serial, label=row.label)
            return row
        finally:
            incoming.discard()


def find_run(session: Session, run_id: str) -> Run:
    """Find a run.

    Raises:
        NotFound: no such identifier.
    """
    row = session.get(Run, run_id)
    if row is None:
        raise NotFound(f"There is no run {run_id}", "list the runs for their identifiers")
    return row


def move_run(session: Session, run: Run, event: str) -> None:
    """Change a run's state by the table, and tell listeners."""
    run.state = advance("run", run.state, event)
    announce(session, f"run.{run.state}", run.id, robot=run.robot_serial, error=run.error)


def refuse_uncleared(serial: str, is_cleared: bool, is_unattended: bool) -> None:
    """Refuse unattended motion of a robot that is not cleared for it.

    Raises:
        NotCleared: always, where it is not.
    """
    if is_unattended and not is_cleared:
        cause = f"Robot {serial} is not cleared for unattended motion"
        raise NotCleared(cause, "register it with unattended = true once its cell is safe")


def _is_ours(process_id: int, place: Path) -> bool:
    """Whether that process is the acquisition of this run: numbers are used again."""
    try:
        return str(place).encode() in Path(f"/proc/{process_id}/cmdline").read_bytes()
    except OSError:
        return False


def _read(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
