"""``residuum recover``: save what is intact in a damaged log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def recover(
    log: Annotated[Path, typer.Argument(help="The damaged or unfinished log, as run.mcap.partial.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Where the whole log goes.")],
    json: Annotated[bool, typer.Option("--json", help="Print JSON only.")] = False,
) -> None:
    """Save everything intact in a truncated, unfinished or bit-flipped log.

    The new log is valid; what was lost is reported topic by topic and never made up.

    Example: residuum recover run.mcap.partial -o whole.mcap
    """
    from dataclasses import asdict

    from daq.errors import UsageError
    from service.salvage import salvage_run as salvage

    if output.exists() and log.exists() and output.samefile(log):
        raise UsageError(f"{output} is the damaged log itself; give another name with -o.")
    found = salvage(log, output)
    if json:
        import json as encoder

        plain = {"schema_version": 1, "sentence": found.sentence, **asdict(found)}
        typer.echo(encoder.dumps(plain, indent=1))
        return
    typer.echo(found.sentence)
    for topic in found.topics:
        line = f"  {topic.topic}: {topic.recovered} messages"
        if topic.holes:
            line += f", {topic.holes} missing between (at most {topic.largest_hole} in a row)"
        if topic.in_damaged_chunks:
            line += f", {topic.in_damaged_chunks} lay in dropped chunks"
        typer.echo(line)
    typer.echo(f"Written to {output}.")
