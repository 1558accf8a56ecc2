"""What happened: the audit log for people, numbered events for listeners."""

from __future__ import annotations

from typing import Any

from sqlalchemy import text
from sqlalchemy.orm import Session

from service.store.access import AuditEntry
from service.store.work import Event

_EVENT_LOCK = 0x7265_7369  # any number nobody else locks in this database


def note(session: Session, who: str, action: str, subject: str, **content: Any) -> None:
    """Add a line to the audit log, in the transaction of what it speaks of.

    Args:
        session: a writing transaction.
        who: token name.
        action: verb and noun, such as ``calibration.accept``.
        subject: identifier of what was acted on.
        content: further facts; never secrets.
    """
    session.add(AuditEntry(who=who, action=action, subject=subject, content=content))


def announce(session: Session, kind: str, subject_id: str, **content: Any) -> None:
    """Add a numbered event, in the transaction of the change.

    Args:
        session: a writing transaction.
        kind: noun and state, such as ``job.running``.
        subject_id: identifier of what changed.
        content: what a listener may want to show.
    """
    if session.get_bind().dialect.name == "postgresql":
        # numbers must become visible in their order, or a listener that continues after n misses n - 1
        session.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _EVENT_LOCK})
    session.add(Event(kind=kind, subject_id=subject_id, content=content))
    session.flush()
