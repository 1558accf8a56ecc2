"""``residuum design``: the most telling motion that keeps every limit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from identify.excitation.design import Design
    from identify.excitation.search import Progress


def design(
    robot: Annotated[str, typer.Argument(help="Preset name or path to a robot.toml.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The excitation file to write.")],
    harmonics: Annotated[int, typer.Option(help="Lines of the series.")] = 5,
    fundamental: Annotated[float, typer.Option(help="Repetition rate [Hz].")] = 0.1,
    rate: Annotated[float, typer.Option(help="Sampling rate of the run [Hz].")] = 150.0,
    periods: Annotated[int, typer.Option(help="Periods the run will average.")] = 16,
    criterion: Annotated[str, typer.Option(help="d, a, condition, balanced or discriminating.")] = "d",
    effect: Annotated[
        list[str] | None, typer.Option(help="NAME:JOINT to reveal or tell apart; repeat.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the random starts.")] = 0,
    starts: Annotated[int, typer.Option(help="Number of random starts.")] = 5,
    share: Annotated[float, typer.Option(help="Part of every joint limit that may be used.")] = 0.99,
    workspace: Annotated[Path | None, typer.Option(help="Obstacles and bodies, a TOML file.")] = None,
    noise_from: Annotated[Path | None, typer.Option(help="Estimate whose noise levels to expect.")] = None,
    reference: Annotated[Path | None, typer.Option(help="Estimate whose parameters to expect.")] = None,
    warm_start: Annotated[Path | None, typer.Option(help="Excitation to start from besides.")] = None,
    twin: Annotated[Path | None, typer.Option(help="Write the same path in reversed time.")] = None,
    slow: Annotated[Path | None, typer.Option(help="Write the same path four times slower.")] = None,
    validation: Annotated[Path | None, typer.Option(help="Write 20 random points with full stops.")] = None,
    poses: Annotated[Path | None, typer.Option(help="Write 30 static poses.")] = None,
    sweeps: Annotated[Path | None, typer.Option(help="Write constant-speed sweeps of every joint.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Draw the design as SVG.")] = None,
    jobs: Annotated[int, typer.Option(help="Worker processes; the result does not depend on it.")] = 2,
    json: Annotated[bool, typer.Option("--json", help="Print JSON only.")] = False,
) -> None:
    """Design a periodic excitation: D-optimal for the combined model, inside every limit at every instant.

    Ctrl-C stops the search and keeps the best so far.

    Example: residuum design ir361 -o excitation.json --twin twin.json --picture design.svg
    """
    from identify.excitation.design import DesignOptions
    from service.design_inputs import estimate_noise, estimate_values, robot_workspace
    from service.designs import design_excitation, excitation_content, read_series, write_content
    from service.files import check_writable
    from service.robots import load_robot

    companions = {"twin": twin, "slow": slow, "validation": validation, "poses": poses, "sweeps": sweeps}
    for path, what in (
        (output, "the excitation"),
        (picture, "the picture"),
        *((p, "the companion") for p in companions.values()),
    ):
        check_writable(path, what)
    loaded = load_robot(robot)
    options = DesignOptions(
        harmonics, fundamental, rate, periods, criterion, seed, starts,
        share=share,
        workspace=robot_workspace(loaded, workspace),
        effects=tuple(effect or ()),
        noise=loaded.file.noise if noise_from is None else estimate_noise(noise_from),
        noise_source=f"the robot file {loaded.where}" if noise_from is None else f"the estimate {noise_from}",
        reference=None if reference is None else estimate_values(reference),
        reference_source=str(reference or ""),
        warm_start=None if warm_start is None else read_series(warm_start),
    )  # fmt: skip
    result = design_excitation(loaded, options, jobs, None if json else _show)
    content = excitation_content(result)
    write_content(output, content, "the excitation")
    written = _write_companions(result, loaded, companions)
    if picture is not None:
        from service.design_picture import draw_design
        from service.files import write_text

        write_text(picture, draw_design(result, loaded.robot), "the picture")
    if json:
        import json as encoder

        typer.echo(encoder.dumps({"output": str(output), "companions": written, **content}, indent=1))
    else:
        _print(result, output)


def _show(progress: Progress) -> None:
    import sys

    if sys.stderr.isatty():
        typer.echo(
            f"\r{progress.done}/{progress.total} starts, best criterion {progress.best:.3f} ",
            nl=False,
            err=True,
        )
        if progress.done == progress.total:
            typer.echo("", err=True)


def _write_companions(result: Design, loaded, paths: dict[str, Path | None]) -> list[str]:  # noqa: ANN001
    from service.design_companions import companion_content
    from service.designs import write_content

    written = []
    for kind, path in paths.items():
        if path is not None:
            write_content(path, companion_content(result, loaded, kind), f"the {kind} file")
            written.append(str(path))
    return written


def _print(result: Design, output: Path) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    state = "stopped early, best so far" if result.interrupted else f"{result.evaluations} evaluations"
    console.print(
        f"{output}: {result.model} model, criterion {result.options.criterion}, {state}",
        style="bold",
        markup=False,
    )
    table = Table(box=box.SIMPLE, title="What is reached, and how much of the limit")
    for heading in ("joint", "position", "velocity", "acceleration", "torque"):
        table.add_column(heading, justify="left" if heading == "joint" else "right", no_wrap=True)
    peaks, limits = result.peaks, result.limits
    for k, name in enumerate(result.joints):
        pairs = [
            (getattr(peaks, key)[k], getattr(limits, key)[k])
            for key in ("velocity", "acceleration", "effort")
        ]
        span = (peaks.upper[k] - peaks.lower[k]) / (limits.upper[k] - limits.lower[k])
        table.add_row(
            name,
            f"{peaks.lower[k]:.2f}..{peaks.upper[k]:.2f} ({span:.0%})",
            *(f"{value:.3g} ({value / limit:.0%})" for value, limit in pairs),
        )
    console.print(table)
    console.print(
        f"log det of the covariance {result.expected.log_det_covariance:.1f} (drawn by "
        f"hand {result.plain.log_det_covariance:.1f}), "
        f"condition {result.expected.condition_number:.4g} ({result.plain.condition_number:.4g})",
        markup=False,
    )
    console.print(
        f"Starts and stops at rest within {result.ramp.duration_s:g} s on the same path.", markup=False
    )
    if np_finite(result.peaks.clearance_m):
        console.print(f"Nearest approach {result.peaks.clearance_m:.3f} m.", markup=False)
    for name, size in result.expected.smallest_detectable.items():
        console.print(f"Smallest detectable {name}: {size:.4g}", markup=False)
    console.print(f"Reference model: {result.reference.sentence}", markup=False)
    console.print(f"Noise: {result.noise.sentence}", markup=False)


def np_finite(value: float) -> bool:
    """Whether a number is finite, without importing numpy for it."""
    return value not in (float("inf"), float("-inf")) and value == value
