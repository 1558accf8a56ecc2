"""``residuum demo``: the commands an operator would type, run one after the other on the virtual robot."""

from __future__ import annotations

import contextlib
import io
import json
import shlex
import time
from pathlib import Path
from typing import Annotated, Any

import typer

# concealed in the second robot; the commands that diagnose it are not told
_CONCEALED = "stribeck_friction:joint_2=6"


def demo(
    folder: Annotated[Path, typer.Option(help="Where the logs and results go.")] = Path("out/demo"),
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON only.")] = False,
) -> None:
    """Design, record, identify, export and diagnose on the virtual robot, then compare with its truth.

    Two virtual arms are recorded through fake CANopen drives and a fake force plate: one as the model says,
    one with friction concealed in joint 2. Every step is a command you can run yourself.

    Example: residuum demo --folder out/demo
    """
    from service.cli.output import print_json

    folder.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    for title, steps in _story(folder):
        if not as_json:
            print(f"\n=== {title}")
        for step in steps:
            _step(step, as_json)
    summary = _summary(folder) | {"seconds": round(time.perf_counter() - started, 1)}
    if as_json:
        print_json(summary)
    else:
        _print_summary(folder, summary)


def _story(folder: Path) -> list[tuple[str, list[list[str]]]]:
    """Chapters, each with its commands."""

    def at(name: str) -> str:
        return str(folder / name)

    def record(run: str, *more: str) -> list[str]:
        return ["record", "ir361", "--excitation", at("excitation.json"), "-o", at(run), "--virtual", *more]

    concealed = ["--effect", _CONCEALED]
    return [
        ("Design an excitation inside the robot's limits", [["design", "ir361", "-o", at("excitation.json"), "--starts", "4"]]),
        (
            "Record a healthy arm: 16 periods, then points it was not fitted on",
            [record("run.mcap", "--seed", "1"), record("validation.mcap", "--validation", "--seed", "2"), ["inspect", at("run.mcap")]],
        ),
        (
            "Identify it: parameters, torque constants, covariance",
            [
                ["identify", at("run.mcap"), "--robot", "ir361", "--validate", at("validation.mcap"), "-o", at("estimate.json")],
                ["export", at("estimate.json"), "--urdf", at("ir361.urdf"), "--mjcf", at("ir361.xml"), "--project"],
            ],
        ),
        (
            "Record an arm that hides something",
            [
                record("hidden.run.mcap", "--seed", "3", *concealed),
                record("hidden.validation.mcap", "--validation", "--seed", "4", *concealed),
            ],
        ),
        (
            "Find what the model lacks",
            [
                [
                    "diagnose", at("hidden.run.mcap"), "--robot", "ir361", "--validate", at("hidden.validation.mcap"),
                    "-o", at("diagnosis.json"), "--report", at("report.html"),
                ],
            ],
        ),
    ]


def _fresh(arguments: list[str]) -> None:
    """Take away what an earlier demo left under the step's output names."""
    for flag in ("-o", "--urdf", "--mjcf"):
        if flag in arguments:
            path = Path(arguments[arguments.index(flag) + 1])
            for old in (path, path.with_name(path.name + ".partial")):
                old.unlink(missing_ok=True)


def _step(arguments: list[str], quiet: bool) -> None:
    from service.cli.main import run

    _fresh(arguments)
    if quiet:
        with contextlib.redirect_stdout(io.StringIO()):
            code = run(arguments)
    else:
        print(f"\n$ residuum {shlex.join(arguments)}", flush=True)
        code = run(arguments)
    if code:
        raise typer.Exit(code)


def _summary(folder: Path) -> dict[str, Any]:
    """Estimates beside the virtual robot's truth, in std, and what the diagnosis said of the concealed effect."""
    from drivers.virtual.plant_file import load_plant

    estimate = json.loads((folder / "estimate.json").read_text())
    diagnosis = json.loads((folder / "diagnosis.json").read_text())
    truth: dict[str, float] = {}
    for joint in load_plant("ir361").joints:
        truth |= {
            f"{joint.name}.coulomb": joint.coulomb_nm,
            f"{joint.name}.viscous": joint.viscous_nm_s,
            f"{joint.name}.torque_constant": joint.torque_constant_nm_a,
        }
    found = {p["name"]: (p["value"], p["std"]) for p in estimate["parameters"]}
    found |= {f"{k['joint']}.torque_constant": (k["value"], k["std"]) for k in estimate["torque_constants"]}
    rows = [
        {"name": name, "truth": value, "estimate": found[name][0], "std": found[name][1], "deviation_in_std": (found[name][0] - value) / found[name][1]}
        for name, value in truth.items()
    ]
    return {
        "simulated": True,
        "comparison": rows,
        "lack_of_fit_p": estimate["lack_of_fit"]["p"],
        "concealed": _CONCEALED,
        "verdict": diagnosis["verdict"],
        "named": [f"{item['effect']}@{item['joint'] or item['channel']}" for item in diagnosis["findings"]],
    }


def _print_summary(folder: Path, summary: dict[str, Any]) -> None:
    from service.cli.output import console, significant, table, uncertainty

    out = console()
    print("\n=== Beside the virtual robot's truth (simulated)")
    rows = [
        (r["name"], f"{r['truth']:g}", significant(r["estimate"], r["std"]), uncertainty(r["std"]), f"{r['deviation_in_std']:+.1f}")
        for r in summary["comparison"]
    ]
    out.print(table("", ("quantity", "truth", "estimate", "std", "off by (std)"), rows))
    out.print(f"Concealed: {summary['concealed']}. The diagnosis said: {summary['verdict']}, {', '.join(summary['named']) or 'no name'}.", markup=False)
    out.print(f"Took {summary['seconds']} s. Everything lies in {folder}; open report.html in a browser, the logs in Foxglove or PlotJuggler.", markup=False)
