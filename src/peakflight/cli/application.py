"""The group of all commands, and how every error becomes one line and an exit code.

=====  ========================================================================
code   meaning
=====  ========================================================================
0      solved, or proven feasible
1      no feasible trajectory
2      bad input: what was asked, or a file, is against a rule
3      a bug in peakflight
130    interrupted
141    whoever read the output stopped reading
=====  ========================================================================
"""

import os
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import click

import peakflight
from peakflight.cli.analyse import analyse
from peakflight.cli.check import check
from peakflight.cli.compare import compare
from peakflight.cli.edit import edit
from peakflight.cli.exit_codes import BAD_INPUT, INTERRUPTED
from peakflight.cli.export import export
from peakflight.cli.fly import fly
from peakflight.cli.import_ import import_
from peakflight.cli.output import print_json
from peakflight.cli.page import page
from peakflight.cli.paper import paper
from peakflight.cli.plan import plan
from peakflight.cli.plan_many import plan_many
from peakflight.cli.report import report
from peakflight.cli.show import show
from peakflight.cli.tune import tune
from peakflight.cli.vehicles import vehicles
from peakflight.errors import PeakflightError

BUG = 3
PIPE_CLOSED = 141
DEBUG = "PEAKFLIGHT_DEBUG"
"""Environment variable that shows where an unexpected error happened, as `--debug` does."""


class Application(click.Group):
    """A group whose commands return exit codes, and whose errors take one line each."""

    def run(self, arguments: Sequence[str]) -> int:
        """Run a command; whatever happens, it ends in an exit code."""
        arguments = list(arguments)
        try:
            code = self.main(arguments, prog_name="peakflight", standalone_mode=False)
            sys.stdout.flush()
        except (_Interrupted, click.Abort):
            click.echo("peakflight: interrupted", err=True)
            return INTERRUPTED
        except (_PipeClosed, BrokenPipeError):
            _discard_output()
            return PIPE_CLOSED
        except Exception as error:
            return _report(error, arguments)
        return int(code or 0)

    def main(self, *args: Any, **options: Any) -> Any:
        """Run as click does, but for errors."""
        if options.get("standalone_mode", True):
            arguments = options.get("args", args[0] if args else None)
            sys.exit(self.run(sys.argv[1:] if arguments is None else arguments))
        return super().main(*args, **options)

    def invoke(self, context: click.Context) -> Any:
        """Run the command, and keep from click what it would end in other words and codes."""
        try:
            return super().invoke(context)
        except KeyboardInterrupt:
            raise _Interrupted from None
        except BrokenPipeError:
            raise _PipeClosed from None


class _Interrupted(Exception):
    """Ctrl-C."""


class _PipeClosed(Exception):
    """Whoever read the output has stopped."""


@click.group(
    cls=Application,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(peakflight.__version__, message="peakflight %(version)s")
@click.pass_context
def application(context: click.Context) -> int:
    """Plan the fastest smooth trajectory that provably keeps every limit.

    \b
    Example:
      peakflight plan course.csv
      peakflight check course-plan/plan.json
    """  # noqa: D301
    if context.invoked_subcommand is None:
        click.echo(context.get_help())
    return 0


application.add_command(plan)
application.add_command(plan_many)
application.add_command(check)
application.add_command(analyse)
application.add_command(export)
application.add_command(compare)
application.add_command(edit)
application.add_command(import_)
application.add_command(show)
application.add_command(report)
application.add_command(fly)
application.add_command(page)
application.add_command(paper)
application.add_command(tune)
application.add_command(vehicles)


def _report(error: Exception, arguments: Sequence[str]) -> int:
    """Say what went wrong in one line, and how the process should end."""
    code = BAD_INPUT
    if isinstance(error, click.UsageError):
        command = error.ctx.command_path if error.ctx else "peakflight"
        text = error.format_message().rstrip(".")
        message = f"{text[:1].lower()}{text[1:]} (see {command} --help)"
    elif isinstance(error, click.ClickException):
        message = error.format_message()
    elif isinstance(error, PeakflightError):
        message = str(error)
    else:
        code = BUG
        message = (
            f"unexpected {type(error).__name__}: {error}; this is a bug, please report it with "
            "the course file (--debug shows where it happened)"
        )
        if "--debug" in arguments or os.environ.get(DEBUG, "0") not in ("", "0"):
            traceback.print_exception(error)
    message = " ".join(message.split())
    click.echo(f"peakflight: {message}", err=True)
    if "--json" in arguments:
        print_json({"error": message})
    return code


def _discard_output() -> None:
    """Let the interpreter flush into nothing when it ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
