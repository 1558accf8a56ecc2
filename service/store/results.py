"""Tables of what was found: fits, estimates, diagnoses, calibrations, nights."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import CheckConstraint, ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from service.store.base import Base, new_id, now


class Fit(Base):
    """A request to identify one recording, with its options."""

    __tablename__ = "fits"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id"))
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    recording_id: Mapped[str] = mapped_column(ForeignKey("recordings.id"), index=True)
    validation_id: Mapped[str | None] = mapped_column(ForeignKey("recordings.id"))
    options: Mapped[dict[str, Any]]
    estimate_id: Mapped[str | None]
    created_at: Mapped[datetime] = mapped_column(default=now)


class Estimate(Base):
    """What a fit found; never changed."""

    __tablename__ = "estimates"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    fit_id: Mapped[str] = mapped_column(ForeignKey("fits.id"))
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    recording_id: Mapped[str] = mapped_column(ForeignKey("recordings.id"))
    model_hash: Mapped[str]
    simulated: Mapped[bool]
    intervals_valid: Mapped[bool]
    content: Mapped[dict[str, Any]]
    created_at: Mapped[datetime] = mapped_column(default=now)


class Diagnosis(Base):
    """A diagnosis; verdict and content come with its job."""

    __tablename__ = "diagnoses"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id"))
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    recording_id: Mapped[str] = mapped_column(ForeignKey("recordings.id"), index=True)
    validation_id: Mapped[str | None] = mapped_column(ForeignKey("recordings.id"))
    options: Mapped[dict[str, Any]]
    verdict: Mapped[str | None]
    simulated: Mapped[bool | None]
    content: Mapped[dict[str, Any] | None]
    created_at: Mapped[datetime] = mapped_column(default=now)


class Calibration(Base):
    """An estimate put forward for use; its state is that of its last event."""

    __tablename__ = "calibrations"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    model_hash: Mapped[str]
    estimate_id: Mapped[str] = mapped_column(ForeignKey("estimates.id"), unique=True)
    simulated: Mapped[bool]
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)


class CalibrationEvent(Base):
    """One change of a calibration; only ever added."""

    __tablename__ = "calibration_events"
    __table_args__ = (
        # the last line of defence: the database itself refuses a simulated result on a real robot
        CheckConstraint("NOT (state = 'accepted' AND simulated AND NOT robot_simulated)", name="simulated"),
    )
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibrations.id"), index=True)
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    event: Mapped[str]
    state: Mapped[str]
    simulated: Mapped[bool]
    robot_simulated: Mapped[bool]
    reason: Mapped[str]
    by: Mapped[str]
    at: Mapped[datetime] = mapped_column(default=now)


class Night(Base):
    """What one nightly recalibration did and concluded; only ever added."""

    __tablename__ = "nights"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    outcome: Mapped[str]
    sentence: Mapped[str]
    estimate_id: Mapped[str | None] = mapped_column(ForeignKey("estimates.id"))
    content: Mapped[dict[str, Any]]
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)
