"""Lists: newest first, page by page, filtered by equality."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Generic, TypeVar

from fastapi import Path, Query
from pydantic import BaseModel, Field
from sqlalchemy import select
from sqlalchemy.orm import InstrumentedAttribute, Session

Limit = Annotated[int, Query(ge=1, le=200, description="Entries a page.")]
After = Annotated[
    str | None,
    Query(pattern="^[0-9a-f]{1,64}$", description="`next` of the page before; leave out for the first page."),
]
Key = Annotated[str, Path(pattern="^[0-9a-f]{1,64}$", description="Identifier.")]
Serial = Annotated[
    str, Path(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", description="Serial number of the robot.")
]
Filter = Annotated[
    str | None,
    Query(pattern="^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", description="Only entries with this value."),
]


View = TypeVar("View")


class Page(BaseModel, Generic[View]):
    """A part of a list, newest first."""

    items: list[View]
    next: str | None = Field(description="Pass it as `after` for the next page; null on the last one.")


def page_of(
    session: Session,
    key: InstrumentedAttribute[Any],
    filters: Mapping[InstrumentedAttribute[Any], str | bool | None],
    limit: int,
    after: Any,
    view: Callable[[Any], Any],
) -> dict[str, Any]:
    """Read a page.

    Args:
        session: a transaction.
        key: column that orders the list; unique.
        filters: column to wanted value; None does not filter.
        limit: entries.
        after: key of the last entry of the page before, or None.
        view: row to what is shown.

    Returns:
        Content of a ``Page``.
    """
    wanted = select(key.class_).order_by(key.desc()).limit(limit + 1)
    for column, value in filters.items():
        if value is not None:
            wanted = wanted.where(column == value)
    if after is not None:
        wanted = wanted.where(key < after)
    rows = list(session.scalars(wanted))
    more = len(rows) > limit
    shown = rows[:limit]
    following = str(getattr(shown[-1], key.key)) if more else None
    return {"items": [view(row) for row in shown], "next": following}
