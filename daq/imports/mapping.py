"""The map file: which columns, arrays or topics of a foreign recording mean what."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from daq.errors import UsageError
from daq.imports.units import DEFAULTS, factor

QUANTITIES = ("position", "velocity", "effort", "current", "setpoint", "force", "torque")
_CHANNEL_KEYS = ("column", "columns", "unit", "scale", "offset", "time")
_SECTIONS: dict[str, tuple[str, ...]] = {
    "time": ("column", "unit", "start", "rate_hz", "source"),
    "joints": ("names", "rename"),
    **dict.fromkeys(QUANTITIES, _CHANNEL_KEYS),
    "topics": ("joint_states", "motor_currents", "wrench", "setpoints"),
    "metadata": ("run_id", "robot", "kind", "simulated", "fundamental_hz", "harmonics", "sample_rate_hz",
                 "periods", "transient_periods", "notes", "licence"),
    "csv": ("delimiter", "decimal", "skip_lines"),
}
# Recordings that count from zero are put here: a stamp in 1970 means "clock not set" to every reader.
DEFAULT_START = datetime(2000, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class ChannelMap:
    """Where one quantity comes from: SI = raw * factor * scale + offset."""

    quantity: str
    columns: tuple[str, ...]
    factor: float
    scale: np.ndarray
    offset: np.ndarray
    time: str | None

    def to_si(self, raw: np.ndarray) -> np.ndarray:
        """(n, k) raw numbers in SI units."""
        return raw * (self.factor * self.scale) + self.offset


@dataclass(frozen=True)
class ImportMap:
    """A whole map file."""

    source: str
    time_column: str | None
    time_factor: float
    rate_hz: float | None
    start_ns: int | None
    by_log_time: bool
    joints: tuple[str, ...]
    rename: tuple[str, ...]
    channels: Mapping[str, ChannelMap]
    topics: Mapping[str, str]
    metadata: Mapping[str, str]
    csv: Mapping[str, Any] = field(default_factory=dict)


def read_map(path: str | Path) -> ImportMap:
    """Read a map file.

    Raises:
        UsageError: it cannot be read, is not TOML, or has a key or value that means nothing.
    """
    where = str(path)
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"cannot read the map {where}: {error.strerror or error}; give its path.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{where} is not TOML: {error}; see docs/maps for examples.") from error
    _refuse_unknown(where, content)
    time = content.get("time", {})
    joints = content.get("joints", {})
    return ImportMap(
        source=where,
        time_column=_text(where, "time", time, "column"),
        time_factor=factor("time", str(time.get("unit", DEFAULTS["time"])), where),
        rate_hz=_positive(where, time, "rate_hz"),
        start_ns=_start(where, time),
        by_log_time=_by_log_time(where, time),
        joints=_names(where, "joints", joints, "names"),
        rename=_names(where, "joints", joints, "rename"),
        channels={name: _channel(where, name, content[name]) for name in QUANTITIES if name in content},
        topics={key: _text(where, "topics", content["topics"], key) or ""
                for key in content.get("topics", {})},
        metadata={key: _as_text(value) for key, value in content.get("metadata", {}).items()},
        csv=content.get("csv", {}),
    )


def _refuse_unknown(where: str, content: Mapping[str, Any]) -> None:
    for section, body in content.items():
        _known(where, section, tuple(_SECTIONS), "section")
        if not isinstance(body, dict):
            raise UsageError(f"{where}: {section} must be a section, written [{section}].")
        for key in body:
            _known(where, key, _SECTIONS[section], f"key of [{section}]")


def _known(where: str, key: str, known: tuple[str, ...], what: str) -> None:
    if key in known:
        return
    near = difflib.get_close_matches(key, known, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}."
    raise UsageError(f"{where}: {key!r} is no {what}; {hint}")


def _text(where: str, section: str, body: Mapping[str, Any], key: str) -> str | None:
    value = body.get(key)
    if value is not None and not isinstance(value, str):
        raise UsageError(f"{where}: [{section}] {key} must be a text, not {value!r}.")
    return value


def _names(where: str, section: str, body: Mapping[str, Any], key: str) -> tuple[str, ...]:
    value = body.get(key, [])
    value = [value] if isinstance(value, str) else value
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise UsageError(f"{where}: [{section}] {key} must be a list of texts, not {value!r}.")
    return tuple(value)


def _positive(where: str, body: Mapping[str, Any], key: str) -> float | None:
    value = body.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e9:
        raise UsageError(f"{where}: [time] {key} must be a positive number, not {value!r}.")
    return float(value)


def _start(where: str, time: Mapping[str, Any]) -> int | None:
    value = time.get("start")
    if value is None:
        return None
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value)
        except ValueError:
            value = None
    if not isinstance(value, datetime) or value.year < 1971:
        raise UsageError(f"{where}: [time] start must be a date and time after 1970 such as "
                         f"2026-01-31T12:00:00Z, not {time['start']!r}.")
    return int((value if value.tzinfo else value.replace(tzinfo=UTC)).timestamp()) * 1_000_000_000


def _by_log_time(where: str, time: Mapping[str, Any]) -> bool:
    value = time.get("source", "header")
    if value not in ("header", "log"):
        raise UsageError(f"{where}: [time] source must be 'header' or 'log', not {value!r}.")
    return value == "log"


def _channel(where: str, quantity: str, body: Mapping[str, Any]) -> ChannelMap:
    columns = _names(where, quantity, body, "columns") or _names(where, quantity, body, "column")
    unit = str(body.get("unit", DEFAULTS[quantity]))
    if unit == "counts" and "scale" not in body:
        raise UsageError(f"{where}: [{quantity}] is in counts: give its scale, SI units per count.")
    return ChannelMap(
        quantity=quantity,
        columns=columns,
        factor=factor(quantity, unit, where),
        scale=_numbers(where, quantity, body, "scale", 1.0),
        offset=_numbers(where, quantity, body, "offset", 0.0),
        time=_text(where, quantity, body, "time"),
    )


def _numbers(where: str, section: str, body: Mapping[str, Any], key: str, default: float) -> np.ndarray:
    value = body.get(key, default)
    items = value if isinstance(value, list) else [value]
    if not items or not all(isinstance(i, int | float) and not isinstance(i, bool) for i in items):
        raise UsageError(f"{where}: [{section}] {key} must be a number or one per joint, not {value!r}.")
    out = np.array(items, float)
    if not np.isfinite(out).all():
        raise UsageError(f"{where}: [{section}] {key} must be finite, not {value!r}.")
    return out


def _as_text(value: Any) -> str:
    """Metadata are texts; TOML's booleans are spelled as the log spells them."""
    return str(value).lower() if isinstance(value, bool) else str(value)
