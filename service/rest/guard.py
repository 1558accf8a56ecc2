"""Around every request: a limit on bodies, safe headers, counting."""

from __future__ import annotations

import time

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.rest.measures import Traffic

_BODY_BYTES = 10_000_000  # robot descriptions are the largest bodies that are not uploads
_UPLOAD = "/v1/recordings"
_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-frame-options", b"DENY"),
    # reports carry their own style and drawings; nothing ever comes from elsewhere
    (
        b"content-security-policy",
        b"default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        b"frame-ancestors 'none'",
    ),
)


class Guard:
    """ASGI middleware.

    Args:
        app: what it guards.
        traffic: told of every request.
    """

    def __init__(self, app: ASGIApp, traffic: Traffic) -> None:
        self.app, self.traffic = app, traffic

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began_s, status = time.perf_counter(), 500
        received = 0

        async def receive_some() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > _BODY_BYTES and scope["path"] != _UPLOAD:
                raise HTTPException(413, f"The request's body exceeds {_BODY_BYTES // 1_000_000} MB")
            return message

        async def send_safely(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message.get("headers", []), *_HEADERS]
            await send(message)

        try:
            await self.app(scope, receive_some, send_safely)
        finally:
            self.traffic.add(scope["method"], status, time.perf_counter() - began_s)
