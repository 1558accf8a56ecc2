"""Configuration of a CAN adapter and of the drives behind it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from drivers.errors import ConfigError


class CanConfig(BaseModel):
    """Which adapter, by python-can's name for it (socketcan, slcan, pcan, virtual, ...)."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    interface: str = "socketcan"
    channel: str = "can0"
    bitrate_hz: int = Field(default=1_000_000, ge=10_000, le=1_000_000)
    own_echo: bool = True  # False where the adapter cannot echo own frames (slcan): SYNC is stamped at send
    kernel_sync: bool = False  # SYNC by the kernel's broadcast manager instead of this process
    options: dict[str, Any] = Field(default_factory=dict)  # further arguments of python-can's Bus


class AxisConfig(BaseModel):
    """One drive and the joint it moves."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(min_length=1)
    node: int = Field(ge=1, le=126)
    gear_ratio: float = Field(gt=0.0, le=1e5)
    direction: Literal[1, -1] = 1
    profile: str = "generic"
    serial: int | None = Field(default=None, ge=0, le=0xFFFFFFFF)


class Deadlines(BaseModel):
    """How long each stage may take [s]."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    boot_s: float = Field(default=5.0, gt=0.0, le=60.0)
    sdo_s: float = Field(default=0.3, gt=0.0, le=10.0)
    mode_s: float = Field(default=1.0, gt=0.0, le=10.0)
    enable_s: float = Field(default=8.0, gt=0.0, le=60.0)
    quick_stop_s: float = Field(default=1.0, gt=0.0, le=10.0)
    nmt_stop_s: float = Field(default=1.0, gt=0.0, le=10.0)


class BusConfig(BaseModel):
    """A bus with its drives."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    can: CanConfig = CanConfig()
    axes: tuple[AxisConfig, ...] = Field(min_length=1, max_length=32)
    rate_hz: float = Field(default=150.0, ge=1.0, le=2000.0)
    host_node: int = Field(default=127, ge=1, le=127)
    heartbeat_ms: int = Field(default=50, ge=5, le=10_000)  # both ways
    heartbeat_patience: float = Field(default=3.0, ge=1.5, le=20.0)  # periods without one before it is lost
    missing_in_row: int = Field(default=3, ge=1, le=100)
    deadlines: Deadlines = Deadlines()

    @model_validator(mode="after")
    def _distinct(self) -> BusConfig:
        nodes = [axis.node for axis in self.axes]
        names = [axis.name for axis in self.axes]
        if len(set(nodes)) < len(nodes) or self.host_node in nodes:
            raise ValueError("every drive and the host need a node number of their own")
        if len(set(names)) < len(names):
            raise ValueError("every axis needs a name of its own")
        return self

    @property
    def heartbeat_lost_ms(self) -> int:
        """After how many milliseconds without a heartbeat the other side counts as dead."""
        return round(self.heartbeat_ms * self.heartbeat_patience)


def load_bus(path: str | Path) -> BusConfig:
    """Read the configuration of a bus from a TOML file; unknown keys are refused.

    Raises:
        ConfigError: not readable, or not what a bus configuration holds.
    """
    try:
        return BusConfig.model_validate(tomllib.loads(Path(path).read_text("utf-8")))
    except OSError as error:
        raise ConfigError(f"The bus configuration {path} could not be read: {error.strerror}.") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"The bus configuration {path} is not TOML: {error}.") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ConfigError(f"The bus configuration {path} cannot be used: {where}: {first['msg']}.") from None
