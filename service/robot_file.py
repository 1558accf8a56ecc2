"""The robot file: what a lab writes about its arm (``robot.toml``)."""

from __future__ import annotations

import difflib
import tomllib
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from service.errors import UsageError

Vector3 = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
FrictionTerm = Annotated[str, Field(pattern="^((joint_)?(coulomb|viscous)|asymmetric_viscous)$")]


class _Section(BaseModel):
    """A part of the file; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class GravityCompensation(_Section):
    """Fourier series of a gravity compensation on a revolute joint (Eq. 15)."""

    harmonics: Annotated[int, Field(ge=1, le=12)] = 3


class StreamFilter(_Section):
    """Anti-alias filter of one stream, so that its delay can be undone.

    ``kind`` butterworth with ``order`` and ``cutoff_hz``, or a pure ``delay_s``.
    """

    kind: Annotated[str, Field(pattern="^(butterworth|delay)$")] = "butterworth"
    order: Annotated[int, Field(ge=1, le=12)] = 8
    cutoff_hz: Positive | None = None
    delay_s: float = 0.0

    @model_validator(mode="after")
    def _complete(self) -> StreamFilter:
        if self.kind == "butterworth" and self.cutoff_hz is None:
            raise ValueError("a butterworth filter needs its cutoff_hz")
        return self


class Filters(_Section):
    """Anti-alias filters by stream."""

    position: StreamFilter | None = None
    current: StreamFilter | None = None
    wrench: StreamFilter | None = None


class PlateConnection(_Section):
    """How the plate is read: its protocol, its serial port, how the sensor sits under the robot.

    ``rotation`` turns sensor axes into plate axes, row by row; ``is_action`` where the sensor reports what
    the robot does to it.
    """

    protocol: Annotated[str, Field(min_length=1)] = "bota"
    port: Annotated[str, Field(min_length=1)]
    settings: dict[str, float | int | tuple[float, ...]] = Field(default_factory=dict)
    rotation: tuple[Vector3, Vector3, Vector3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    is_action: bool = False


class BusSection(_Section):
    """The CAN bus of the drives; the same keys as in the drivers' own configuration."""

    interface: str = "socketcan"
    channel: str = "can0"
    bitrate_hz: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000
    own_echo: bool = True
    kernel_sync: bool = False
    options: dict[str, str | int | float | bool] = Field(default_factory=dict)
    rate_hz: Positive | None = None
    host_node: Annotated[int, Field(ge=1, le=127)] = 127
    heartbeat_ms: Annotated[int, Field(ge=5, le=10_000)] = 50
    heartbeat_patience: Annotated[float, Field(ge=1.5, le=20.0)] = 3.0
    missing_in_row: Annotated[int, Field(ge=1, le=100)] = 3
    deadlines: dict[str, Positive] = Field(default_factory=dict)


class LimitsSection(_Section):
    """What stops a run when measured [rad or m]: distance from the set points, excess over the limits."""

    following_error: Positive = 0.1
    envelope: NotNegative = 0.02


class PlateSection(_Section):
    """Pose of the force plate in the base frame."""

    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)
    tared: bool = True
    connection: PlateConnection | None = None


class JointSection(_Section):
    """One joint: motor, gear, losses, limits beyond those of the URDF."""

    name: Annotated[str, Field(min_length=1)]
    gear_ratio: float = 1.0
    torque_constant: float | None = None
    rotor_inertia: NotNegative | None = None
    rotor_link: str | None = None
    rotor_axis: Vector3 | None = None
    friction: tuple[FrictionTerm, ...] = ("coulomb", "viscous")
    offset: bool = True
    gravity_compensation: GravityCompensation | None = None
    max_acceleration: Positive | None = None
    node: Annotated[int, Field(ge=1, le=126)] | None = None
    direction: Annotated[int, Field(ge=-1, le=1)] = 1
    drive_profile: str = "generic"
    drive_serial: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None

    @model_validator(mode="after")
    def _geared(self) -> JointSection:
        if self.gear_ratio == 0:
            raise ValueError("gear_ratio must not be zero")
        if self.direction == 0:
            raise ValueError("direction must be 1 or -1")
        if self.torque_constant == 0:
            raise ValueError("torque_constant must not be zero; leave it out where it is unknown")
        if len(set(self.friction)) != len(self.friction):
            raise ValueError("friction names a term twice")
        return self


class RobotFile(_Section):
    """The whole file."""

    name: Annotated[str, Field(min_length=1)]
    urdf: str
    serial: str | None = None
    gravity: Vector3 = (0.0, 0.0, -9.81)
    force_plate: PlateSection | None = None
    coupling: tuple[tuple[float, ...], ...] | None = None
    filter: Filters = Filters()
    bus: BusSection | None = None
    limits: LimitsSection = LimitsSection()
    noise: dict[str, Positive] = Field(default_factory=dict)
    joint: Annotated[tuple[JointSection, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _consistent(self) -> RobotFile:
        names = [joint.name for joint in self.joint]
        repeated = {name for name in names if names.count(name) > 1}
        if repeated:
            raise ValueError(f"joint '{sorted(repeated)[0]}' is described twice")
        if self.coupling is not None and [len(row) for row in self.coupling] != [len(names)] * len(names):
            raise ValueError(f"coupling must be {len(names)} x {len(names)}: a row a motor, a column a joint")
        return self


def parse_robot_file(text: str, where: str) -> RobotFile:
    """Check the text of a robot file.

    Args:
        text: TOML.
        where: its path, for messages.

    Returns:
        The checked file.

    Raises:
        UsageError: not TOML, unknown or wrong keys; names the first fault and what to do.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"Robot file {where} is not valid TOML: {error}.") from error
    try:
        return RobotFile.model_validate(content)
    except ValidationError as error:
        raise UsageError(first_fault(error, RobotFile, f"Robot file {where}")) from error


def first_fault(error: ValidationError, model: type[BaseModel], where: str) -> str:
    """Put pydantic's first complaint into one sentence, with a suggestion for a misspelt key.

    Args:
        error: the complaint.
        model: the schema that was violated, for the keys it knows.
        where: the file, with its path.

    Returns:
        One sentence.
    """
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    fault = faults[0]
    place = _place(fault["loc"])
    if fault["type"] == "extra_forbidden":
        key = str(fault["loc"][-1])
        near = difflib.get_close_matches(key, _known_keys(model), n=1)
        hint = f"; did you mean '{near[0]}'?" if near else "."
        return f"{where}: unknown key {place}{hint}"
    if fault["type"] == "missing":
        return f"{where}: key {place} is missing; add it."
    message = fault["msg"].removeprefix("Value error, ")
    given = "" if isinstance(fault["input"], dict | list) else f" (it is {fault['input']!r})"
    return f"{where}: {place or 'the file'}{given}: {message}."


def _place(location: tuple[Any, ...]) -> str:
    parts = [f"[{part + 1}]" if isinstance(part, int) else str(part) for part in location]
    return "'" + ".".join(parts).replace(".[", "[") + "'" if parts else ""


def _known_keys(model: type[BaseModel]) -> list[str]:
    keys: list[str] = []
    pending = [model]
    while pending:
        current = pending.pop()
        for name, field in current.model_fields.items():
            keys.append(name)
            pending += [kind for kind in _models_in(field.annotation) if kind is not current]
    return keys


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [kind for part in getattr(annotation, "__args__", ()) for kind in _models_in(part)]
