"""Leases: one owner a robot, until they give it back or their time is over."""

from __future__ import annotations

from datetime import timedelta

from sqlalchemy.orm import Session

from service.audit import announce, note
from service.refusals import LeaseHeld, LeaseNeeded, Unusable
from service.registry import robot_row
from service.store.base import now
from service.store.work import Lease


def current_lease(session: Session, serial: str) -> Lease | None:
    """The lease that holds now; expired ones do not."""
    lease = session.get(Lease, serial)
    return lease if lease is not None and lease.expires_at > now() else None


def take_lease(
    session: Session, serial: str, owner: str, minutes: float, purpose: str, limit_min: float
) -> Lease:
    """Take a robot, or keep it longer.

    Args:
        session: a writing transaction.
        serial: the robot.
        owner: token name.
        minutes: from now [min].
        purpose: shown to whoever else wants it.
        limit_min: longest allowed [min].

    Raises:
        LeaseHeld: somebody else has it.
        Unusable: too long.
    """
    robot_row(session, serial)
    if not 0 < minutes <= limit_min:
        raise Unusable(
            f"A lease of {minutes:g} min is outside 0 to {limit_min:g} min", "ask for less and renew it"
        )
    held = current_lease(session, serial)
    if held is not None and held.owner != owner:
        until = held.expires_at.isoformat(timespec="seconds")
        why = f" for {held.purpose}" if held.purpose else ""
        raise LeaseHeld(
            f"Robot {serial} is leased to '{held.owner}'{why} until {until}",
            "wait, or ask them to give it back",
        )
    lease = session.merge(
        Lease(
            robot_serial=serial,
            owner=owner,
            purpose=purpose,
            created_at=now(),
            expires_at=now() + timedelta(minutes=minutes),
        )
    )
    note(session, owner, "lease.take", serial, minutes=minutes, purpose=purpose)
    announce(session, "lease.taken", serial, owner=owner, expires_at=lease.expires_at.isoformat())
    return lease


def end_lease(session: Session, serial: str, by: str, *, is_admin: bool = False) -> None:
    """Give a robot back; an admin can end anybody's lease."""
    held = current_lease(session, serial)
    if held is None:
        return
    if held.owner != by and not is_admin:
        raise LeaseHeld(
            f"Robot {serial} is leased to '{held.owner}', not to '{by}'", "only they or an admin can end it"
        )
    session.delete(held)
    note(session, by, "lease.end", serial, owner=held.owner)
    announce(session, "lease.ended", serial, owner=held.owner)


def require_lease(session: Session, serial: str, owner: str) -> None:
    """Refuse who does not have the robot.

    Raises:
        LeaseHeld: somebody else has it.
        LeaseNeeded: nobody has it.
    """
    held = current_lease(session, serial)
    if held is None:
        raise LeaseNeeded(
            f"Robot {serial} is not leased by '{owner}'", f"POST /v1/robots/{serial}/lease first"
        )
    if held.owner != owner:
        raise LeaseHeld(f"Robot {serial} is leased to '{held.owner}'", "wait until the lease ends")
