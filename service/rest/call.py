"""One request of one caller: authenticated, repeatable, audited."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import Annotated, Any

from fastapi import Depends, Header, Request, Security
from fastapi.responses import JSONResponse
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from pydantic import BaseModel
from sqlalchemy import delete
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from service.refusals import KeyReused, Unauthenticated
from service.rest.lab import Lab
from service.store.access import RememberedRequest
from service.store.base import now
from service.tokens import Caller, caller_of

_BEARER = HTTPBearer(
    auto_error=False,
    description="The token that `residuum serve` printed at its first start, or one made from it.",
)
IdempotencyKey = Annotated[
    str | None,
    Header(description="A repeated request with the same key gets the first answer and acts once.",
           min_length=1, max_length=128, pattern=r"^[\x20-\x7e]+$"),
]  # fmt: skip


@dataclass(frozen=True)
class Reply:
    """An answer: status, content, and where the new thing is."""

    status: int
    content: dict[str, Any]
    location: str | None = None


@dataclass(frozen=True)
class Call:
    """A request with its caller.

    Attributes:
        lab: the server's belongings.
        caller: who asks.
        request: as it came.
        key: idempotency key, or None.
    """

    lab: Lab
    caller: Caller
    request: Request
    key: str | None

    def change(self, body: BaseModel | None, act: Callable[[Session], Reply]) -> JSONResponse:
        """Act in one transaction, once for each idempotency key.

        Args:
            body: of the request; the same key with another body is refused.
            act: makes the change and says what to answer.

        Returns:
            The answer; the remembered one when the key has been used.
        """
        digest = self._digest(body)
        try:
            reply = self._act_once(digest, act)
        except IntegrityError:
            if self.key is None:
                raise
            reply = self._act_once(digest, act)  # the same key came twice at once: the other one won
        self.lab.compute.ring()
        return JSONResponse(
            reply.content, reply.status, {"Location": reply.location} if reply.location else None
        )

    def _act_once(self, digest: str, act: Callable[[Session], Reply]) -> Reply:
        with self.lab.database.write() as session:
            if self.key is None:
                return act(session)
            oldest = now() - timedelta(days=self.lab.config.access.key_days)
            session.execute(delete(RememberedRequest).where(RememberedRequest.at < oldest))
            known = session.get(RememberedRequest, (self.caller.name, self.key))
            if known is None:
                reply = act(session)
                session.add(self._remembered(digest, reply))
                return reply
            if known.digest != digest:
                raise KeyReused(
                    f"The idempotency key '{self.key}' was used for another request", "choose a new key"
                )
            return Reply(known.status, known.content, known.location)

    def _digest(self, body: BaseModel | None) -> str:
        text = body.model_dump_json() if body is not None else ""
        url = self.request.url
        return hashlib.sha256(f"{self.request.method} {url.path}?{url.query}\n{text}".encode()).hexdigest()

    def _remembered(self, digest: str, reply: Reply) -> RememberedRequest:
        return RememberedRequest(
            owner=self.caller.name,
            key=self.key,
            digest=digest,
            status=reply.status,
            location=reply.location,
            content=reply.content,
        )


def needs(scope: str) -> Any:
    """Make the dependency of a handler that needs a scope.

    Args:
        scope: of ``service.tokens.SCOPES``.

    Returns:
        What annotates the handler's ``call`` parameter.
    """

    def authenticate(
        request: Request,
        credentials: Annotated[HTTPAuthorizationCredentials | None, Security(_BEARER)],
        idempotency_key: IdempotencyKey = None,
    ) -> Call:
        lab: Lab = request.app.state.lab
        caller = authenticated(lab, request, credentials.credentials if credentials else None)
        caller.require(scope)
        return Call(lab, caller, request, idempotency_key)

    def authenticate_reader(
        request: Request, credentials: Annotated[HTTPAuthorizationCredentials | None, Security(_BEARER)]
    ) -> Call:
        return authenticate(request, credentials)

    return Depends(authenticate_reader if scope == "read" else authenticate)


def authenticated(lab: Lab, request: Request, token: str | None) -> Caller:
    """Find the caller, and slow down who guesses."""
    address = request.client.host if request.client else "unknown"
    lab.brake.check(address)
    try:
        with lab.database.read() as session:
            return caller_of(session, token)
    except Unauthenticated:
        if token:  # a missing token is no guess
            lab.brake.fail(address)
        raise


Reader = Annotated[Call, needs("read")]
Runner = Annotated[Call, needs("run")]
Accepter = Annotated[Call, needs("accept")]
Admin = Annotated[Call, needs("admin")]
