"""The command line: parse, call, render, exit. Each command has a module; heavy imports are inside the commands."""

import os
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Annotated, Final

import typer
from typer.main import get_command

from busplan import __version__
from busplan.cli.lazy import SETTINGS, LazyGroup
from busplan.cli.options import NoPagerOption
from busplan.cli.output import CANNOT, PAGER, PLAN_FAILS, PlanFailsError, mend_streams, say, signals_end_the_run
from busplan.errors import BusplanError

app = typer.Typer(
    name="busplan",
    cls=LazyGroup,
    help="""Does this motion network fit its period, how many axes can it carry, and is the circle still round?

    busplan answers from one TOML profile of a host and motion nodes on IEEE 1394 (FireWire), CAN, EtherCAT, SERCOS or
    a polled bus: PROFIBUS, Modbus, WorldFIP, serial servos. Some profiles are shipped (see `busplan profiles`);
    `busplan init` writes one to start from. `busplan COMMAND --help` describes a command.

    Example: busplan capacity paper-4ms
    """,
    epilog="Exit codes: 0 done, 1 the answer is no (findings, no plan, a circle that fails), 2 could not do the job, "
    "130 interrupted, 143 terminated, 129 hung up.",
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
        bool, typer.Option("--version", help="Show the version and exit.", callback=_print_version, is_eager=True)
    ] = False,
    no_pager: NoPagerOption = False,
) -> None:
    if no_pager:
        os.environ[PAGER] = ""


_command: Final = cache(get_command)
"""Command of a typer app, made once: a process may run several command lines."""


def run() -> None:
    """Run the command line and exit with one of the codes in its epilog."""
    mend_streams()
    try:
        _require_memory()
        with signals_end_the_run():
            sys.exit(_command(app)(prog_name="busplan"))
    except SystemExit as leaving:
        # Typer exits with 2 for usage, 130 for Ctrl-C, and 1 for a closed pipe or other errors, which is no verdict.
        sys.exit(CANNOT if leaving.code == PLAN_FAILS else leaving.code)
    except PlanFailsError:
        sys.exit(PLAN_FAILS)
    except BusplanError as error:
        say(*error.problems)
    except OSError as error:
        say(_in_words(error))
    except MemoryError:
        say("not enough memory")
    except Exception as error:  # noqa: BLE001 - Python's exit code 1 would read as a verdict
        say(f"busplan itself failed ({type(error).__name__}: {error}); please report this")
    sys.exit(CANNOT)


_LEAST_BYTES: Final = 200_000_000
"""Least address space: with less, numpy's linear algebra ends the process with 1, which would read as a verdict."""


def _require_memory() -> None:
    """Refuse a limit on memory that no command is sure to keep."""
    with suppress(ImportError):  # no POSIX
        from resource import RLIM_INFINITY, RLIMIT_AS, getrlimit

        most_bytes, _ = getrlimit(RLIMIT_AS)
        if most_bytes != RLIM_INFINITY and most_bytes < _LEAST_BYTES:
            raise BusplanError(
                f"not enough memory: this process may use {most_bytes / 1e6:.0f} MB (ulimit -v), "
                f"and busplan needs {_LEAST_BYTES / 1e6:.0f}"
            )


def _in_words(error: OSError) -> str:
    """Message of an error of the operating system."""
    try:
        Path.cwd()
    except OSError:
        return "the working folder no longer exists; change into one that does"
    return ": ".join(str(part) for part in (error.filename, error.strerror or error) if part)
