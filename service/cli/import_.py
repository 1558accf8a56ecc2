"""``residuum import``: a foreign recording becomes a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def import_(
    recording: Annotated[Path, typer.Argument(help="A .csv, .npz, .db3 or .mcap file.")],
    map_file: Annotated[Path, typer.Option("--map", help="TOML file that says what its columns mean.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The log to write.")],
    robot: Annotated[str | None, typer.Option(help="Preset name or path of a robot.toml.")] = None,
    drop_bad_rows: Annotated[
        bool, typer.Option("--drop-bad-rows", help="Leave unusable rows out and count them.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON only.")] = False,
) -> None:
    """Turn a recording of another program into a log, as a map file describes it.

    Units become SI; a prismatic joint is in m, its force in N goes to effort. Ready maps are in docs/maps.

    Example: residuum import emps.csv --map docs/maps/emps.toml -o emps.mcap
    """
    from dataclasses import replace

    from daq.errors import UsageError
    from daq.imports.recording import import_recording
    from daq.log_writer import write_recording

    found = None
    if robot is not None:
        from service.robots import load_robot

        found = load_robot(robot)
    names = tuple(joint.name for joint in found.file.joint) if found else ()
    result = import_recording(recording, map_file, drop_bad_rows, names)
    log = result.recording
    if found is not None:
        wrong = [name for name in names if name not in log.joint_states.names]
        if wrong:
            raise UsageError(f"{map_file}: the robot {found.name} has a joint {wrong[0]!r} that the "
                             f"recording lacks ({', '.join(log.joint_states.names)}); name it under "
                             "[joints].")
        files = {"robot.toml": found.toml_text.encode(), Path(found.file.urdf).name: found.urdf_text.encode()}
        log = replace(log, attachments={**log.attachments, **files},
                      metadata={**log.metadata, "robot": found.name})
    write_recording(log, output)
    _report(log, result.dropped, output, json)


def _report(log, dropped: int, output: Path, json: bool) -> None:  # noqa: ANN001 - a daq Recording
    samples = {stream.topic: len(stream) for stream in log.streams}
    if json:
        import json as encoder

        typer.echo(encoder.dumps({
            "schema_version": 1, "output": str(output), "samples": samples, "dropped_rows": dropped,
            "joints": list(log.joint_states.names), "metadata": dict(log.metadata),
            "warnings": list(log.warnings),
        }, indent=1))
        return
    parts = ", ".join(f"{count} samples on {topic}" for topic, count in samples.items())
    left_out = f"; {dropped} unusable rows left out" if dropped else ""
    typer.echo(f"Wrote {output}: {parts}{left_out}.")
    for text in log.warnings:
        typer.echo(f"note: {text}")
