"""Columns of a table become the streams of a recording."""

from __future__ import annotations

import difflib
from collections.abc import Mapping

import numpy as np

from daq.errors import DataError, UsageError
from daq.imports.mapping import DEFAULT_START, ChannelMap, ImportMap
from daq.imports.rows import Table, good_rows
from daq.messages import (
    CURRENTS_TOPIC,
    JOINT_STATE,
    JOINT_STATES_TOPIC,
    MOTOR_CURRENTS,
    SETPOINTS_TOPIC,
    WRENCH,
    WRENCH_TOPIC,
)
from daq.recording import Stream

_ABSOLUTE_S = 1e8  # seconds since 1970 of anything recorded after March 1973; no run lasts that long
# topic -> (type, quantities of the map to keys of the stream)
_STREAMS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    JOINT_STATES_TOPIC: (JOINT_STATE, {"position": "position", "velocity": "velocity", "effort": "effort"}),
    CURRENTS_TOPIC: (MOTOR_CURRENTS, {"current": "current"}),
    WRENCH_TOPIC: (WRENCH, {"force": "force", "torque": "torque"}),
    SETPOINTS_TOPIC: (JOINT_STATE, {"setpoint": "position"}),
}


def table_streams(
    table: Table, plan: ImportMap, joints: tuple[str, ...], drop: bool
) -> tuple[dict[str, Stream], int]:
    """The streams a table holds, and how many rows were left out.

    Args:
        table: the file's columns.
        plan: what they mean.
        joints: the joints' names, in column order; made up where empty.
        drop: leave bad rows out.

    Raises:
        DataError: rows are unusable or columns do not fit together.
        UsageError: the map names columns that are not there.
    """
    if "position" not in plan.channels:
        raise UsageError(f"{plan.source}: there is no [position] section; name the columns of the joint "
                         "angles.")
    found: dict[str, Stream] = {}
    dropped = 0
    for topic, (schema, quantities) in _STREAMS.items():
        maps = {key: plan.channels[name] for name, key in quantities.items() if name in plan.channels}
        if not maps:
            continue
        if schema == WRENCH and len(maps) < 2:
            raise UsageError(f"{plan.source}: a force plate needs [force] and [torque], three columns each.")
        values = {key: _values(table, plan, item) for key, item in maps.items()}
        names = _names(plan, values, schema, joints)
        stream, lost = _stream(table, plan, topic, schema, names, maps, values, drop)
        found[topic], dropped = stream, dropped + lost
    return found, dropped


def _column(table: Table, plan: ImportMap, name: str) -> np.ndarray:
    if name in table.columns:
        return table.columns[name]
    near = difflib.get_close_matches(name, table.columns, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"it has {', '.join(table.columns)}."
    raise UsageError(f"{plan.source}: {table.source} has no column {name!r}; {hint}")


def _values(table: Table, plan: ImportMap, item: ChannelMap) -> np.ndarray:
    """(n, k) SI values of one quantity."""
    if not item.columns:
        raise UsageError(f"{plan.source}: [{item.quantity}] names no columns.")
    parts = [_column(table, plan, name) for name in item.columns]
    lengths = {len(part) for part in parts}
    if len(lengths) > 1:
        raise DataError(f"{table.source}: the columns of [{item.quantity}] differ in length; they must be "
                        f"sampled together.")
    raw = np.column_stack(parts)
    for what in (item.scale, item.offset):
        if len(what) not in (1, raw.shape[1]):
            raise UsageError(f"{plan.source}: [{item.quantity}] has {raw.shape[1]} columns but {len(what)} "
                             f"scales or offsets; give one number or one per column.")
    with np.errstate(over="ignore", invalid="ignore"):
        return item.to_si(raw)


def _names(
    plan: ImportMap, values: Mapping[str, np.ndarray], schema: str, joints: tuple[str, ...]
) -> tuple[str, ...]:
    widths = {key: part.shape[1] for key, part in values.items()}
    if schema == WRENCH:
        wrong = [key for key, width in widths.items() if width != 3]
        if wrong:
            raise UsageError(f"{plan.source}: [{wrong[0]}] has {widths[wrong[0]]} columns; it needs x, y "
                             "and z.")
        return ()
    count = next(iter(widths.values()))
    names = joints or tuple(f"joint_{i + 1}" for i in range(count))
    for key, width in widths.items():
        if width != len(names):
            raise UsageError(f"{plan.source}: {key} has {width} columns for {len(names)} joints "
                             f"({', '.join(names)}).")
    return names


def _stream(
    table: Table, plan: ImportMap, topic: str, schema: str, names: tuple[str, ...],
    maps: Mapping[str, ChannelMap], values: dict[str, np.ndarray], drop: bool,
) -> tuple[Stream, int]:
    count = len(next(iter(values.values())))
    time_s = _time(table, plan, next(iter(maps.values())), count)
    if any(len(part) != len(time_s) for part in values.values()):
        raise DataError(f"{table.source}: the time has {len(time_s)} samples but {', '.join(values)} of "
                        f"{topic} has {count}; name the right time column.")
    keep = good_rows(table, time_s, values, drop)
    stamp = start_ns(plan, time_s[keep]) + np.round(time_s[keep] * 1e9).astype(np.int64)
    stream = Stream(
        topic=topic, schema=schema, names=names, frame_id="force_plate" if schema == WRENCH else "",
        stamp_ns=stamp, log_time_ns=stamp.copy(), sequence=np.flatnonzero(keep).astype(np.uint32),
        data={key: part[keep] for key, part in values.items()},
    )
    return stream, int((~keep).sum())


def _time(table: Table, plan: ImportMap, item: ChannelMap, count: int) -> np.ndarray:
    name = item.time or plan.time_column
    if name is None:
        if plan.rate_hz is None:
            raise UsageError(f"{plan.source}: [time] needs a column, or rate_hz where the file has no "
                             "stamps.")
        return np.arange(count) / plan.rate_hz
    column = _column(table, plan, name)
    return np.asarray(column.reshape(len(column), -1)[:, 0] * plan.time_factor, np.float64)


def start_ns(plan: ImportMap, time_s: np.ndarray) -> int:
    """The instant of time zero [ns since 1970]."""
    if plan.start_ns is not None:
        return plan.start_ns
    absolute = float(time_s[0]) > _ABSOLUTE_S
    return 0 if absolute else int(DEFAULT_START.timestamp()) * 1_000_000_000
