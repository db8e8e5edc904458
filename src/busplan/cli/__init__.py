"""The command line: parse, call, render, exit. One module a command; heavy imports stand inside the commands."""

import codecs
import os
import sys
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer

from busplan import __version__
from busplan.cli.lazy import SETTINGS, LazyGroup
from busplan.cli.output import CANNOT, PLAN_FAILS, PlanFailsError, say
from busplan.errors import BusplanError

app = typer.Typer(
    name="busplan",
    cls=LazyGroup,
    help="""Does this motion network fit its period, how many axes can it carry, and is the circle still round?

    busplan answers from one TOML profile of an IEEE 1394 (FireWire) network with a host and motion nodes. Some profiles
    are shipped (see `busplan profiles`); `busplan init` writes one to start from. `busplan COMMAND --help` says more of
    a command.

    Example: busplan capacity paper-4ms
    """,
    epilog="Exit codes: 0 done, 1 the plan fails, 2 could not do the job, 130 interrupted.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings=SETTINGS,
)


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
