"""Comma-separated values: one row a sample, a heading above."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from daq.errors import DataError, UsageError
from daq.imports.mapping import ImportMap
from daq.imports.rows import Table


def read_csv(path: Path, plan: ImportMap) -> Table:
    """Read every column; cells that are no numbers become NaN, their row is noted.

    Raises:
        DataError: the file is empty or not text.
        UsageError: the map's CSV settings mean nothing.
    """
    delimiter, decimal = str(plan.csv.get("delimiter", ",")), str(plan.csv.get("decimal", "."))
    skip = plan.csv.get("skip_lines", 0)
    if len(delimiter) != 1 or not isinstance(skip, int) or skip < 0:
        raise UsageError(f"{plan.source}: [csv] delimiter must be one character and skip_lines a whole "
                         "number.")
    try:
        with open(path, newline="", encoding="utf-8-sig") as stream:
            for _ in range(skip):
                stream.readline()
            reader = csv.reader(stream, delimiter=delimiter, skipinitialspace=True)
            heading = [name.strip() for name in next(reader, [])]
            lines = [row for row in reader if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path} is not a CSV file: {error}; export it as UTF-8 text.") from error
    if not lines:
        raise DataError(f"{path} holds no rows below a heading; export the recording again.")
    table = np.full((len(lines), len(heading)), np.nan)
    broken: dict[int, str] = {}
    for i, row in enumerate(lines):
        if len(row) < len(heading):
            broken[i] = f"it has {len(row)} of {len(heading)} cells"
        for j, cell in enumerate(row[: len(heading)]):
            try:
                table[i, j] = float(cell if decimal == "." else cell.replace(decimal, "."))
            except ValueError:
                broken.setdefault(i, f"its {heading[j]} is {cell!r}, not a number")
    # a text column that nobody maps must not spoil its rows: see ``relevant``
    columns = dict(zip(heading, table.T, strict=True))
    return Table(str(path), columns, 2 + skip, relevant(broken, plan, heading))


def relevant(broken: dict[int, str], plan: ImportMap, heading: list[str]) -> dict[int, str]:
    """The complaints about columns the map uses."""
    used = {plan.time_column, *(c for m in plan.channels.values() for c in (*m.columns, m.time))}
    ignored = tuple(f"its {name} is " for name in heading if name not in used)
    return {row: text for row, text in broken.items() if not text.startswith(ignored or ("\0",))}
