"""Drive profiles: what a make of drive can do, read from TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from drivers.canopen.objects import CYCLIC_SYNCHRONOUS_POSITION, INTERPOLATED_POSITION
from drivers.errors import ConfigError, RateRefusedError

_FOLDER = Path(__file__).with_name("profiles")

#: A rate is the drive's when the periods agree this well (6667 us stands for 150 Hz: 50 ppm).
_PERIOD_TOLERANCE = 1e-4


class DriveProfile(BaseModel):
    """The capabilities of one make of drive.

    `sync_periods_us` are the SYNC periods its firmware takes; `period_object` is where it wants to be told
    (60C2h holds one byte times a power of ten, which many rates do not fit).
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    vendor: int | None = Field(default=None, ge=0, le=0xFFFFFFFF)
    product: int | None = Field(default=None, ge=0, le=0xFFFFFFFF)
    mode: Literal[8, 7] = CYCLIC_SYNCHRONOUS_POSITION
    fallback_mode: Literal[7] | None = None
    sync_periods_us: tuple[int, ...] = Field(min_length=1)
    period_object: Literal["1006h", "60C2h", "none"] = "60C2h"
    demand_lag_cycles: int = Field(default=0, ge=0, le=4)
    demand_tolerance_counts: int = Field(default=1, ge=0, le=1000)
    velocity_in_rpm: bool = False
    current_follows_polarity: bool = False
    has_follow_bit: bool = True

    @field_validator("sync_periods_us")
    @classmethod
    def _sane_periods(cls, periods: tuple[int, ...]) -> tuple[int, ...]:
        if any(not 500 <= period <= 1_000_000 for period in periods):
            raise ValueError("every SYNC period lies between 500 and 1 000 000 microseconds")
        return tuple(sorted(periods))

    @property
    def modes(self) -> tuple[int, ...]:
        """Operation modes in the order they are tried."""
        if self.fallback_mode is None or self.fallback_mode == self.mode:
            return (self.mode,)
        return (self.mode, INTERPOLATED_POSITION)

    def accepts(self, period_us: int) -> bool:
        """Whether the drive takes this SYNC period and can be told so exactly."""
        if period_us not in self.sync_periods_us:
            return False
        return self.period_object != "60C2h" or interpolation_time(period_us) is not None

    @property
    def usable_periods_us(self) -> tuple[int, ...]:
        """Those of the listed periods that the drive can be told exactly."""
        return tuple(period for period in self.sync_periods_us if self.accepts(period))

    def period_us(self, rate_hz: float) -> int:
        """The SYNC period [us] for a rate [Hz].

        Raises:
            RateRefusedError: the drive does not offer the rate; the sentence lists those it does.
        """
        for period in self.usable_periods_us:
            if abs(period * rate_hz * 1e-6 - 1.0) < _PERIOD_TOLERANCE:
                return period
        rates = tuple(1e6 / period for period in reversed(self.usable_periods_us))
        raise RateRefusedError(rate_hz, self.name, rates)


def interpolation_time(period_us: int) -> tuple[int, int] | None:
    """A period as 60C2h wants it: (value 1..255, exponent of ten in seconds), None where it does not fit."""
    value, exponent = period_us, -6
    while value % 10 == 0 and exponent < -3:
        value, exponent = value // 10, exponent + 1
    return (value, exponent) if 1 <= value <= 255 else None


def common_period_us(profiles: Iterable[DriveProfile], rate_hz: float) -> int:
    """The one SYNC period [us] that every drive on the bus takes at `rate_hz`.

    Raises:
        RateRefusedError: one of them does not; the rates offered are those that all share.
    """
    all_profiles = tuple(profiles)
    shared = set.intersection(*(set(profile.usable_periods_us) for profile in all_profiles))
    for profile in all_profiles:
        try:
            period = profile.period_us(rate_hz)
        except RateRefusedError as error:
            rates = tuple(sorted(1e6 / us for us in shared))
            raise RateRefusedError(rate_hz, profile.name, rates or error.allowed_hz) from None
    return period


def load_profile(name_or_path: str | Path) -> DriveProfile:
    """Read a drive profile by the name of a built-in one or by path.

    Raises:
        ConfigError: no such profile, or it does not hold what a profile holds.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = _FOLDER / f"{name_or_path}.toml"
    if not path.is_file():
        names = ", ".join(sorted(file.stem for file in _FOLDER.glob("*.toml")))
        raise ConfigError(
            f"There is no drive profile '{name_or_path}'; name one of {names}, "
            "or give the path of a .toml file."
        )
    try:
        return DriveProfile.model_validate(tomllib.loads(path.read_text("utf-8")))
    except (ValidationError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"The drive profile {path} cannot be used: {_first_reason(error)}.") from None


def _first_reason(error: ValidationError | tomllib.TOMLDecodeError) -> str:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}"
    return str(error)
