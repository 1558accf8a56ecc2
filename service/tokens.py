"""Tokens: made from chance, shown once, kept as digests; scopes; brakes on guessing."""

from __future__ import annotations

import hashlib
import secrets
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.audit import note
from service.refusals import Conflict, Forbidden, NotFound, TooManyFailures, Unauthenticated, Unusable
from service.store.access import Token
from service.store.base import now

SCOPES = ("read", "run", "accept", "admin")
_PREFIX = "residuum_"  # so that scanners of leaked secrets can know one
_MOST_ADDRESSES = 10_000  # remembered failures: an attacker must not fill the memory either


@dataclass(frozen=True)
class Caller:
    """Who asks, and what they may do.

    Attributes:
        name: of the token.
        scopes: read is in all of them; admin holds every scope.
    """

    name: str
    scopes: frozenset[str]

    def require(self, scope: str) -> None:
        """Refuse without the scope."""
        if scope not in self.scopes:
            raise Forbidden(
                f"The token '{self.name}' lacks the scope '{scope}'",
                f"ask an admin for a token with '{scope}'",
            )


def digest_of(token: str) -> str:
    """Digest under which a token is kept; 256 random bits need no salt and no slow hash."""
    return hashlib.sha256(token.encode()).hexdigest()


def make_token(
    session: Session, name: str, scopes: Iterable[str], by: str, days: float | None = None
) -> tuple[Token, str]:
    """Make a token.

    Args:
        session: a writing transaction.
        name: unique.
        scopes: of ``SCOPES``.
        by: who makes it.
        days: until it expires; None for never.

    Returns:
        The row, and the token itself: shown once, it cannot be found again.
    """
    wanted = set(scopes)
    if not wanted or wanted - set(SCOPES):
        raise Unusable(
            f"Scopes {sorted(wanted)} are not a choice of {', '.join(SCOPES)}", "name at least one of them"
        )
    if session.scalar(select(Token).where(Token.name == name)) is not None:
        raise Conflict(
            f"A token named '{name}' exists", "choose another name; a revoked name stays in the history"
        )
    secret = _PREFIX + secrets.token_urlsafe(32)
    expires = None if days is None else now() + timedelta(days=days)
    row = Token(name=name, digest=digest_of(secret), scopes=" ".join(sorted(wanted)), expires_at=expires)
    session.add(row)
    session.flush()
    note(session, by, "token.make", row.id, name=name, scopes=sorted(wanted))
    return row, secret


def revoke_token(session: Session, token_id: str, by: str) -> Token:
    """Make a token useless from this instant on."""
    row = session.get(Token, token_id)
    if row is None:
        raise NotFound(f"There is no token {token_id}", "list the tokens for their identifiers")
    if row.revoked_at is None:
        row.revoked_at = now()
        note(session, by, "token.revoke", row.id, name=row.name)
    return row


def first_token(session: Session) -> str | None:
    """Make the admin token of a fresh database; None where any token exists."""
    if session.scalar(select(Token.id).limit(1)) is not None:
        return None
    return make_token(session, "first-start", ["admin"], "server")[1]


def caller_of(session: Session, token: str | None) -> Caller:
    """Find who a token belongs to.

    Raises:
        Unauthenticated: none, unknown, expired or revoked; which one is not told.
    """
    row = session.scalar(select(Token).where(Token.digest == digest_of(token))) if token else None
    if row is None or row.revoked_at is not None or (row.expires_at is not None and row.expires_at <= now()):
        raise Unauthenticated(
            "The request carries no valid token",
            "send 'Authorization: Bearer TOKEN' with a token that is not revoked",
        )
    scopes = set(row.scopes.split())
    return Caller(row.name, frozenset(SCOPES if "admin" in scopes else scopes | {"read"}))


class FailureBrake:
    """Lets an address fail only so often in a while.

    Args:
        limit: failures allowed.
        window_s: time over which they count [s].
    """

    def __init__(self, limit: int, window_s: float) -> None:
        self._limit, self._window_s = limit, window_s
        self._failures: dict[str, list[float]] = {}
        self._lock = threading.Lock()

    def check(self, address: str) -> None:
        """Refuse an address that has failed too often.

        Raises:
            TooManyFailures: with the time to wait.
        """
        with self._lock:
            recent = self._recent(address)
            if len(recent) >= self._limit:
                wait_s = recent[0] + self._window_s - time.monotonic()
                raise TooManyFailures(
                    f"{len(recent)} requests from {address} carried no valid token",
                    f"wait {wait_s:.0f} s",
                    wait_s,
                )

    def fail(self, address: str) -> None:
        """Count a failure."""
        with self._lock:
            if len(self._failures) >= _MOST_ADDRESSES:
                self._failures.pop(next(iter(self._failures)))
            self._failures[address] = [*self._recent(address), time.monotonic()]

    def _recent(self, address: str) -> list[float]:
        since = time.monotonic() - self._window_s
        recent = [instant for instant in self._failures.get(address, ()) if instant > since]
        if not recent:
            self._failures.pop(address, None)
        return recent
