"""``residuum doctor``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def doctor(
    robot: Annotated[
        str | None, typer.Argument(help="Preset name or robot.toml whose bus and plate are looked at.")
    ] = None,
    folder: Annotated[Path, typer.Option(help="Where logs go.")] = Path("."),
    json: Annotated[bool, typer.Option("--json", help="Print JSON only.")] = False,
) -> None:
    """Check buses, permissions, latency timers, clocks and disk, and print the fix for each fault.

    Exits with 3 where recording on hardware would fail. Nothing is sent to any device.

    Example: residuum doctor my_robot/robot.toml
    """
    from dataclasses import asdict

    from service.cli.output import console, print_json
    from service.doctor import examine
    from service.robots import load_robot

    found = examine(load_robot(robot) if robot is not None else None, folder)
    errors = [finding for finding in found if finding.level == "error"]
    if json:
        findings = [asdict(finding) for finding in found]
        print_json({"schema_version": 1, "fit": not errors, "findings": findings})
    else:
        out = console()
        for finding in found:
            out.print(f"{finding.level:<8} {finding.area:<11} {finding.sentence}", markup=False)
            if finding.fix:
                out.print(f"{'':<21}fix: {finding.fix}", markup=False)
    if errors:
        raise typer.Exit(3)
