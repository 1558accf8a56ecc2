"""``residuum nightly``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from service.nightly.night import NightReport


def nightly(
    robot: Annotated[str, typer.Argument(help="Serial number of the robot, as the server knows it.")],
    recording: Annotated[
        str | None, typer.Option(help="Recording on the server, or a log file to upload.")
    ] = None,
    validation: Annotated[str | None, typer.Option(help="Held-out recording or file.")] = None,
    excitation: Annotated[
        str | None, typer.Option(help="Excitation on the server: record the robot with it.")
    ] = None,
    server: Annotated[
        str | None,
        typer.Option(help="Address of residuum serve; the configuration's host and port when left out."),
    ] = None,
    token_file: Annotated[
        Path | None, typer.Option(help="File with the token; else the variable RESIDUUM_TOKEN.")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="Configuration (TOML): policy, levels, alerts.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Recalibrate for the night: identify, diagnose, compare with what is in force, propose or accept, alert.

    With --excitation the robot moves: warm-up, run, validation; only where it is cleared for that. The token
    needs the scope run, and accept where the policy may accept by itself.

    Example: residuum nightly IR361-0007 --recording run.mcap --validation validation.mcap --token-file token
    """
    from service.cli.output import print_json
    from service.config import load_config
    from service.errors import UsageError
    from service.nightly.alerts import send_alarms
    from service.nightly.client import RestClient
    from service.nightly.night import Night, NightPlan

    if (recording is None) == (excitation is None):
        raise UsageError("Give either --recording, a run to identify, or --excitation, a motion to record.")
    settings = load_config(config)
    address = server or f"http://{settings.server.host}:{settings.server.port}"
    client = RestClient(address, _token(token_file))
    names = [client.stored(robot, given) if given else None for given in (recording, validation)]
    plan = NightPlan(robot, names[0], names[1], excitation)
    report = Night(client, settings.nightly).run(plan)
    unsent = send_alarms(settings.alerts, robot, report.fresh, report.outcome)
    if as_json:
        print_json(_content(report) | {"unsent": unsent})
    else:
        _print(report, unsent)
    if report.outcome == "failed":
        raise typer.Exit(1)


def _token(path: Path | None) -> str:
    from service.errors import UsageError

    if path is None:
        found = os.environ.get("RESIDUUM_TOKEN", "")
    elif path.is_file():
        found = path.read_text(encoding="utf-8").strip()
    else:
        raise UsageError(
            f"The token file {path} does not exist; write the token into it, readable by you alone."
        )
    if not found:
        raise UsageError("No token was given; name a file with --token-file, or set RESIDUUM_TOKEN.")
    return found


def _content(report: NightReport) -> dict[str, Any]:
    return {
        "schema_version": 1,
        "outcome": report.outcome,
        "sentence": report.sentence,
        "estimate_id": report.estimate_id,
        "diagnosis_id": report.diagnosis_id,
        "alarms": [vars(alarm) for alarm in report.alarms],
        "fresh": [vars(alarm) for alarm in report.fresh],
    }


def _print(report: NightReport, unsent: list[str]) -> None:
    typer.echo(f"Night {report.outcome}. {report.sentence}")
    for alarm in report.alarms:
        typer.echo(f"Alarm ({alarm.kind}{'' if alarm in report.fresh else ', known'}): {alarm.sentence}")
    for sentence in unsent:
        typer.echo(sentence, err=True)
