"""``residuum record``."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from daq.acquisition import Acquisition
    from daq.preflight import DryRun
    from daq.run_report import RunReport
    from daq.run_state import Change


def record(
    robot: Annotated[str, typer.Argument(help="Preset name or path to a robot.toml.")],
    excitation: Annotated[Path, typer.Option(help="The motion, from residuum design.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Where the log goes (MCAP).")],
    virtual: Annotated[bool, typer.Option("--virtual", help="Record the virtual robot.")] = False,
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Let the virtual robot live in real time.")
    ] = False,
    periods: Annotated[int, typer.Option(help="Periods to measure.")] = 16,
    transient: Annotated[int, typer.Option(help="Periods before them.")] = 1,
    validation: Annotated[
        bool, typer.Option("--validation", help="Move from point to point within the excitation's range.")
    ] = False,
    points: Annotated[int, typer.Option(help="Points of that validation motion.")] = 12,
    rate: Annotated[
        float | None, typer.Option(help="SYNC rate [Hz]; the excitation's when left out.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the virtual robot's noise and the validation points.")] = 0,
    effect: Annotated[
        list[str] | None, typer.Option(help="NAME:PLACE=SIZE on the virtual robot; repeat.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would happen.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON only.")] = False,
) -> None:
    """Record a run: preflight, smooth start, transient and measured periods, smooth end, proof.

    Ctrl-C stops the drives by the stop ladder and keeps what was recorded; a second Ctrl-C halts at once.
    Limits of the robot file and the URDF are checked on every set point and on every measurement.

    Example: residuum record ir361 --excitation excitation.json -o run.mcap --virtual --periods 16
    """
    from service.benches import parse_effect
    from service.recordings import RecordRequest, open_session, preview

    request = RecordRequest(
        robot, excitation, output, virtual, real_time, periods, transient, validation, points, seed,
        tuple(parse_effect(text) for text in effect or ()), rate,
    )
    if dry_run:
        _print_dry_run(preview(request)[1], json)
        return
    changes: list[Change] = []
    session = open_session(request, [changes.append])
    with _interrupts(session.acquisition), _bar(session.acquisition, json):
        report = _run(session.run, json)
    _print_report(report, json)


def _run(run: Callable[[], RunReport], as_json: bool) -> RunReport:
    """The report; one of a run that failed is printed too before its error goes on."""
    from service.errors import RunFailedError

    try:
        return run()
    except RunFailedError as error:
        if as_json:
            from service.cli.output import print_json

            print_json(error.report.to_json())  # type: ignore[attr-defined]
        raise


@contextlib.contextmanager
def _interrupts(acquisition: Acquisition) -> Iterator[None]:
    """Ctrl-C, and a polite kill, once: the stop ladder; twice: at once."""
    pressed = 0

    def press(number: int, frame: object) -> None:
        nonlocal pressed
        pressed += 1
        if pressed > 1:
            raise KeyboardInterrupt
        print("\nStopping; press Ctrl-C again to halt at once.", file=sys.stderr)
        acquisition.abort("The operator stopped the run.")

    former = {number: signal.signal(number, press) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def _bar(acquisition: Acquisition, as_json: bool) -> Iterator[None]:
    """A progress bar with the time left, on a terminal only."""
    if as_json or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

    left = TextColumn("{task.fields[left]}")
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), left)
    with Progress(*columns, console=Console(stderr=True), transient=True, auto_refresh=False) as bar:
        task = bar.add_task("preflight", total=None, left="")
        with _polling(lambda: _show(bar, task, acquisition)):
            yield


@contextlib.contextmanager
def _polling(look: Callable[[], None]) -> Iterator[None]:
    """Call `look` four times a second in a thread of its own: the cycle never waits for a terminal."""
    import threading

    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(0.25):
            look()

    thread = threading.Thread(target=watch, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _show(bar: Any, task: Any, acquisition: Acquisition) -> None:
    now = acquisition.progress()
    left = f"{now.cycle} of {now.cycles} cycles, {now.remaining_s:.0f} s of motion left" if now.cycles else ""
    bar.update(task, description=now.state.value, completed=now.cycle, total=now.cycles or None, left=left)
    bar.refresh()


def _print_report(report: RunReport, as_json: bool) -> None:
    from service.cli.output import console, print_json

    if as_json:
        print_json(report.to_json())
        return
    out = console()
    out.print(report.sentence, markup=False)
    for note in report.notes:
        out.print(f"Note: {note}", markup=False)
    out.print(f"Written to {report.log}.", markup=False)


def _print_dry_run(found: DryRun, as_json: bool) -> None:
    from dataclasses import asdict

    from service.cli.output import console, print_json, table

    if as_json:
        limits = [peak.limit if abs(peak.limit) < 1e300 else None for peak in found.peaks]
        peaks = [{**asdict(peak), "limit": limit} for peak, limit in zip(found.peaks, limits, strict=True)]
        print_json({"schema_version": 1, **asdict(found), "peaks": peaks})
        return
    out = console()
    rows = [
        (p.joint, p.quantity, f"{p.value:.4g}", f"{p.limit:.4g}", "kept" if p.is_kept else "EXCEEDED")
        for p in found.peaks
    ]
    out.print(table("Peaks against limits (rad, s)", ("joint", "quantity", "peak", "limit", ""), rows))
    size = f"about {found.size_bytes / 1e6:.1f} MB"
    out.print(f"{found.cycles} cycles, {found.duration_s:.1f} s, {size}.", markup=False)
