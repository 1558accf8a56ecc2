"""``residuum inspect``: what is in a log, and what it is fit for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from daq.quality import Quality


def inspect(
    log: Annotated[Path, typer.Argument(help="The log, an MCAP file.")],
    json: Annotated[bool, typer.Option("--json", help="Print JSON only.")] = False,
) -> None:
    """Show what a log holds, how well it was sampled, and what it is fit for.

    Exits with 4 where it is unfit; its reasons are then the output.

    Example: residuum inspect run.mcap
    """
    from daq.errors import DataError
    from daq.log_reader import read_recording
    from daq.quality import inspect_recording

    quality = inspect_recording(read_recording(log))
    if json:
        import json as encoder

        typer.echo(encoder.dumps(quality.to_json(), indent=1))
    else:
        _print(quality)
    if not quality.fit:
        raise DataError(f"{log} is unfit for use: {quality.reasons[0]}")


def _print(quality: Quality) -> None:
    from rich.console import Console

    console = Console(highlight=False)
    console.print(f"{quality.source}: {quality.verdict}", style="bold", markup=False, soft_wrap=True)
    for reason in quality.reasons:
        console.print(f"  {reason}", markup=False, soft_wrap=True)
    if quality.metadata:
        pairs = ", ".join(f"{key} {value}" for key, value in sorted(quality.metadata.items()))
        console.print(f"Run: {pairs}", markup=False, soft_wrap=True)
    if quality.streams:
        console.print(f"Length: {quality.streams[0].duration_s:.3f} s", markup=False, soft_wrap=True)
    console.print(_sampling(quality))
    if quality.period is not None:
        console.print(_period_line(quality), markup=False, soft_wrap=True)
    if quality.repeatability:
        console.print(_repeatability(quality))
    for note in quality.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)


def _sampling(quality: Quality):  # noqa: ANN202 - a rich table
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE)
    for heading in ("stream", "samples", "rate Hz", "lost", "gap ms", "jitter us", "drift ppm", "phase ms"):
        table.add_column(heading, justify="left" if heading == "stream" else "right", no_wrap=True)
    for s in quality.streams:
        table.add_row(
            s.topic, str(s.samples), f"{s.rate_hz:.3f}", str(s.lost),
            f"{s.gaps[0].length_s * 1e3:.1f}" if s.gaps else "-", f"{s.jitter_std_s * 1e6:.1f}",
            "-" if s.drift_ppm is None else f"{s.drift_ppm:+.1f}",
            "-" if s.phase_s is None else f"{s.phase_s * 1e3:+.3f}",
        )
    return table


def _period_line(quality: Quality) -> str:
    period = quality.period
    assert period is not None
    line = f"Period: {period.period_s:.6f} s, {period.periods} whole ones, by {', '.join(period.repeating)}"
    if period.other:
        line += f"; not by {', '.join(period.other)}"
    if quality.claimed_hz:
        line += f" (metadata: {1 / quality.claimed_hz:.6f} s)"
    return line


def _repeatability(quality: Quality):  # noqa: ANN202 - a rich table
    from rich import box
    from rich.table import Table

    table = Table(title="A single period deviates by (rms)", box=box.SIMPLE)
    table.add_column("channel")
    table.add_column("SI units", justify="right")
    for name, value in quality.repeatability.items():
        table.add_row(name, f"{value:.3g}")
    return table
