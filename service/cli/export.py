"""``residuum export``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from service.exports import ExportReport


def export(
    estimate: Annotated[Path, typer.Argument(help="The estimate to export (JSON).")],
    urdf: Annotated[Path | None, typer.Option(help="Where to write the URDF.")] = None,
    mjcf: Annotated[Path | None, typer.Option(help="Where to write the MJCF.")] = None,
    project: Annotated[
        bool, typer.Option("--project", help="Export the nearest possible parameters.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Write an estimate as URDF and MJCF, read them back and prove them in MuJoCo.

    Example: residuum export estimate.json --urdf arm.urdf --mjcf arm.xml
    """
    from service.cli.output import console, print_json
    from service.exports import export_estimate

    report = export_estimate(estimate, urdf, mjcf, project=project)
    if as_json:
        print_json(report.content())
        return
    print_report(console(), report)


def print_report(out: Console, report: ExportReport) -> None:
    """Print what was written, how well it agrees and what the files lack."""
    from service.cli.output import table

    for kind, path in report.files.items():
        out.print(f"Wrote {kind}: {path}{'  [simulated]' if report.simulated else ''}", markup=False)
    title = f"Files read back against the estimate, {report.motions} random motions"
    rows = [(what, f"{error:.1e}") for what, error in report.errors.items()]
    out.print(table(title, ("compared", "largest relative error"), rows))
    if report.beyond_mjcf:
        rows = [(joint, f"{value:.3g}") for joint, value in report.beyond_mjcf.items()]
        out.print(table("Only in the sidecar, not in the MJCF", ("joint", "largest torque"), rows))
    for note in report.notes:
        out.print(f"Note: {note}", markup=False)
