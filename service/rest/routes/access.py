"""Tokens and the audit log."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.rest.call import Admin, Reader, Reply
from service.rest.paging import Key, Limit, Page, page_of
from service.rest.problems import problem_responses
from service.rest.views import AuditView, TokenView
from service.store.access import AuditEntry, Token
from service.tokens import make_token, revoke_token

router = APIRouter(tags=["access"], responses=problem_responses(401, 403, 422, 429))
Number = Annotated[int | None, Query(ge=0, le=2**31 - 1, description="`next` of the page before.")]


class TokenRequest(BaseModel):
    """A token to make."""

    name: str = Field(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", examples=["nightly-timer"])
    scopes: list[Literal["read", "run", "accept", "admin"]] = Field(min_length=1, max_length=4)
    days: float | None = Field(
        None, gt=0, le=36_500, allow_inf_nan=False, description="Until it expires; never when left out."
    )


class NewTokenView(TokenView):
    """A token, this one time with the token itself."""

    token: str = Field(description="Shown once; the server keeps only its digest.")


class CallerView(BaseModel):
    """Who is asking."""

    name: str
    scopes: list[str]


@router.get("/me", response_model=CallerView)
def show_caller(call: Reader) -> Any:
    """Show whose token this is and what it may do."""
    return CallerView(name=call.caller.name, scopes=sorted(call.caller.scopes))


@router.get("/tokens", response_model=list[TokenView])
def list_tokens(call: Admin) -> Any:
    """List tokens; never the tokens themselves."""
    with call.lab.database.read() as session:
        return [TokenView.model_validate(row) for row in session.scalars(select(Token).order_by(Token.id))]


@router.post("/tokens", status_code=201, response_model=NewTokenView, responses=problem_responses(409))
def make(call: Admin, body: TokenRequest) -> JSONResponse:
    """Make a token. Its answer is never remembered for an idempotency key: it holds the secret."""
    with call.lab.database.write() as session:
        row, secret = make_token(session, body.name, body.scopes, call.caller.name, body.days)
        content = TokenView.model_validate(row).json_content() | {"token": secret}
    return JSONResponse(content, 201)


@router.delete("/tokens/{key}", response_model=TokenView, responses=problem_responses(404))
def revoke(call: Admin, key: Key) -> JSONResponse:
    """Revoke a token, at once and for ever."""

    def act(session: Session) -> Reply:
        return Reply(
            200, TokenView.model_validate(revoke_token(session, key, call.caller.name)).json_content()
        )

    return call.change(None, act)


@router.get("/audit", response_model=Page[AuditView])
def list_audit(
    call: Admin,
    limit: Limit = 50,
    after: Number = None,
    who: Annotated[str | None, Query(max_length=64, pattern=r"^[^\x00]*$")] = None,
    action: Annotated[str | None, Query(max_length=64, pattern=r"^[^\x00]*$")] = None,
) -> Any:
    """List who did what, newest first; nobody can change it."""
    with call.lab.database.read() as session:
        filters = {AuditEntry.who: who, AuditEntry.action: action}
        return page_of(session, AuditEntry.id, filters, limit, after, AuditView.model_validate)
