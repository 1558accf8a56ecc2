"""``residuum prove``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer


def prove(
    trials: Annotated[int, typer.Option(help="How many blind trials.", min=1)] = 300,
    robot: Annotated[str, typer.Option(help="Preset of the virtual robot.")] = "ir361",
    seed: Annotated[int, typer.Option(help="Of the campaign.")] = 1,
    periods: Annotated[int, typer.Option(help="Periods of every run.", min=2)] = 8,
    folder: Annotated[Path, typer.Option(help="Where trials and seals lie; a campaign found there is resumed.")] = Path("out/prove"),
    workers: Annotated[int, typer.Option(help="Processes.", min=1)] = 2,
    report: Annotated[Path | None, typer.Option(help="Where the report goes; FOLDER/report.md when left out.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the scores as JSON.")] = False,
) -> None:
    """Put the diagnosis to blind trials: conceal effects in the virtual robot, diagnose, open the seals, score.

    Interrupt it at will: the same command resumes.

    Example: residuum prove --trials 20 --folder out/prove
    """
    from dataclasses import asdict

    from service.cli.output import console, print_json, table
    from service.files import check_writable, write_text
    from service.proving.campaign import run_campaign
    from service.proving.report import campaign_report, tabulate

    check_writable(report, "the report")
    scores, failures = run_campaign(
        folder, range(trials), robot=robot, seed=seed, periods=periods, workers=workers, progress=_show
    )
    title = f"{len(scores)} trials on {robot}, seed {seed}, {periods} periods each"
    target = report or folder / "report.md"
    write_text(target, campaign_report(scores, failures, title), "the report")
    if as_json:
        print_json({"simulated": True, "scores": [asdict(item) for item in scores], "failures": failures})
        return
    rows = [
        (r.name, str(r.trials), f"{r.right} ({100 * r.right / r.trials:.0f} %)", f"{100 * r.low:.0f}-{100 * r.high:.0f} %", str(r.extra), "-" if r.target is None else f"{100 * r.target:.0f} %")
        for r in tabulate(scores)
    ]
    console().print(table(title + " (simulated)", ("class", "trials", "right", "95 % interval", "extra names", "target"), rows))
    print(f"Report in {target}." + (f" {len(failures)} trials failed; they are listed there." if failures else ""))


def _show(stage: str, done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\r{stage}: {done}/{total} ", end="\n" if done == total else "", file=sys.stderr, flush=True)
