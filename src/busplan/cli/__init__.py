"""The command line: parse, call, render, exit. One module a command; heavy imports stand inside the commands."""

import codecs
import os
import sys
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer

from busplan import __version__
from busplan.cli import (
    calibrate,
    capacity,
    check,
    circle_test,
    init,
    latency,
    paper,
    plan,
    profiles,
    rule,
    schema,
    sweep,
    timeline,
)
from busplan.cli.output import CANNOT, PLAN_FAILS, PlanFailsError, say
from busplan.errors import BusplanError

app = typer.Typer(
    name="busplan",
    help="Does this motion network fit its period, and how many axes can it carry?",
    epilog="Exit codes: 0 done, 1 the plan fails, 2 could not do the job. Start with: busplan capacity paper-4ms",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
app.command("latency")(latency.latency_command)
app.command("capacity")(capacity.capacity_command)
app.command("circle-test")(circle_test.circle_test_command)
app.command("calibrate")(calibrate.calibrate_command)
app.command("plan")(plan.plan_command)
app.command("timeline")(timeline.timeline_command)
app.command("sweep")(sweep.sweep_command)
app.command("check")(check.check_command)
app.command("rule")(rule.rule_command)
app.command("schema")(schema.schema_command)
app.command("paper")(paper.paper_command)
app.command("profiles")(profiles.profiles_command)
app.command("init")(init.init_command)


def _print_version(wanted: bool) -> None:
    if wanted:
        from busplan.cli.output import emit_text

        emit_text(f"busplan {__version__}\n")
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool,
        typer.Option("--version", help="Show the version and exit.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    pass


def run() -> None:
    """Run the command line and exit: 0 done, 1 the plan fails, 2 could not do the job, 130 interrupted."""
    _mend_streams()
    try:
        app(prog_name="busplan")
    except SystemExit as leaving:
        # Typer exits by itself, with 2 for usage and 130 for Ctrl-C. Its 1 is a closed pipe or worse, and no verdict.
        sys.exit(CANNOT if leaving.code == PLAN_FAILS else leaving.code)
    except PlanFailsError:
        sys.exit(PLAN_FAILS)
    except BusplanError as error:
        say(*error.problems)
    except OSError as error:
        say(f"cannot write: {error.strerror}")
    except Exception as error:  # noqa: BLE001 - the last net: Python's own exit code 1 would read as a verdict
        say(f"busplan itself failed ({type(error).__name__}: {error}); please report this")
    sys.exit(CANNOT)


def _mend_streams() -> None:
    """Make standard streams that can be written to, whatever the caller closed and whatever its encoding."""
    if sys.stderr is None:
        # Errors have nowhere to go; they must not go to stdout.
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - open until the process ends
    codecs.register_error("busplan", _escaped)
    for stream in (sys.stdout, sys.stderr):
        # A terminal without UTF-8 gets escapes instead of a failure.
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="busplan")


def _escaped(error: UnicodeError) -> tuple[str, int]:
    """Escape what an encoding lacks as JSON does: a document is JSON on every stream."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    units = error.object[error.start : error.end].encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at : at + 2].hex()}" for at in range(0, len(units), 2)), error.end
