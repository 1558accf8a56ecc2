"""The worker slots of a server: started, rung, stopped together."""

from __future__ import annotations

import threading
from pathlib import Path

from service.archive import Archive
from service.config import ComputeSection
from service.slot import Slot
from service.store.database import Database


class Compute:
    """As many slots as the configuration says.

    Args:
        database: where jobs are.
        archive: where recordings are.
        folder: of reports and progress.
        settings: how many workers, and how long a job may take.
    """

    def __init__(self, database: Database, archive: Archive, folder: Path, settings: ComputeSection) -> None:
        self.reports = folder / "reports"
        for made in (self.reports, folder / "progress"):
            made.mkdir(parents=True, exist_ok=True)
        self._bell, self._ended = threading.Event(), threading.Event()
        slots = [
            Slot(database, archive, folder, settings.job_limit_s, self._ended, self._bell)
            for _ in range(settings.workers)
        ]
        self._threads = [threading.Thread(target=slot.run, name=f"slot-{k}") for k, slot in enumerate(slots)]

    def start(self) -> None:
        """Begin to take jobs."""
        for thread in self._threads:
            thread.start()

    def ring(self) -> None:
        """Tell the slots that there is work."""
        self._bell.set()

    def stop(self) -> None:
        """Stop at once; jobs that run stay marked as running, so that the next start finds them."""
        self._ended.set()
        self._bell.set()
        for thread in self._threads:
            if thread.ident is not None:
                thread.join()
