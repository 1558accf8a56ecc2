"""Tables of what fits are made from: robots, recordings, excitations."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import BigInteger, ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from service.store.base import Base, new_id, now


class Robot(Base):
    """One machine, known by its serial number."""

    __tablename__ = "robots"
    serial: Mapped[str] = mapped_column(primary_key=True)
    name: Mapped[str]
    simulated: Mapped[bool]
    unattended: Mapped[bool] = mapped_column(default=False)
    model_hash: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)


class RobotModel(Base):
    """One version of a robot's description; never changed, only added."""

    __tablename__ = "robot_models"
    __table_args__ = (UniqueConstraint("robot_serial", "model_hash", name="uq_robot_models_version"),)
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"))
    model_hash: Mapped[str]
    toml_text: Mapped[str]
    urdf_text: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)


class Recording(Base):
    """A log file, stored under the digest of its bytes."""

    __tablename__ = "recordings"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    sha256: Mapped[str] = mapped_column(unique=True)
    label: Mapped[str]
    size_bytes: Mapped[int] = mapped_column(BigInteger)
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    kind: Mapped[str]
    simulated: Mapped[bool]
    facts: Mapped[dict[str, Any]]
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)


class Excitation(Base):
    """A designed motion; its content comes with its job."""

    __tablename__ = "excitations"
    id: Mapped[str] = mapped_column(primary_key=True, default=new_id)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id"))
    robot_serial: Mapped[str] = mapped_column(ForeignKey("robots.serial"), index=True)
    model_hash: Mapped[str]
    options: Mapped[dict[str, Any]]
    content: Mapped[dict[str, Any] | None]
    created_at: Mapped[datetime] = mapped_column(default=now)
