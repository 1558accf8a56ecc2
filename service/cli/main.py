"""Entry point: finds the command's module, turns errors into one sentence and an exit code."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping

import click
import typer
from typer.main import get_command

# command -> (module, first line of its help); modules are imported only when their command is used
COMMANDS: Mapping[str, tuple[str, str]] = {
    "demo": ("demo", "The whole story on the virtual robot, no hardware needed."),
    "inspect": ("inspect", "What is in a log, and whether it is fit for use."),
    "identify": ("identify", "Parameters, torque constants and covariance from a log."),
    "export": ("export", "An estimate as URDF and MJCF."),
    "import": ("import_", "A foreign recording (csv, npz, db3, mcap) as a log."),
    "recover": ("recover", "A broken log's intact part as a valid log."),
}


class LazyGroup(click.Group):
    """Loads a command's module when the command is called, so that --help is quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Name the commands in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of one command and wrap its function."""
        if cmd_name not in COMMANDS:
            return None
        module_name = COMMANDS[cmd_name][0]
        module = importlib.import_module(f"service.cli.{module_name}")
        app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
        app.command(name=cmd_name)(getattr(module, module_name))
        return get_command(app)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, help_text) for name, (_, help_text) in COMMANDS.items()])


def _root() -> LazyGroup:
    return LazyGroup(
        "residuum",
        help="Record robots, identify their dynamics with uncertainty, find the physics a simulation left out.",
        epilog="Example: residuum identify run.mcap --robot ir361 -o estimate.json",
        no_args_is_help=True,
    )


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 success, 2 wrong use, 3 hardware, 4 unusable data, 1 anything else."""
    sys.exit(run(arguments))


def run(arguments: list[str] | None = None) -> int:
    """Run one command.

    Args:
        arguments: words after the program's name; the process's own when not given.

    Returns:
        The exit code.
    """
    try:
        result = _root().main(arguments, prog_name="residuum", standalone_mode=False)
        return result if isinstance(result, int) else 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 0
    except click.ClickException as error:
        return _complain(error.format_message(), 2)
    except click.exceptions.Exit as error:
        return int(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        return _complain("Interrupted; nothing was half-written.", 130)
    except BrokenPipeError:
        return 1
    except Exception as error:  # the operator gets a sentence, never a traceback
        return _complain(*_explain(error))


def _explain(error: Exception) -> tuple[str, int]:
    code = getattr(error, "exit_code", None)
    if isinstance(code, int):
        return str(error), code
    if isinstance(error, OSError):
        return f"{error.filename or 'A file'}: {error.strerror or error}; check the path, its permissions and the free space.", 2
    if isinstance(error, MemoryError):
        return "Not enough memory for this recording; identify a shorter part of it.", 1
    return f"Unexpected {type(error).__name__}: {error}; this is a fault of residuum, please report it with the command.", 1


def _complain(sentence: str, code: int) -> int:
    click.echo("Error: " + " ".join(sentence.split()), err=True)
    return code
