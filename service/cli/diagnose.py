"""``residuum diagnose``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console


def diagnose(
    run: Annotated[Path, typer.Argument(help="The log to diagnose (MCAP).")],
    robot: Annotated[str | None, typer.Option(help="Preset name or path of a robot.toml; the log's own when left out.")] = None,
    validate: Annotated[Path | None, typer.Option(help="A recording that is not used in the fit, to show the gain on.")] = None,
    against: Annotated[Path | None, typer.Option(help="An earlier estimate.json, or a simulator's log (MCAP), to compare with.")] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Where to write the diagnosis (JSON).")] = None,
    report: Annotated[Path | None, typer.Option(help="Where to write the report for people (one HTML page that prints).")] = None,
    model: Annotated[str | None, typer.Option(help="combined, internal or external; the richest the log allows when left out.")] = None,
    free: Annotated[bool, typer.Option("--free", help="Treat the run as non-periodic.")] = False,
    periodic: Annotated[bool, typer.Option("--periodic", help="Insist on a period, whatever kind of run the log states.")] = False,
    bandwidth: Annotated[float | None, typer.Option(help="Non-periodic: cut-off of the differentiating filter [Hz].")] = None,
    decimate: Annotated[int | None, typer.Option(help="Non-periodic: keep every so many samples after filtering.", min=1)] = None,
    trim: Annotated[int, typer.Option(help="Non-periodic: samples to drop at either end.", min=0)] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the diagnosis as JSON.")] = False,
) -> None:
    """Find the physics that the model lacks: where it sits, its name, its size, and the proof on held-out data.

    Example: residuum diagnose run.mcap --robot ir361 --validate validation.mcap -o diagnosis.json
    """
    from identify.fit import FitOptions
    from identify.free_motion import FreeOptions
    from service.cli.output import console, print_json
    from service.diagnosing import diagnose_log
    from service.files import check_writable, to_json, write_text

    check_writable(output, "the diagnosis")
    check_writable(report, "the report")
    options = FitOptions(kind=model, periodic=False if free else True if periodic else None, free=FreeOptions(bandwidth, decimate, trim))
    found = diagnose_log(run, robot, validate, options, against=against)
    if output is not None:
        write_text(output, to_json(found.content), "the diagnosis")
    if report is not None:
        from service.report.page import report_html

        write_text(report, report_html(found.content), "the report")
    if as_json:
        print_json(found.content)
        return
    print_diagnosis(console(), found.content)
    if output is not None:
        console().print(f"\nWritten to {output}.")
    if report is not None:
        console().print(f"Report for people: {report}.")


def print_diagnosis(out: Console, content: dict[str, Any]) -> None:
    """Print a diagnosis as an operator reads it.

    Args:
        out: the console.
        content: ``diagnosis.json``.
    """
    simulated = "  [simulated]" if content["simulated"] else ""
    out.print(f"Robot {content['robot']}, {content['model']} model{simulated}. Verdict: {content['verdict'].replace('_', ' ')}.", markup=False)
    out.print(f"Where: {content['location']['verdict']}.", markup=False)
    for item in content["findings"]:
        out.print(f"\n* {item['effect']}: {item['sentence']}", markup=False)
        where = item["where"]
        out.print(
            f"  chance by noise {item['p_value']:.1e}, chi-square gain {item['delta_chi2']:.0f}; shows in {', '.join(where['channels'])}, {where['region']}.",
            markup=False,
        )
        if item["alternatives"]:
            out.print(f"  These data cannot tell it from: {', '.join(item['alternatives'])}.", markup=False)
    if content["unexplained"]:
        out.print(f"\nUnexplained: {content['unexplained']['sentence']}", markup=False)
    if content.get("against"):
        _print_against(out, content["against"])
    if content["next_experiment"]:
        out.print(f"\nNext experiment: {content['next_experiment']['sentence']}", markup=False)
    _print_rms(out, content)
    for warning in content["warnings"]:
        out.print(f"Warning: {warning}", markup=False)


def _print_against(out: Console, found: dict[str, Any]) -> None:
    from service.cli.output import table

    if found["kind"] == "estimate":
        if not found["changes"]:
            out.print(f"\n{found['sentence']}", markup=False)
        return
    out.print(f"\n{found['sentence']}", markup=False)
    keys = ("difference", "parameters", "effects", "rest", "noise")
    rows = [(channel, *(f"{item[key]:.3g}" for key in keys)) for channel, item in found["channels"].items()]
    out.print(table("Recording less simulation, RMS (N.m, N)", ("channel", *keys), rows))
    for item in found["changes"]:
        out.print(f"  {item['effect']}: {item['sentence']}", markup=False)


def _print_rms(out: Console, content: dict[str, Any]) -> None:
    from service.cli.output import table

    training, validation = content["fit"]["training"], content["fit"]["validation"]

    def text(source: dict[str, Any], key: str, channel: str) -> str:
        value = source[key].get(channel)
        return "-" if value is None else f"{value:.3g}"

    rows = [
        (channel, *(text(training, key, channel) for key in ("before", "after", "noise")), *(text(validation, key, channel) for key in ("before", "after", "noise")))
        for channel in training["before"]
    ]
    out.print("")
    out.print(table("RMS (N.m, N): averaged run, then held-out recording", ("channel", "before", "after", "noise", "before", "after", "noise"), rows))
