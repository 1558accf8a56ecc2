"""What commands print: tables for people, JSON for programs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table


def console() -> Console:
    """A console on standard output; without colour or line drawing tricks where it is no terminal."""
    return Console(file=sys.stdout, highlight=False, soft_wrap=not sys.stdout.isatty(), width=None if sys.stdout.isatty() else 110)


def print_json(content: Any) -> None:
    """Print one JSON document on standard output, nothing else."""
    json.dump(content, sys.stdout, indent=1, allow_nan=False)
    sys.stdout.write("\n")


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Make a table: first column left, the others right.

    Args:
        title: its title.
        columns: the headings.
        rows: texts.

    Returns:
        The table.
    """
    result = Table(title=title, title_justify="left", title_style="bold", header_style="", show_edge=False, pad_edge=False)
    for index, heading in enumerate(columns):
        result.add_column(heading, justify="left" if index == 0 else "right", no_wrap=index == 0)
    for row in rows:
        result.add_row(*row)
    return result


def significant(value: float | None, std: float | None) -> str:
    """Write a value to the digit that its std still supports."""
    if value is None:
        return "-"
    if not std:
        return f"{value:.4g}"
    from math import floor, log10

    digits = max(0, 1 - floor(log10(std)))
    return f"{value:.{min(digits, 9)}f}"


def uncertainty(std: float | None) -> str:
    """Write a std with two digits; ``inf`` where nothing is known."""
    return "inf" if std is None else f"{std:.2g}"
