"""``residuum identify``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console


def identify(
    run: Annotated[Path, typer.Argument(help="The log to identify (MCAP).")],
    robot: Annotated[str | None, typer.Option(help="Preset name or path of a robot.toml; the log's own when left out.")] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Where to write the estimate (JSON).")] = None,
    model: Annotated[str | None, typer.Option(help="combined, internal or external; the richest the log allows when left out.")] = None,
    validate: Annotated[Path | None, typer.Option(help="A held-out log to predict.")] = None,
    estimator: Annotated[str, typer.Option(help="markov (weighted), ols, or ml (encoder noise too).")] = "markov",
    nominal_constants: Annotated[bool, typer.Option("--nominal-constants", help="Take the torque constants of the robot file as exact.")] = False,
    free: Annotated[bool, typer.Option("--free", help="Treat the run as non-periodic.")] = False,
    periodic: Annotated[bool, typer.Option("--periodic", help="Insist on a period, whatever kind of run the log states.")] = False,
    bandwidth: Annotated[float | None, typer.Option(help="Non-periodic: cut-off of the differentiating filter [Hz].")] = None,
    decimate: Annotated[int | None, typer.Option(help="Non-periodic: keep every so many samples after filtering.", min=1)] = None,
    trim: Annotated[int, typer.Option(help="Non-periodic: samples to drop at either end.", min=0)] = 0,
    project: Annotated[bool, typer.Option("--project", help="Add the nearest physically consistent parameters.")] = False,
    slow: Annotated[float, typer.Option(help="Non-periodic: leave out rows below this speed [rad/s, m/s].", min=0.0)] = 0.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the estimate as JSON.")] = False,
) -> None:
    """Identify parameters, torque constants and their covariance from a log.

    Example: residuum identify run.mcap --robot ir361 --validate validation.mcap -o estimate.json
    """
    from identify.fit import FitOptions
    from identify.free_motion import FreeOptions
    from service.cli.output import console, print_json
    from service.files import check_writable, to_json, write_text
    from service.identification import identify_log

    check_writable(output, "the estimate")
    options = FitOptions(
        kind=model,
        estimator=estimator,
        periodic=False if free else True if periodic else None,
        free=FreeOptions(bandwidth, decimate, trim, slow=slow),
        nominal_constants=nominal_constants,
    )
    found = identify_log(run, robot, options, validate, project=project)
    if output is not None:
        write_text(output, to_json(found.content), "the estimate")
    if as_json:
        print_json(found.content)
        return
    print_estimate(console(), found.content)
    if output is not None:
        console().print(f"\nWritten to {output}.")


def print_estimate(out: Console, content: dict[str, Any]) -> None:
    """Print an estimate as an operator reads it.

    Args:
        out: the console.
        content: ``estimate.json``.
    """
    from service.cli.output import significant, table, uncertainty

    simulated = "  [simulated]" if content["simulated"] else ""
    counts = ", ".join(f"{key} {value}" for key, value in content["counts"].items())
    out.print(f"Robot {content['robot']}, {content['model']} model{simulated}. Identifiable parameters: {counts}.", markup=False)
    out.print(
        table(
            "Parameters",
            ("name", "value", "std", "unit", "group"),
            [(p["name"], significant(p["value"], p["std"]), uncertainty(p["std"]), p["unit"], p["group"]) for p in content["parameters"]],
        )
    )
    out.print(
        table(
            "Torque constants",
            ("joint", "value", "std", "unit", "nominal"),
            [
                (k["joint"], significant(k["value"], k["std"]), uncertainty(k["std"]), k["unit"], "-" if k["nominal"] is None else f"{k['nominal']:g}")
                for k in content["torque_constants"]
            ],
        )
    )
    for reason in dict.fromkeys(k["reason"] for k in content["torque_constants"] if "reason" in k):
        out.print(f"No torque constants: {reason}.", markup=False)
    _print_fit(out, content)


def _print_fit(out: Console, content: dict[str, Any]) -> None:
    from service.cli.output import table

    noise, rms = content["noise"], content["rms"]
    periods = content["method"].get("periods", 1)
    rows = [
        (
            channel,
            f"{level:.3g}",
            f"{rms['training'][channel]:.3g}",
            f"{level / periods**0.5:.3g}",
            f"{rms['validation'][channel]:.3g}" if channel in rms["validation"] else "-",
        )
        for channel, level in noise.items()
    ]
    out.print(table("Fit (N.m, N)", ("channel", "noise/sample", "rms, averaged", "noise, averaged", "rms, validation"), rows))
    test = content["lack_of_fit"]
    if not content["method"]["periodic"]:
        errors = ", ".join(f"{channel} {value:.2f} %" for channel, value in content["relative_error_percent"].items())
        out.print(f"Relative error: {errors}.", markup=False)
    if test["p"] is None:
        out.print(f"Lack of fit: not tested ({test['reason']}).", markup=False)
    else:
        verdict = "the model fits" if content["intervals_valid"] else "the model does NOT fit; intervals are widened"
        out.print(f"Lack of fit: chi2 = {test['chi2']:.0f} on {test['dof']} degrees of freedom, p = {test['p']:.2g}: {verdict}.", markup=False)
    consistency = content.get("consistency")
    if consistency:
        out.print(f"Physical consistency: {consistency['sentence']}", markup=False)
    if "projection" in content:
        _print_projection(out, content)
    for warning in content["warnings"]:
        out.print(f"Warning: {warning}", markup=False)


def _print_projection(out: Console, content: dict[str, Any]) -> None:
    from service.cli.output import table

    moved = sorted((p for p in content["projected"] if abs(p["shift"]) >= 0.05), key=lambda p: -abs(p["shift"]))
    if moved:
        rows = [(p["name"], f"{p['value']:.4g}", f"{p['shift']:+.2f}") for p in moved]
        out.print(table("Projected (shift in std)", ("name", "value", "shift"), rows))
    out.print(content["projection"], markup=False)
