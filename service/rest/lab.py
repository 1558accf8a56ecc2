"""A running server's belongings: database, archive, workers; opened and closed as one."""

from __future__ import annotations

import fcntl
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.metadata import version
from typing import IO, Any

from service.archive import Archive, Limits, inspect_log
from service.audit import note
from service.compute import Compute
from service.config import Config
from service.errors import UsageError
from service.faults import fault_of
from service.jobs import resume_jobs
from service.runs import Runs
from service.slot import end_executor, spawn_executor
from service.store.database import Database
from service.tokens import FailureBrake, first_token

_MEGABYTE = 1_000_000


class Lab:
    """Everything that handlers use.

    Args:
        config: the configuration.

    Raises:
        UsageError: the folder is another server's, or the database cannot be opened.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self.version = version("residuum")
        self.started_s = time.monotonic()
        storage = config.storage
        storage.folder.mkdir(parents=True, exist_ok=True)
        self._lock = _lock_folder(config)
        self.database = Database(config.database_url)
        self.database.migrate()
        limits = Limits(storage.max_upload_mb * _MEGABYTE, storage.keep_free_mb * _MEGABYTE)
        self.archive = Archive(storage.folder / "recordings", limits)
        self.brake = FailureBrake(config.access.failures, config.access.failure_window_s)
        self.compute = Compute(self.database, self.archive, storage.folder, config.compute)
        self.runs = Runs(self.database, self.archive, storage.folder / "runs")
        self._reader: ProcessPoolExecutor | None = None

    def open(self) -> tuple[str | None, list[str]]:
        """Recover from the last stop and begin to work.

        Returns:
            The first token where the database is fresh, and what was found interrupted, a sentence each.
        """
        self.archive.clear_incoming()
        with self.database.write() as session:
            token = first_token(session)
            found = resume_jobs(session, self.config.compute.attempts)
            sentences = [
                f"Job {job.id} ({job.kind}) was interrupted and is now {job.state}." for job in found
            ]
            for job in found:
                note(session, "server", "job.interrupted", job.id, state=job.state)
        sentences += self.runs.recover()
        self.compute.start()
        return token, sentences

    def close(self) -> None:
        """Stop workers and let go of database and folder."""
        self.runs.close()
        self.compute.stop()
        if self._reader is not None:
            end_executor(self._reader)
        self.database.close()
        self._lock.close()

    def inspect(self, path: str) -> dict[str, Any]:
        """Read an uploaded log in a process of its own: a hostile file must not take the server along."""
        if self._reader is None:
            self._reader = spawn_executor()
        try:
            return self._reader.submit(_inspect, path).result(timeout=self.config.compute.job_limit_s)
        except (BrokenProcessPool, TimeoutError) as error:
            end_executor(self._reader)
            self._reader = None
            return {
                "fault": fault_of(
                    UsageError(f"The log could not be read ({type(error).__name__}); send a smaller one.")
                )
            }


def _inspect(path: str) -> dict[str, Any]:
    try:
        return inspect_log(path)
    except Exception as error:
        return {"fault": fault_of(error)}


def _lock_folder(config: Config) -> IO[str]:
    path = config.storage.folder / "server.lock"
    handle = path.open("w")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        handle.close()
        raise UsageError(
            f"The folder {config.storage.folder} belongs to a server that is running; "
            "stop it, or choose another storage.folder."
        ) from error
    return handle
