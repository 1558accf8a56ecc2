"""The process that alone owns the buses during a run: ``python -m service.acquisition_process FOLDER``.

``request.json`` in its folder tells it everything; it tells how far it is in ``progress.json``, how it ended
in ``report.json``. It needs no socket. SIGTERM, and the death of the server, start the stop ladder.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

from service.faults import fault_of
from service.files import to_json, write_text
from service.recordings import RecordRequest, Session, open_session

_LOOK_S = 0.25
LOG_NAME = "run.mcap"


def main(folder: Path, parent: int) -> int:
    """Record one run.

    Args:
        folder: of the run.
        parent: process id of the server.

    Returns:
        Exit code: 0 where the run is complete.
    """
    ended = threading.Event()
    try:
        session = open_session(read_request(folder))
        signal.signal(signal.SIGTERM, lambda *_: session.acquisition.abort("The run was aborted."))
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        watcher = threading.Thread(target=_watch, args=(session, folder, parent, ended), name="watch")
        watcher.start()
        try:
            report = session.run().to_json()
        finally:
            ended.set()
            watcher.join()
            session.bench.close()
    except Exception as error:
        found = getattr(error, "report", None)
        content = {"fault": fault_of(error), "report": found.to_json() if found is not None else None}
        write_text(folder / "report.json", to_json(content), "the report")
        return 1
    write_text(folder / "report.json", to_json({"fault": None, "report": report}), "the report")
    return 0


def read_request(folder: Path) -> RecordRequest:
    """The run that a folder describes."""
    asked: dict[str, Any] = json.loads((folder / "request.json").read_text(encoding="utf-8"))
    places = {
        "robot": str(folder / "robot.toml"),
        "excitation": folder / "excitation.json",
        "output": folder / LOG_NAME,
    }
    return RecordRequest(**places, **asked)


def _watch(session: Session, folder: Path, parent: int, ended: threading.Event) -> None:
    while not ended.wait(_LOOK_S):
        now = session.acquisition.progress()
        content = {
            "state": now.state.value,
            "cycle": now.cycle,
            "cycles": now.cycles,
            "remaining_s": now.remaining_s,
        }
        temporary = folder / "progress.new"
        temporary.write_text(json.dumps(content))
        os.replace(temporary, folder / "progress.json")
        if os.getppid() != parent:  # nobody could abort it any more
            session.acquisition.abort("The server stopped while the run was recorded.")


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), int(sys.argv[2])))
