"""The service's configuration: TOML, every field with meaning, unit, default and consequence."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from service.errors import UsageError
from service.robot_file import first_fault


def _field(default: Any, meaning: str, unit: str, consequence: str, **limits: Any) -> Any:
    """A field that documents itself; the example file is made from this."""
    extra = {"unit": unit, "consequence": consequence}
    return Field(default, description=meaning, json_schema_extra=extra, **limits)


class _Section(BaseModel):
    """A table of the file; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ServerSection(_Section):
    """Where the service listens."""

    host: str = _field(
        "127.0.0.1",
        "address to listen on",
        "-",
        "anything but loopback exposes the robots to the network: put TLS in front",
    )
    port: int = _field(
        8600, "TCP port", "-", "clients and the nightly timer must use the same", ge=1, le=65535
    )
    stream_poll_s: float = _field(
        0.5,
        "time between looks for new events in an event stream",
        "s",
        "longer: live progress lags; shorter: more database reads",
        ge=0.05,
        le=10,
    )


class StorageSection(_Section):
    """Where state and samples live."""

    folder: Path = _field(
        Path("residuum-data"),
        "folder of recordings, reports and the embedded database",
        "-",
        "back up this folder; one server a folder",
    )
    database: str = _field(
        "",
        "database URL; empty keeps SQLite in the folder",
        "-",
        "postgresql+psycopg://user@host/name needs the psycopg package",
    )
    max_upload_mb: int = _field(
        2048,
        "largest recording accepted",
        "MB",
        "larger uploads are refused before they fill the disk",
        ge=1,
        le=1_000_000,
    )
    keep_free_mb: int = _field(
        1024,
        "disk space that uploads leave free",
        "MB",
        "less free space refuses uploads, so that a run can still record",
        ge=0,
        le=10_000_000,
    )


class ComputeSection(_Section):
    """Worker processes for fits, diagnoses and designs."""

    workers: int = _field(
        1,
        "jobs computed at the same time",
        "processes",
        "more: faster queues, but less processor left for a recording in progress",
        ge=1,
        le=64,
    )
    job_limit_s: float = _field(
        3600.0,
        "longest time of a job",
        "s",
        "a job that takes longer is stopped and marked failed",
        gt=0,
        le=604_800,
    )
    attempts: int = _field(
        3,
        "starts of a job that a crash of the server interrupts",
        "-",
        "after the last one it stays interrupted",
        ge=1,
        le=20,
    )


class AccessSection(_Section):
    """Who may do what."""

    failures: int = _field(
        10,
        "failed log-ins of one address before it must wait",
        "-",
        "fewer: safer against guessing; more: kinder to typing errors",
        ge=1,
        le=1000,
    )
    failure_window_s: float = _field(
        300.0,
        "time over which failures count, and the wait",
        "s",
        "longer: a guesser waits longer",
        ge=1,
        le=86_400,
    )
    lease_limit_min: float = _field(
        240.0,
        "longest lease of a robot",
        "min",
        "a forgotten lease blocks the robot no longer than this",
        gt=0,
        le=10_080,
    )
    key_days: float = _field(
        7.0,
        "how long an idempotency key is remembered",
        "d",
        "a repeated request after that acts again",
        gt=0,
        le=365,
    )


class NightlySection(_Section):
    """What the nightly recalibration tests and decides."""

    policy: Literal["propose", "accept_if_consistent"] = _field(
        "propose",
        "who accepts a night's calibration",
        "-",
        "accept_if_consistent lets a night that agrees with the accepted one replace it without a person",
    )
    false_alarms_per_year: float = _field(
        0.1,
        "false alarms accepted in a year of nights, all tests of a robot together",
        "1/year",
        "smaller: real changes are found later",
        gt=0,
        le=50,
    )
    trend_nights: int = _field(
        180,
        "nights in the torque-constant regression",
        "nights",
        "more: slower losses are seen, sudden ones later",
        ge=8,
        le=2000,
    )
    least_trend_percent_per_year: float = _field(
        1.0,
        "torque-constant trend that is worth an alarm",
        "%/year",
        "a significant but smaller trend is reported without an alarm",
        ge=0,
        le=100,
    )
    worst_validation_ratio: float = _field(
        1.5,
        "held-out error over noise that still counts as validated",
        "-",
        "a night above it is neither proposed nor accepted",
        ge=1,
        le=100,
    )
    warm_up_periods: int = _field(
        4,
        "periods of the warm-up run before the measured one",
        "periods",
        "fewer: friction of the cold gears enters the estimate; 0 skips the warm-up",
        ge=0,
        le=1000,
    )
    periods: int = _field(
        16,
        "periods of the measured run",
        "periods",
        "more: smaller uncertainty, longer night",
        ge=2,
        le=10_000,
    )
    wait_s: float = _field(
        7200.0,
        "longest wait for a run or job of the night",
        "s",
        "after that the night fails and says so",
        gt=0,
        le=86_400,
    )


class WebhookSection(_Section):
    """Alerts to a program."""

    url: str = _field(
        "", "address that receives alerts as JSON", "-", "empty sends none", pattern="^(https?://.+)?$"
    )
    secret_file: Path | None = _field(
        None,
        "file with the key of the HMAC-SHA256 signature",
        "-",
        "without it the receiver cannot tell who sent the alert; required with url",
    )

    @model_validator(mode="after")
    def _signed(self) -> WebhookSection:
        if self.url and self.secret_file is None:
            raise ValueError(
                "alerts.webhook.url needs secret_file, so that the receiver can check the signature"
            )
        return self


class EmailSection(_Section):
    """Alerts to people."""

    host: str = _field("", "SMTP server", "-", "empty sends no e-mail")
    port: int = _field(587, "SMTP port", "-", "587 starts TLS when starttls is set", ge=1, le=65535)
    starttls: bool = _field(
        True, "encrypt before logging in", "-", "false sends alerts and password in clear"
    )
    user: str = _field("", "SMTP user", "-", "empty logs in nowhere")
    password_file: Path | None = _field(None, "file with the SMTP password", "-", "needed where user is set")
    sender: str = _field("residuum@localhost", "From address", "-", "some servers refuse unknown senders")
    recipients: tuple[str, ...] = _field((), "To addresses", "-", "empty sends no e-mail")


class AlertSection(_Section):
    """Who is told of failures, drift and new findings."""

    webhook: WebhookSection = WebhookSection()
    email: EmailSection = EmailSection()


class Config(_Section):
    """The whole file."""

    server: ServerSection = ServerSection()
    storage: StorageSection = StorageSection()
    compute: ComputeSection = ComputeSection()
    access: AccessSection = AccessSection()
    nightly: NightlySection = NightlySection()
    alerts: AlertSection = AlertSection()

    @property
    def database_url(self) -> str:
        """The database to use; SQLite in the storage folder where none is named."""
        return self.storage.database or f"sqlite:///{self.storage.folder / 'residuum.sqlite'}"


ConfigPath = Annotated[Path | None, "None takes every default"]


def load_config(path: ConfigPath) -> Config:
    """Read a configuration file.

    Args:
        path: the TOML file; None takes every default.

    Returns:
        The checked configuration.

    Raises:
        UsageError: missing, not TOML, or an unknown or wrong key; names the first fault.
    """
    if path is None:
        return Config()
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"Configuration {path} cannot be read: {error.strerror}; check the path.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"Configuration {path} is not valid TOML: {error}.") from error
    try:
        return Config.model_validate(content)
    except ValidationError as error:
        raise UsageError(first_fault(error, Config, f"Configuration {path}")) from error
