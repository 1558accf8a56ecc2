"""NumPy archives: one array a quantity, rows are samples."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from daq.errors import DataError
from daq.imports.mapping import ImportMap
from daq.imports.rows import Table


def read_npz(path: Path, plan: ImportMap) -> Table:
    """Read the arrays the map names; nothing pickled is ever loaded.

    Raises:
        DataError: the file is no such archive or an array is not made of numbers.
    """
    wanted = {plan.time_column, *(c for m in plan.channels.values() for c in (*m.columns, m.time))} - {None}
    columns: dict[str, np.ndarray] = {}
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            names = list(archive.files)
            for name in names:
                if name in wanted:
                    columns[name] = np.asarray(archive[name], np.float64)
                else:
                    columns.setdefault(name, np.empty(0))
    except (OSError, ValueError, zipfile.BadZipFile, EOFError, TypeError) as error:
        raise DataError(f"{path} is not an archive of numeric arrays: {error}; "
                        "save it by numpy.savez.") from error
    for name, column in columns.items():
        if column.ndim not in (1, 2):
            raise DataError(f"{path}: array {name} has {column.ndim} dimensions; it must be (samples,) or "
                            f"(samples, joints).")
    return Table(str(path), columns, 0, {})
