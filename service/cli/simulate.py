"""``residuum simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from service.simulation import Simulation


def simulate(
    robot: Annotated[str, typer.Argument(help="Preset name or path of a robot.toml.")],
    model: Annotated[
        Path, typer.Option(help="estimate.json, or diagnosis.json for the model with its effects.")
    ],
    like: Annotated[Path, typer.Option(help="The recording to follow: its motion, topics and instants.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Where to write the simulated log (MCAP).")],
    as_json: Annotated[bool, typer.Option("--json", help="Print what was written as JSON.")] = False,
) -> None:
    """Write what a model says the sensors would have shown along a recorded motion, to open beside the recording.

    Example: residuum simulate ir361 --model diagnosis.json --like run.mcap -o simulated.mcap
    """
    from daq.log_writer import write_recording
    from service.cli.output import print_json
    from service.errors import UsageError
    from service.files import check_writable
    from service.simulation import simulate_log

    check_writable(output, "the simulated log")
    if output.exists() and like.exists() and output.samefile(like):
        raise UsageError(f"{output} is the recording itself; give the simulated log another name.")
    found = simulate_log(robot, model, like)
    write_recording(found.recording, output)
    if as_json:
        print_json(_content(found, output))
    else:
        _print(found, output)


def _content(found: Simulation, output: Path) -> dict[str, object]:
    return {
        "output": str(output),
        "simulated": True,
        "topics": [stream.topic for stream in found.recording.streams],
        "effects": list(found.effects),
        "rms_difference": found.difference,
        "rms_recorded": found.level,
        "notes": list(found.notes),
    }


def _print(found: Simulation, output: Path) -> None:
    from service.cli.output import console, table

    out = console()
    beyond = f" with {', '.join(found.effects)}" if found.effects else ", no effects beyond it"
    out.print(f"Simulated {found.like.source} by the rigid-body model{beyond}.", markup=False)
    rows = [(name, f"{found.level[name]:.3g}", f"{value:.3g}") for name, value in found.difference.items()]
    out.print(table("RMS (N.m, N)", ("channel", "recorded, about its mean", "recorded less simulated"), rows))
    for note in found.notes:
        out.print(f"Note: {note}", markup=False)
    out.print(
        f"\nWritten to {output}, marked simulated; open it in Foxglove beside the recording.", markup=False
    )
