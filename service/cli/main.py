"""Entry point: finds the command's module, turns errors into one sentence and an exit code."""

from __future__ import annotations

import difflib
import importlib
import sys
from collections.abc import Mapping
from importlib.metadata import version

# command -> (module, first line of its help); modules are imported only when their command is used
COMMANDS: Mapping[str, tuple[str, str]] = {
    "demo": ("demo", "The whole story on the virtual robot, no hardware needed."),
    "design": ("design", "The periodic excitation that tells most about a robot, inside its limits."),
    "record": ("record", "A run on the drives and the plate, or on the virtual robot."),
    "inspect": ("inspect", "What is in a log, and whether it is fit for use."),
    "identify": ("identify", "Parameters, torque constants and covariance from a log."),
    "diagnose": ("diagnose", "The physics a model lacks: where, which, how much, and the proof."),
    "simulate": ("simulate", "What a model says a recording's sensors would have shown, as a log."),
    "export": ("export", "An estimate as URDF and MJCF."),
    "prove": ("prove", "Blind trials of the diagnosis on concealed effects."),
    "import": ("import_", "A foreign recording (csv, npz, db3, mcap) as a log."),
    "serve": ("serve", "The REST API and the lab's web page."),
    "nightly": ("nightly", "Recalibrate for the night: compare with what is in force, propose or accept, alert."),
    "doctor": ("doctor", "Is this machine fit to record, and what to do where it is not."),
    "recover": ("recover", "A broken log's intact part as a valid log."),
}
_INTERRUPTED = 130  # what shells report for Ctrl-C


def main() -> None:
    """Run the command line and exit: 0 success, 2 wrong use, 3 hardware, 4 unusable data, 1 anything else."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command.

    Args:
        arguments: words after the program's name.

    Returns:
        The exit code.
    """
    if not arguments or arguments[0] in ("--help", "-h"):
        print(_help())
        return 0
    if arguments[0] == "--version":
        print(f"residuum {version('residuum')}")
        return 0
    name = arguments[0]
    if name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, n=1)
        hint = f"did you mean '{near[0]}'?" if near else "see residuum --help."
        return _complain(f"There is no command '{name}'; {hint}", 2)
    try:
        return _call(name, arguments[1:])
    except (KeyboardInterrupt, EOFError):
        return _complain("Interrupted; nothing was half-written.", _INTERRUPTED)
    except BrokenPipeError:
        sys.stderr.close()  # the reader has gone: nobody is left to tell
        return 1
    except Exception as error:  # the operator gets a sentence, never a traceback
        return _complain(*_explain(error))


def _call(name: str, arguments: list[str]) -> int:
    import typer

    module_name = COMMANDS[name][0]
    module = importlib.import_module(f"service.cli.{module_name}")
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command(name=name)(getattr(module, module_name))
    try:
        result = app(arguments, prog_name=f"residuum {name}", standalone_mode=False)
    except typer.Exit as leaving:
        return int(leaving.exit_code)
    except typer.Abort:
        return _complain("Interrupted; nothing was half-written.", _INTERRUPTED)
    return result if isinstance(result, int) else 0


def _help() -> str:
    width = max(len(name) for name in COMMANDS) + 2
    lines = [
        "Usage: residuum COMMAND [OPTIONS]",
        "",
        "Record robots, identify their dynamics with uncertainty, find the physics a simulation left out.",
        "",
        "Commands:",
        *(f"  {name:<{width}}{text}" for name, (_, text) in COMMANDS.items()),
        "",
        "Each command has --help and --json.",
        "Example: residuum identify run.mcap --robot ir361 -o estimate.json",
    ]
    return "\n".join(lines)


def _explain(error: Exception) -> tuple[str, int]:
    code = getattr(error, "exit_code", None)
    if isinstance(code, int):
        formatted = getattr(error, "format_message", None)  # the command-line parser's own complaints
        return (formatted() if formatted else str(error)), (2 if formatted else code)
    if isinstance(error, OSError):
        name, reason = error.filename or "A file", error.strerror or str(error)
        return f"{name}: {reason}; check the path, its permissions and the free space.", 2
    if isinstance(error, MemoryError):
        return "Not enough memory for this recording; identify a shorter part of it.", 1
    kind = type(error).__name__
    return f"Unexpected {kind}: {error}; this is a fault of residuum, please report it with the command.", 1


def _complain(sentence: str, code: int) -> int:
    print("Error: " + " ".join(sentence.split()), file=sys.stderr)
    return code
