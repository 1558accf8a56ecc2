"""A worker slot: one thread that claims jobs, one spawned process that computes them."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures import TimeoutError as NotYet
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from service.archive import Archive
from service.faults import fault_of
from service.jobs import claim_job, find_job, move_job, show_progress
from service.orders import keep_result, order_for
from service.refusals import Refusal
from service.store.database import Database
from service.store.work import Job
from service.worker import perform, prepare_worker, read_progress

_LOOK_S = 0.25  # between two looks at a running job: cancelling and progress lag by it
_IDLE_S = 1.0  # between two looks for work when nobody rings


def spawn_executor() -> ProcessPoolExecutor:
    """One worker process; spawned, so that it inherits no lock, socket or bus."""
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=prepare_worker)


class WorkerDied(Refusal):
    """The process of a job died."""

    code = "worker_died"


class JobTooLong(Refusal):
    """A job took longer than the limit."""

    code = "job_too_long"


class Slot:
    """Carries out one job at a time.

    Args:
        database: where jobs are.
        archive: where recordings are.
        folder: of reports and progress.
        limit_s: longest time of a job [s].
        ended: set when the server stops.
        bell: set when there is work.
    """

    def __init__(
        self, database: Database, archive: Archive, folder: Path, limit_s: float, ended: threading.Event,
        bell: threading.Event,
    ) -> None:  # fmt: skip
        self.database, self.archive, self.limit_s = database, archive, limit_s
        self.reports, self.progress = folder / "reports", folder / "progress"
        self._ended, self._bell = ended, bell
        self._executor: Executor = spawn_executor()

    def run(self) -> None:
        """Take jobs until the server stops; a job cut off by that stays marked as running."""
        while not self._ended.is_set():
            try:
                if self.take():
                    continue
            except Exception as error:  # the database may be away for a moment: a slot survives that
                print(f"Worker slot: {error}", flush=True)
            self._bell.wait(_IDLE_S)
            self._bell.clear()
        end_executor(self._executor)

    def take(self) -> bool:
        """Carry out one job; False when there is none."""
        with self.database.write() as session:
            job = claim_job(session)
        if job is None:
            return False
        order: dict[str, Any] | None = None
        try:
            with self.database.read() as session:
                order = order_for(session, job, self.archive)
            result = self._compute(job, order)
        except Exception as error:
            result = {"fault": fault_of(error)}
        if result is not None:
            self._finish(job.id, order, result)
        return True

    def _compute(self, job: Job, order: dict[str, Any]) -> dict[str, Any] | None:
        """The result; None when the server stops meanwhile."""
        future = self._executor.submit(perform, job.kind, order, str(self._path(job.id)))
        deadline_s = time.monotonic() + self.limit_s
        try:
            while not self._ended.is_set():
                with contextlib.suppress(NotYet):
                    return _result(future)
                if self._is_cancelled(job.id):
                    self._renew()
                    return {"cancelled": True}
                if time.monotonic() > deadline_s:
                    self._renew()
                    raise JobTooLong(
                        f"The job took longer than {self.limit_s:g} s",
                        "use a shorter recording, or raise compute.job_limit_s",
                    )
        except BrokenProcessPool as error:
            self._renew()
            raise WorkerDied(
                "The worker process of this job died", "look for lack of memory, then ask for the job anew"
            ) from error
        return None

    def _renew(self) -> None:
        end_executor(self._executor)
        self._executor = spawn_executor()

    def _is_cancelled(self, job_id: str) -> bool:
        told = read_progress(self._path(job_id))
        with self.database.read() as session:
            job = find_job(session, job_id)
        if told is not None and told != (job.stage, job.progress):
            with self.database.write() as session:
                show_progress(session, job_id, *told)
        return job.cancel_requested

    def _finish(self, job_id: str, order: dict[str, Any] | None, result: dict[str, Any]) -> None:
        try:
            self._settle(job_id, order, result)
        except Exception as error:  # a result that cannot be kept fails its job, not the slot
            self._settle(job_id, None, {"fault": fault_of(error)})
        self._path(job_id).unlink(missing_ok=True)

    def _settle(self, job_id: str, order: dict[str, Any] | None, result: dict[str, Any]) -> None:
        with self.database.write() as session:
            job = find_job(session, job_id)
            if "content" in result and order is not None:
                keep_result(session, job, order, result, self.reports)
                move_job(session, job, "finish")
            elif result.get("cancelled"):
                move_job(session, job, "cancel")
            else:
                move_job(session, job, "fail", result["fault"])

    def _path(self, job_id: str) -> Path:
        return self.progress / f"{job_id}.json"


def _result(future: Future[dict[str, Any]]) -> dict[str, Any]:
    return future.result(timeout=_LOOK_S)


def end_executor(executor: Executor) -> None:
    """End an executor's processes; whatever they computed is lost, which their jobs' states say."""
    processes = list((getattr(executor, "_processes", None) or {}).values())
    for process in processes:
        with contextlib.suppress(ProcessLookupError, TypeError):
            os.kill(process.pid, signal.SIGKILL)
    executor.shutdown(wait=True, cancel_futures=True)
