"""Tables of access: tokens, the audit log, remembered requests."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy.orm import Mapped, mapped_column

from service.store.base import Base, new_id, now


class Token(Base):
    """A token's digest and what it may do; the token itself is nowhere."""

    __tablename__ = "tokens"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    name: Mapped[str] = mapped_column(unique=True)
    digest: Mapped[str] = mapped_column(unique=True)
    scopes: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)
    expires_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]


class AuditEntry(Base):
    """Who did what; only ever added."""

    __tablename__ = "audit_log"
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    who: Mapped[str] = mapped_column(index=True)
    action: Mapped[str] = mapped_column(index=True)
    subject: Mapped[str]
    content: Mapped[dict[str, Any]]
    at: Mapped[datetime] = mapped_column(default=now)


class RememberedRequest(Base):
    """The answer given to an idempotency key."""

    __tablename__ = "remembered_requests"
    owner: Mapped[str] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    digest: Mapped[str]
    status: Mapped[int]
    location: Mapped[str | None]
    content: Mapped[dict[str, Any]]
    at: Mapped[datetime] = mapped_column(default=now, index=True)
