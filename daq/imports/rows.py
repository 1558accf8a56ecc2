"""Rows that cannot be used, found before they become samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from daq.checks import ABSURD
from daq.errors import DataError


@dataclass(frozen=True)
class Table:
    """Columns of one file that share rows.

    Attributes:
        source: the file.
        columns: name to (n,) or (n, k) numbers; NaN where a cell could not be read.
        first_row: number of the first row as the file's reader counts them.
        broken: row index to why its cells could not be read.
    """

    source: str
    columns: dict[str, np.ndarray]
    first_row: int
    broken: dict[int, str]


def good_rows(table: Table, time_s: np.ndarray, values: dict[str, np.ndarray], drop: bool) -> np.ndarray:
    """(n,) bool: the rows to keep.

    Args:
        table: where the values come from.
        time_s: (n,) seconds.
        values: name to (n, k) numbers.
        drop: leave bad rows out rather than refuse.

    Raises:
        DataError: a row is bad and ``drop`` is false, or no row is good.
    """
    reason = _first_reasons(table, time_s, values)
    bad = np.array([bool(text) for text in reason])
    if bad.any() and not drop:
        row = int(np.argmax(bad))
        raise DataError(f"{table.source}: row {row + table.first_row} is unusable, {reason[row]} "
                        f"({int(bad.sum())} such rows); correct it or give --drop-bad-rows.")
    if bad.all():
        raise DataError(f"{table.source}: no row is usable, the first because {reason[0]}.")
    return ~bad


def _first_reasons(table: Table, time_s: np.ndarray, values: dict[str, np.ndarray]) -> list[str]:
    """What is wrong with each row, empty where nothing is."""
    reason = [""] * len(time_s)
    for row, text in table.broken.items():
        reason[row] = text
    for name, column in {"time": time_s[:, None], **values}.items():
        with np.errstate(invalid="ignore"):
            absurd = np.abs(column) > ABSURD
        for wrong, what in ((np.isnan(column), "is NaN"), (np.isinf(column), "is infinite"),
                            (absurd, f"is beyond {ABSURD:g}")):
            for row in np.flatnonzero(wrong.any(axis=1)):
                reason[row] = reason[row] or f"its {name} {what}"
    _add_stamp_reasons(time_s, reason)
    return reason


def _add_stamp_reasons(time_s: np.ndarray, reason: list[str]) -> None:
    """Among rows that are otherwise good, time must increase."""
    rows = np.array([i for i, text in enumerate(reason) if not text], int)
    if not len(rows):
        return
    times = time_s[rows]
    latest = np.maximum.accumulate(np.concatenate([[-np.inf], times[:-1]]))
    for row in rows[times == latest]:
        reason[row] = f"its time {time_s[row]:.9g} s repeats the one before"
    for row in rows[times < latest]:
        reason[row] = f"its time {time_s[row]:.9g} s lies before that of an earlier row"
