"""Errors as ``application/problem+json``: stable code, cause, remedy."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.exc import IntegrityError, OperationalError
from starlette.exceptions import HTTPException

from service.errors import ServiceError
from service.faults import fault_of
from service.refusals import Conflict, TooManyFailures

_STATUS_OF_EXIT = {2: 422, 3: 503, 4: 422}
_TITLES = {
    400: "Bad request",
    401: "Not authenticated", 403: "Not allowed", 404: "Not found", 405: "Method not allowed",
    409: "Conflict", 413: "Too large", 416: "No such range", 422: "Not usable", 429: "Too many failures",
    500: "Internal error", 503: "Not available",
}  # fmt: skip


class Problem(BaseModel):
    """What went wrong (RFC 9457)."""

    type: str = Field(examples=["urn:residuum:problem:not_found"])
    title: str = Field(examples=["Not found"])
    status: int = Field(examples=[404])
    detail: str = Field(
        description="The whole sentence.",
        examples=["There is no job 01; list the jobs for their identifiers."],
    )
    code: str = Field(description="Stable; for programs.", examples=["not_found"])
    cause: str = Field(examples=["There is no job 01"])
    remedy: str = Field(examples=["list the jobs for their identifiers"])


def problem_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Entries of the API description for these error statuses."""
    content = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {status: {"description": _TITLES[status], "content": content} for status in statuses}


def problem(
    status: int, code: str, cause: str, remedy: str, headers: dict[str, str] | None = None
) -> JSONResponse:
    """Make a problem response."""
    content = {
        "type": f"urn:residuum:problem:{code}", "title": _TITLES.get(status, "Error"), "status": status,
        "detail": f"{cause}; {remedy}.", "code": code, "cause": cause, "remedy": remedy,
    }  # fmt: skip
    return JSONResponse(content, status, headers, "application/problem+json")


def problem_of(error: Exception) -> JSONResponse:
    """Make the response of an error."""
    fault = fault_of(error)
    status = getattr(error, "status", None) or _STATUS_OF_EXIT.get(fault["exit_code"], 500)
    headers = {}
    if isinstance(error, TooManyFailures):
        headers["Retry-After"] = str(max(1, round(error.wait_s)))
    if status == 401:
        headers["WWW-Authenticate"] = "Bearer"
    return problem(status, fault["code"], fault["cause"], fault["remedy"], headers)


async def _on_error(_request: Request, error: Exception) -> JSONResponse:
    return problem_of(error)


async def _on_http(_request: Request, error: Exception) -> JSONResponse:
    status = getattr(error, "status_code", 500)
    codes = {404: "not_found", 405: "method_not_allowed", 413: "too_large"}
    cause = str(getattr(error, "detail", "")) or _TITLES.get(status, "Error")
    return problem(
        status,
        codes.get(status, "http_error"),
        cause,
        "see /docs for what there is",
        getattr(error, "headers", None),
    )


async def _on_invalid(_request: Request, error: Exception) -> JSONResponse:
    first = error.errors()[0]  # type: ignore[attr-defined]
    place = ".".join(str(part) for part in first["loc"])
    cause = f"{place}: {first['msg']}".encode("utf-8", "replace").decode()
    return problem(422, "invalid_request", cause, "correct it as /docs describes")


async def _on_database(_request: Request, error: Exception) -> JSONResponse:
    if isinstance(error, IntegrityError):
        return problem_of(
            Conflict("Another request changed the same thing at this instant", "look at it and try again")
        )
    return problem(
        503,
        "database_unavailable",
        "The database does not answer",
        "try again shortly; the server's log says more",
    )


def install_problems(app: FastAPI) -> None:
    """Let every error of the app end as a problem."""
    from daq.errors import DaqError
    from drivers.errors import DriverError
    from identify.errors import IdentifyError

    for tree in (ServiceError, DaqError, DriverError, IdentifyError):
        app.add_exception_handler(tree, _on_error)
    app.add_exception_handler(HTTPException, _on_http)
    app.add_exception_handler(RequestValidationError, _on_invalid)
    app.add_exception_handler(IntegrityError, _on_database)
    app.add_exception_handler(OperationalError, _on_database)
