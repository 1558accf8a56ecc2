"""Migrations, transactions, and history that cannot be rewritten, on both databases."""

import threading
from datetime import UTC, datetime, timedelta, timezone

import pytest
from alembic.autogenerate import compare_metadata
from alembic.command import downgrade
from alembic.migration import MigrationContext
from sqlalchemy import inspect, select, text
from sqlalchemy.exc import DBAPIError

from service.audit import announce, note
from service.errors import UsageError
from service.store.access import AuditEntry
from service.store.assets import Recording, Robot
from service.store.database import Database, alembic_config
from service.store.results import CalibrationEvent
from service.store.schema import APPEND_ONLY, METADATA
from service.store.work import Event
from tests.service.store import lab


def test_the_migrations_make_exactly_the_tables_of_the_code(database):
    with database.engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), METADATA) == []


def test_migrating_twice_changes_nothing_and_the_way_back_leaves_nothing(database):
    database.migrate()
    with database._writing.begin() as connection:
        downgrade(alembic_config(connection), "base")
    assert inspect(database.engine).get_table_names() == ["alembic_version"]
    database.migrate()


def test_a_failed_transaction_leaves_nothing(database):
    with pytest.raises(RuntimeError), database.write() as session:
        lab.add_robot(session)
        raise RuntimeError("in the middle")
    with database.read() as session:
        assert session.scalars(select(Robot)).all() == []
        assert session.scalars(select(AuditEntry)).all() == []


@pytest.mark.parametrize("table", APPEND_ONLY)
def test_the_database_refuses_to_rewrite_history(database, table):
    from service import calibrations

    with database.write() as session:
        lab.add_robot(session)
        estimate = lab.add_estimate(session)
        calibrations.propose(session, estimate.id, calibrations.Change("test", ""))
        note(session, "me", "test", "it")
        session.execute(
            text(
                "INSERT INTO nights (id, robot_serial, outcome, sentence, content, created_by, created_at) "
                "VALUES ('n', 'IR-1', 'ok', '', '{}', 'test', '2026-01-01 00:00:00')"
            )
        )
    for statement in (f"DELETE FROM {table}", f"UPDATE {table} SET id = id"):
        with pytest.raises(DBAPIError, match="only ever added"), database.write() as session:
            session.execute(text(statement))


def test_the_database_itself_refuses_a_simulated_result_on_a_real_robot(database):
    from service import calibrations

    with database.write() as session:
        lab.add_robot(session)
        row = calibrations.propose(
            session, lab.add_estimate(session, simulated=True).id, calibrations.Change("test", "")
        )
    with pytest.raises(DBAPIError), database.write() as session:
        session.add(
            CalibrationEvent(
                calibration_id=row.id,
                robot_serial="IR-1",
                event="accept",
                state="accepted",
                simulated=True,
                robot_simulated=False,
                reason="",
                by="somebody with the password of the database",
            )
        )


def test_large_files_and_instants_of_any_zone_survive(database):
    with database.write() as session:
        lab.add_robot(session)
        row = lab.add_recording(session)
        row.created_at = datetime(2026, 7, 1, 12, 0, 0, 123456, tzinfo=timezone(timedelta(hours=2)))
    with database.read() as session:
        found = session.get_one(Recording, row.id)
    assert found.size_bytes == 3_000_000_000
    assert found.created_at == datetime(2026, 7, 1, 10, 0, 0, 123456, tzinfo=UTC)
    assert found.created_at.tzinfo is UTC


def test_a_local_time_is_refused(database):
    with pytest.raises(DBAPIError.__mro__[1], match="time zone"), database.write() as session:
        lab.add_robot(session)
        lab.add_recording(session).created_at = datetime(2026, 7, 1)


def test_writers_wait_for_each_other_and_events_are_numbered_in_order(database):
    def add(worker):
        for k in range(20):
            with database.write() as session:
                announce(session, "test", f"{worker}-{k}", k=k)

    threads = [threading.Thread(target=add, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with database.read() as session:
        events = session.scalars(select(Event).order_by(Event.id)).all()
    assert len(events) == 80
    for worker in range(4):
        mine = [event.content["k"] for event in events if event.subject_id.startswith(f"{worker}-")]
        assert mine == sorted(mine)


def test_readers_are_not_blocked_by_a_writer(database):
    with database.write() as session:
        lab.add_robot(session)
        with database.read() as other:
            assert other.scalars(select(Robot)).all() == []


def test_infinity_does_not_enter(database):
    with pytest.raises(Exception, match="JSON compliant"), database.write() as session:
        announce(session, "test", "x", value=float("inf"))


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("nonsense", "not a usable database URL"),
        ("mysterious://x", "not a usable database URL"),
        ("sqlite:////proc/none/state.sqlite", "No such file"),
    ],
)
def test_an_unusable_url_is_one_sentence(url, says):
    with pytest.raises((UsageError, OSError), match=says):
        Database(url).migrate()
