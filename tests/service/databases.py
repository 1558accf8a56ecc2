"""Databases for tests: SQLite always, PostgreSQL where Debian's package and the driver are there."""

import contextlib
import glob
import importlib.util
import os
import pwd
import shutil
import subprocess
import tempfile
import uuid
from functools import cache
from pathlib import Path

import pytest
from sqlalchemy.engine import make_url

from service.store.database import Database

BACKENDS = ("sqlite", "postgresql")


@cache
def missing_postgres():
    """Why PostgreSQL cannot be tested here; empty where it can."""
    if not glob.glob("/usr/lib/postgresql/*/bin/initdb"):
        return "PostgreSQL is not installed (apt-get install -y postgresql)"
    if importlib.util.find_spec("psycopg") is None:
        return "the Python package psycopg is not installed"
    return ""


@contextlib.contextmanager
def postgres_server():
    """A server of our own on a Unix socket, never as root, gone afterwards."""
    if missing_postgres():
        yield None
        return
    programs = sorted(glob.glob("/usr/lib/postgresql/*/bin"))[-1]
    user = "postgres" if os.getuid() == 0 else None
    folder = tempfile.mkdtemp(prefix="residuum-pg-", dir="/tmp")
    if user:
        os.chown(folder, pwd.getpwnam(user).pw_uid, -1)

    def call(*command):
        subprocess.run(command, check=True, capture_output=True, user=user, cwd=folder)

    data = f"{folder}/data"
    call(f"{programs}/initdb", "-D", data, "-U", "lab", "-A", "trust", "--no-sync")
    options = f"-c listen_addresses='' -c unix_socket_directories={folder} -c fsync=off"
    call(f"{programs}/pg_ctl", "-D", data, "-w", "-l", f"{folder}/log", "-o", options, "start")
    try:
        yield folder
    finally:
        call(f"{programs}/pg_ctl", "-D", data, "-w", "-m", "immediate", "stop")
        shutil.rmtree(folder, ignore_errors=True)


def fresh_url(backend, folder: Path, server, template="template0"):
    """URL of an empty database, or of a copy of another one."""
    if backend == "sqlite":
        return f"sqlite:///{folder / 'state.sqlite'}"
    if server is None:
        pytest.skip(missing_postgres())
    from sqlalchemy import create_engine, text

    name = f"t{uuid.uuid4().hex}"
    engine = create_engine(f"postgresql+psycopg://lab@/postgres?host={server}", isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name} TEMPLATE {template}"))
    engine.dispose()
    return f"postgresql+psycopg://lab@/{name}?host={server}"


@cache
def migrated(backend, server):
    """URL of a migrated database that nobody writes to: tests take copies of it."""
    url = fresh_url(backend, Path(tempfile.mkdtemp(prefix="residuum-template-")), server)
    database = Database(url)
    database.migrate()
    database.close()
    return make_url(url)


@contextlib.contextmanager
def fresh_database(backend, folder, server):
    """An empty, migrated database."""
    template = migrated(backend, server)
    if backend == "sqlite":
        shutil.copy(template.database, folder / "state.sqlite")
    database = Database(fresh_url(backend, folder, server, template.database))
    try:
        yield database
    finally:
        database.close()
