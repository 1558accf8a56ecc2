"""Tables of what is going on: jobs, runs, leases, events."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from service.store.base import Base, new_id, now


class Job(Base):
    """A computation that a worker process carries out."""

    __tablename__ = "jobs"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    kind: Mapped[str]
    subject_id: Mapped[str]
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    state: Mapped[str] = mapped_column(default="queued", index=True)
    stage: Mapped[str] = mapped_column(default="waiting for a worker")
    progress: Mapped[float] = mapped_column(default=0.0)
    attempts: Mapped[int] = mapped_column(default=0)
    cancel_requested: Mapped[bool] = mapped_column(default=False)
    error: Mapped[dict[str, Any] | None]
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]


class Run(Base):
    """A motion of a robot: previewed, confirmed, recorded."""

    __tablename__ = "runs"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    state: Mapped[str] = mapped_column(default="previewed", index=True)
    simulated: Mapped[bool]
    request: Mapped[dict[str, Any]]
    preview: Mapped[dict[str, Any]]
    progress: Mapped[dict[str, Any] | None]
    process_id: Mapped[int | None]
    recording_id: Mapped[str | None] = mapped_column(ForeignKey("recordings.id"))
    error: Mapped[dict[str, Any] | None]
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)
    finished_at: Mapped[datetime | None]


class Lease(Base):
    """Who has a robot, and until when."""

    __tablename__ = "leases"
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), primary_key=True)
    owner: Mapped[str]
    purpose: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)
    expires_at: Mapped[datetime]


class Event(Base):
    """Something that changed; numbered, so that a listener can continue where it left off."""

    __tablename__ = "events"
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    kind: Mapped[str]
    subject_id: Mapped[str] = mapped_column(index=True)
    content: Mapped[dict[str, Any]]
    at: Mapped[datetime] = mapped_column(default=now)
