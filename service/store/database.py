"""The database: SQLite beside the recordings, or PostgreSQL by URL; reading and writing transactions."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config as AlembicConfig
from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, NoSuchModuleError, OperationalError
from sqlalchemy.orm import Session

from service.errors import UsageError

_BUSY_MS = 15_000  # how long a writer waits for another before it gives up
_SQLITE_ARGUMENTS = {"check_same_thread": False, "timeout": _BUSY_MS / 1000}


def _strict(content: Any) -> str:
    return json.dumps(content, allow_nan=False)


class Database:
    """Transactions on one database.

    Args:
        url: SQLAlchemy URL.

    Raises:
        UsageError: not a URL, or its driver is missing.
    """

    def __init__(self, url: str) -> None:
        self.engine = _engine(url)
        self._writing = self.engine.execution_options(writing=True)

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A transaction that only looks; never blocked by writers."""
        with Session(self.engine, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A transaction that is either wholly kept or wholly undone; on SQLite one at a time."""
        with Session(self._writing, expire_on_commit=False) as session, session.begin():
            yield session

    def migrate(self) -> None:
        """Bring the tables to the newest version; does nothing when they are."""
        try:
            with self._writing.begin() as connection:
                command.upgrade(alembic_config(connection), "head")
        except OperationalError as error:
            shown = self.engine.url.render_as_string(hide_password=True)
            raise UsageError(
                f"The database {shown} cannot be opened: {error.orig}; "
                "check storage.database and that the database server runs."
            ) from error

    def close(self) -> None:
        """Close every connection."""
        self.engine.dispose()


def alembic_config(connection: Connection | None) -> AlembicConfig:
    """Alembic's settings, without a file of its own."""
    config = AlembicConfig()
    config.set_main_option("script_location", str(resources.files("service.store") / "migrations"))
    config.attributes["connection"] = connection
    return config


def _engine(url: str) -> Engine:
    try:
        parsed = make_url(url)
        if parsed.get_backend_name() == "sqlite":
            return _sqlite(url, parsed.database)
        return create_engine(url, json_serializer=_strict, pool_pre_ping=True, pool_size=8, max_overflow=16)
    except (ArgumentError, NoSuchModuleError) as error:
        raise UsageError(
            f"storage.database is not a usable database URL: {error}; "
            "use sqlite:///path or postgresql+psycopg://user@host/name."
        ) from error
    except ModuleNotFoundError as error:
        raise UsageError(
            f"storage.database needs the Python package '{error.name}', which is not installed; "
            f"pip install '{error.name}[binary]'."
        ) from error


def _sqlite(url: str, path: str | None) -> Engine:
    if path:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
    engine = create_engine(url, json_serializer=_strict, connect_args=_SQLITE_ARGUMENTS)

    @event.listens_for(engine, "connect")
    def _prepare(connection: Any, _record: Any) -> None:
        connection.isolation_level = None  # transactions are begun below, not by the driver's guess
        for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", f"busy_timeout={_BUSY_MS}"):
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        # a writer that starts as a reader can be refused half-way; one that says so waits its turn
        writing = connection.get_execution_options().get("writing", False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")

    return engine
