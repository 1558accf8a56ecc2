"""Recordings: uploaded as plain bytes, checked, stored, downloaded."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import FileResponse, JSONResponse
from sqlalchemy import select
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from service.archive import Incoming
from service.audit import announce, note
from service.orders import find_recording, refuse_foreign_log
from service.refusals import Conflict, NotFound, Unusable
from service.registry import robot_row
from service.rest.call import Call, Reader, Reply, Runner
from service.rest.paging import After, Filter, Key, Limit, Page, page_of
from service.rest.problems import problem_responses
from service.rest.views import RecordingView
from service.store.assets import Recording

router = APIRouter(tags=["recordings"], responses=problem_responses(401, 403, 422, 429))
_Label = Annotated[
    str,
    Query(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,127}$", description="Name shown and used for downloads."),
]
_BODY = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}
_FILE = {200: {"content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}}}


@router.get("/recordings", response_model=Page[RecordingView])
def list_recordings(
    call: Reader, limit: Limit = 50, after: After = None, robot: Filter = None, kind: Filter = None
) -> Any:
    """List recordings, newest first."""
    filters = {Recording.robot_serial: robot, Recording.kind: kind}
    with call.lab.database.read() as session:
        return page_of(session, Recording.id, filters, limit, after, RecordingView.model_validate)


@router.post(
    "/recordings",
    status_code=201,
    response_model=RecordingView,
    responses=problem_responses(404, 409, 413),
    openapi_extra=_BODY,
)
async def upload_recording(
    call: Runner,
    robot: Annotated[
        str,
        Query(
            pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", description="Serial of the robot it was recorded on."
        ),
    ],
    label: _Label = "run.mcap",
) -> JSONResponse:
    """Upload a log (MCAP) as the request's body; it is read wholly before it counts, and kept once."""
    incoming = call.lab.archive.receive()
    try:
        length = call.request.headers.get("content-length", "")
        incoming.check_announced(int(length) if length.isdecimal() else None)
        async for block in call.request.stream():
            incoming.write(block)
        return await run_in_threadpool(_keep, call, incoming, robot, label)
    finally:
        incoming.discard()


def _keep(call: Call, incoming: Incoming, serial: str, label: str) -> JSONResponse:
    sha256 = incoming.finish()
    with call.lab.database.read() as session:
        robot_name = robot_row(session, serial).name
    facts = call.lab.inspect(str(incoming.path))
    if "fault" in facts:
        path = str(incoming.path)
        raise Unusable(*(facts["fault"][key].replace(path, label) for key in ("cause", "remedy")))
    refuse_foreign_log(facts, robot_name)

    def act(session: Session) -> Reply:
        known = session.scalar(select(Recording).where(Recording.sha256 == sha256))
        if known is not None and known.robot_serial != serial:
            raise Conflict(
                f"These bytes are stored as a recording of robot {known.robot_serial}", "use that one"
            )
        if known is not None:
            return Reply(
                200, RecordingView.model_validate(known).json_content(), f"/v1/recordings/{known.id}"
            )
        call.lab.archive.keep(incoming.path, sha256)
        row = Recording(
            sha256=sha256,
            label=label,
            size_bytes=incoming.size_bytes,
            robot_serial=serial,
            kind=facts["kind"],
            simulated=facts["simulated"],
            facts=facts,
            created_by=call.caller.name,
        )
        session.add(row)
        session.flush()
        note(session, call.caller.name, "recording.upload", row.id, sha256=sha256, robot=serial)
        announce(session, "recording.stored", row.id, robot=serial, label=label)
        return Reply(201, RecordingView.model_validate(row).json_content(), f"/v1/recordings/{row.id}")

    return call.change(None, act)


@router.get("/recordings/{key}", response_model=RecordingView, responses=problem_responses(404))
def show_recording(call: Reader, key: Key) -> Any:
    """Show what is known about a recording."""
    with call.lab.database.read() as session:
        return RecordingView.model_validate(find_recording(session, key))


@router.get("/recordings/{key}/file", response_class=FileResponse, responses=_FILE | problem_responses(404))
def download_recording(call: Reader, key: Key) -> Any:
    """Download the log; ranges are served."""
    with call.lab.database.read() as session:
        row = find_recording(session, key)
    path = call.lab.archive.path_of(row.sha256)
    if not path.is_file():
        raise NotFound(
            f"The file of recording {key} is missing on the server",
            "restore the storage folder from its backup",
        )
    return FileResponse(path, media_type="application/octet-stream", filename=row.label)
