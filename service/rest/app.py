"""The app: routes, pages, errors, one lab behind them."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI

from service.rest.guard import Guard
from service.rest.lab import Lab
from service.rest.measures import Traffic
from service.rest.pages import router as pages
from service.rest.problems import Problem, install_problems
from service.rest.routes import (
    access,
    analyses,
    calibrations,
    excitations,
    nights,
    recordings,
    robots,
    runs,
    status,
)

_ROUTERS = (robots, recordings, excitations, runs, analyses, calibrations, nights, access, status)
_ABOUT = """Record robots, identify their dynamics with uncertainty, find the physics a simulation left out.

Send `Authorization: Bearer TOKEN`. Scopes: **read** looks, **run** uploads, computes and moves, **accept**
puts calibrations in force, **admin** manages robots and tokens. POST requests take an `Idempotency-Key`.
What takes long is answered with 202 and a `Location`. Errors are `application/problem+json` with a stable
`code`, the `cause` and the `remedy`."""


def create_app(lab: Lab) -> FastAPI:
    """Make the app.

    Args:
        lab: open; the caller closes it.

    Returns:
        The app.
    """
    app = FastAPI(
        title="Residuum",
        version=lab.version,
        description=_ABOUT,
        docs_url=None,
        redoc_url=None,
        openapi_url="/v1/openapi.json",
        swagger_ui_oauth2_redirect_url=None,
    )
    app.state.lab, app.state.traffic = lab, Traffic()
    for module in _ROUTERS:
        app.include_router(module.router, prefix="/v1")
    app.include_router(pages)
    install_problems(app)
    app.add_middleware(Guard, traffic=app.state.traffic)
    _describe_problems(app)
    return app


def _describe_problems(app: FastAPI) -> None:
    """Put the problem schema into the API description, in place of the framework's own error form."""
    made = app.openapi

    def openapi() -> dict[str, Any]:
        schema = made()
        schemas = schema["components"]["schemas"]
        schemas["Problem"] = Problem.model_json_schema()
        for unused in ("HTTPValidationError", "ValidationError"):
            schemas.pop(unused, None)
        return schema

    app.openapi = openapi  # type: ignore[method-assign]
