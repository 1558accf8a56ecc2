"""Health, events as they happen, metrics."""

from __future__ import annotations

import asyncio
import json
import shutil
import time
from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import APIRouter, Header, Query, Request
from fastapi.responses import JSONResponse, PlainTextResponse, StreamingResponse
from pydantic import BaseModel, Field
from sqlalchemy import select, text
from sqlalchemy.exc import SQLAlchemyError
from starlette.concurrency import run_in_threadpool

from service.rest.call import Call, Reader
from service.rest.lab import Lab
from service.rest.measures import metrics_text
from service.rest.problems import problem_responses
from service.store.work import Event

router = APIRouter(tags=["status"], responses=problem_responses(422))
_MOST_EVENTS = 500  # a poll
_KEEP_ALIVE_S = 15.0  # proxies close what stays silent for a minute


class HealthView(BaseModel):
    """Whether the service can work."""

    status: str = Field(description="ok or failing.", examples=["ok"])
    version: str
    database: str
    disk_free_mb: int
    up_s: float


@router.get(
    "/health", response_model=HealthView, responses={503: {"model": HealthView, "description": "Failing"}}
)
def show_health(request: Request) -> JSONResponse:
    """Tell whether database and disk can be used; needs no token and tells nothing of the lab."""
    lab: Lab = request.app.state.lab
    try:
        with lab.database.read() as session:
            session.execute(text("SELECT 1"))
        database = "ok"
    except SQLAlchemyError:
        database = "failing"
    free = shutil.disk_usage(lab.config.storage.folder).free // 1_000_000
    healthy = database == "ok" and free >= lab.config.storage.keep_free_mb
    view = HealthView(
        status="ok" if healthy else "failing", version=lab.version, database=database, disk_free_mb=free,
        up_s=time.monotonic() - lab.started_s,
    )  # fmt: skip
    return JSONResponse(view.model_dump(), 200 if healthy else 503)


@router.get("/metrics", response_class=PlainTextResponse, responses=problem_responses(401, 403, 429))
def show_metrics(call: Reader) -> PlainTextResponse:
    """Metrics in the text format of Prometheus."""
    return PlainTextResponse(
        metrics_text(call.lab, call.request.app.state.traffic), media_type="text/plain; version=0.0.4"
    )


@router.get(
    "/events",
    response_class=StreamingResponse,
    responses={200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}}
    | problem_responses(401, 403, 429),
)
async def follow_events(
    call: Reader,
    after: Annotated[int, Query(ge=0, le=2**31 - 1, description="Number of the last event you have.")] = 0,
    follow: Annotated[bool, Query(description="False ends after the events there are.")] = True,
    last_event_id: Annotated[
        str | None, Header(pattern="^[0-9]{1,9}$", description="Sent by browsers that reconnect.")
    ] = None,
) -> StreamingResponse:
    """Stream changes as server-sent events; numbered, so that nothing is missed across a reconnection."""
    start = int(last_event_id) if last_event_id else after
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(_stream(call, start, follow), media_type="text/event-stream", headers=headers)


async def _stream(call: Call, after: int, follow: bool) -> AsyncIterator[str]:
    silent_s = 0.0
    poll_s = call.lab.config.server.stream_poll_s
    yield "retry: 2000\n\n"
    while True:
        events = await run_in_threadpool(_events, call.lab, after)
        for event in events:
            after = event["id"]
            yield f"id: {after}\nevent: {event['kind']}\ndata: {json.dumps(event)}\n\n"
        if len(events) == _MOST_EVENTS:
            continue
        if not follow or await call.request.is_disconnected():
            return
        silent_s = 0.0 if events else silent_s + poll_s
        if silent_s >= _KEEP_ALIVE_S:
            silent_s = 0.0
            yield ": still here\n\n"
        await asyncio.sleep(poll_s)


def _events(lab: Lab, after: int) -> list[dict[str, Any]]:
    with lab.database.read() as session:
        rows = session.scalars(select(Event).where(Event.id > after).order_by(Event.id).limit(_MOST_EVENTS))
        return [
            {
                "id": row.id,
                "kind": row.kind,
                "subject_id": row.subject_id,
                "at": row.at.isoformat(),
                **row.content,
            }
            for row in rows
        ]
