"""What clients see of the tables."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy.orm import Session

from service.calibrations import history, state_of
from service.jobs import find_job
from service.leases import current_lease
from service.store.assets import Excitation, Robot
from service.store.results import Calibration, Diagnosis, Estimate, Fit

Text = Annotated[str, Field(max_length=500, pattern=r"^[^\x00]*$")]
Identifier = Annotated[str, Field(pattern="^[0-9a-f]{1,64}$", examples=["019aa5e2c3d41f0c9a1b2c3d4e5f"])]


class View(BaseModel):
    """Something shown."""

    model_config = ConfigDict(from_attributes=True)

    def json_content(self) -> dict[str, Any]:
        """Plain values."""
        return self.model_dump(mode="json")


class LeaseView(View):
    """Who has a robot, and until when."""

    robot_serial: str
    owner: str = Field(description="Token name.")
    purpose: str
    expires_at: datetime


class RobotView(View):
    """A robot."""

    serial: str = Field(examples=["IR361-0007"])
    name: str = Field(examples=["ir361"])
    simulated: bool = Field(description="A virtual robot; never changes.")
    unattended: bool = Field(description="Cleared for motion without a person present.")
    model_hash: str = Field(description="Digest of the current robot file and URDF.")
    created_at: datetime
    lease: LeaseView | None = None

    @classmethod
    def of(cls, session: Session, row: Robot) -> RobotView:
        """The robot with its lease."""
        lease = current_lease(session, row.serial)
        view = cls.model_validate(row)
        return view.model_copy(update={"lease": LeaseView.model_validate(lease) if lease else None})


class RecordingView(View):
    """A stored log."""

    id: str
    label: str = Field(examples=["run.mcap"])
    sha256: str
    size_bytes: int
    robot_serial: str
    kind: str = Field(description="excitation, validation or free.")
    simulated: bool
    facts: dict[str, Any] = Field(description="Duration, joints, samples a stream, warnings of the reader.")
    created_by: str
    created_at: datetime


class JobView(View):
    """A computation in progress, or over."""

    id: str
    kind: str = Field(description="fit, diagnosis or design.")
    subject_id: str = Field(description="The fit, diagnosis or excitation that it fills.")
    robot_serial: str
    state: str = Field(
        description="queued, running, done, failed, cancelled or interrupted.", examples=["running"]
    )
    stage: str
    progress: float = Field(ge=0, le=1)
    attempts: int
    error: dict[str, Any] | None = Field(description="Code, cause and remedy where it failed.")
    created_by: str
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None


class FitView(View):
    """A fit of one recording."""

    id: str
    robot_serial: str
    recording_id: str
    validation_id: str | None
    options: dict[str, Any]
    estimate_id: str | None = Field(description="Null until the job is done.")
    created_at: datetime
    job: JobView | None = None

    @classmethod
    def of(cls, session: Session, row: Fit) -> FitView:
        """The fit with its job."""
        return cls.model_validate(row).model_copy(
            update={"job": JobView.model_validate(find_job(session, row.job_id))}
        )


class DiagnosisView(View):
    """A diagnosis of one recording."""

    id: str
    robot_serial: str
    recording_id: str
    validation_id: str | None
    options: dict[str, Any]
    verdict: str | None = Field(
        description="consistent, explained, partly_explained or unexplained; null until done."
    )
    simulated: bool | None
    created_at: datetime
    findings: list[str] = Field(default=[], description="A sentence a finding.")
    job: JobView | None = None

    @classmethod
    def of(cls, session: Session, row: Diagnosis) -> DiagnosisView:
        """The diagnosis with its job."""
        findings = [item["sentence"] for item in (row.content or {}).get("findings", [])]
        job = JobView.model_validate(find_job(session, row.job_id))
        return cls.model_validate(row).model_copy(update={"findings": findings, "job": job})


class ExcitationView(View):
    """A designed motion."""

    id: str
    robot_serial: str
    model_hash: str
    options: dict[str, Any]
    created_at: datetime
    job: JobView | None = None

    @classmethod
    def of(cls, session: Session, row: Excitation) -> ExcitationView:
        """The excitation with its job."""
        return cls.model_validate(row).model_copy(
            update={"job": JobView.model_validate(find_job(session, row.job_id))}
        )


class EstimateSummary(View):
    """An estimate without its long members."""

    id: str
    fit_id: str
    robot_serial: str
    recording_id: str
    model_hash: str
    simulated: bool
    intervals_valid: bool = Field(description="False where the model does not fit: intervals are widened.")
    created_at: datetime
    model: str = ""
    torque_constants: list[dict[str, Any]] = Field(
        default=[], description="Per joint: value, std [N.m/A], nominal."
    )

    @classmethod
    def of(cls, row: Estimate) -> EstimateSummary:
        """The summary."""
        content = row.content
        extra = {"model": content.get("model", ""), "torque_constants": content.get("torque_constants", [])}
        return cls.model_validate(row).model_copy(update=extra)


class EstimateView(EstimateSummary):
    """An estimate with parameters and covariance."""

    parameters: list[dict[str, Any]] = Field(
        default=[], description="Name, group, value, std, unit, definition."
    )
    covariance: list[list[float | None]] = Field(
        default=[], description="In the order of parameters, torque constants appended."
    )
    rms: dict[str, Any] = Field(default={}, description="Training and validation, per channel [N.m, N].")
    lack_of_fit: dict[str, Any] = Field(default={})
    warnings: list[str] = Field(default=[])

    @classmethod
    def of(cls, row: Estimate) -> EstimateView:
        """The estimate."""
        keys = ("model", "torque_constants", "parameters", "covariance", "rms", "lack_of_fit", "warnings")
        return cls.model_validate(row).model_copy(
            update={key: row.content[key] for key in keys if key in row.content}
        )


class CalibrationEventView(View):
    """One change of a calibration."""

    event: str
    state: str
    by: str
    reason: str
    at: datetime


class CalibrationView(View):
    """An estimate put forward for use."""

    id: str
    robot_serial: str
    model_hash: str
    estimate_id: str
    simulated: bool
    created_by: str
    created_at: datetime
    state: str = Field(default="", description="proposed, accepted, rejected or superseded.")
    history: list[CalibrationEventView] = Field(
        default=[], description="Every change, oldest first; never rewritten."
    )

    @classmethod
    def of(cls, session: Session, row: Calibration) -> CalibrationView:
        """The calibration with its history."""
        events = [CalibrationEventView.model_validate(event) for event in history(session, row.id)]
        return cls.model_validate(row).model_copy(
            update={"state": state_of(session, row.id), "history": events}
        )


class NightView(View):
    """What one nightly recalibration concluded."""

    id: str
    robot_serial: str
    outcome: str = Field(description="accepted, proposed, kept, skipped or failed.")
    sentence: str
    estimate_id: str | None
    content: dict[str, Any]
    created_by: str
    created_at: datetime


class TokenView(View):
    """A token, without the token."""

    id: str
    name: str
    scopes: str
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None


class AuditView(View):
    """A line of the audit log."""

    id: int
    who: str
    action: str
    subject: str
    content: dict[str, Any]
    at: datetime
