"""The web pages: files of this package, nothing from elsewhere."""

from __future__ import annotations

from importlib import resources

from fastapi import APIRouter
from fastapi.responses import HTMLResponse, Response

router = APIRouter(include_in_schema=False)
_TYPES = {"css": "text/css", "js": "text/javascript"}
_ASSETS = ("style.css", "app.js", "chart.js", "docs.js")


def _read(name: str) -> str:
    return (resources.files("service") / "web" / name).read_text(encoding="utf-8")


@router.get("/")
def show_page() -> HTMLResponse:
    """The lab at a glance."""
    return HTMLResponse(_read("index.html"))


@router.get("/docs")
def show_docs() -> HTMLResponse:
    """The API for people, without a connection to anywhere."""
    return HTMLResponse(_read("docs.html"))


@router.get("/web/{name}")
def show_asset(name: str) -> Response:
    """Script and style of the pages."""
    if name not in _ASSETS:
        return Response(status_code=404)
    return Response(_read(name), media_type=_TYPES[name.rpartition(".")[2]])
