"""The one place that writes: the document to stdout, the rest to stderr, files atomically."""

import io
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from typing import TYPE_CHECKING

import typer

from busplan.errors import BusplanError

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

CANNOT: int = 2
"""Exit code of a run that could not do its job."""

_PIPE_WIDTH = 100
"""Columns of a table that goes to a file or pipe, where no terminal says how wide it is."""
_ANY_WIDTH = 10_000


def say(message: str) -> None:
    """Write a summary or an error to stderr; a closed stderr is no reason to fail."""
    with suppress(OSError):
        print(message, file=sys.stderr, flush=True)  # noqa: T201 - this is the place that prints


def emit_text(text: str) -> None:
    """Write the document to stdout."""
    _to_stdout(lambda: sys.stdout.write(text))


def emit(parts: "Sequence[RenderableType]") -> None:
    """Write tables and sentences to stdout: colours on a terminal only, and none under NO_COLOR."""
    from rich.console import Console

    console = Console(highlight=False, markup=False, emoji=False)
    if console.is_terminal:
        _to_stdout(lambda: _print_parts(console, parts))
        return
    # A file or pipe has no width: sentences stay on their line, and no line ends in blanks.
    buffer = io.StringIO()
    _print_parts(
        Console(file=buffer, highlight=False, markup=False, emoji=False, width=_PIPE_WIDTH),
        parts,
        soft_wrap=True,
    )
    emit_text("".join(f"{line.rstrip()}\n" for line in buffer.getvalue().splitlines()))


def _print_parts(console: "Console", parts: "Sequence[RenderableType]", *, soft_wrap: bool = False) -> None:
    from rich.table import Table

    for part in parts:
        if isinstance(part, Table) and all(column.no_wrap for column in part.columns):
            # On a narrow terminal the terminal breaks the lines: no figure is ever cut.
            needed = console.measure(part, options=console.options.update(width=_ANY_WIDTH)).maximum
            width, console.width = console.width, max(console.width, needed)
            console.print(part)
            console.width = width
        else:
            console.print(part, soft_wrap=soft_wrap and not isinstance(part, Table))


def _to_stdout(write: Callable[[], object]) -> None:
    try:
        write()
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader has seen enough; Python's own flush at exit must not complain either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(CANNOT) from None
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise BusplanError(f"standard output cannot be written: {error.strerror}") from None


def write_file(path: Path, content: bytes, *, overwrite: bool) -> None:
    """Write a file as a whole or not at all: into a temporary file beside it, which then takes its name.

    Raises
    ------
    BusplanError
        It exists and `overwrite` is false, or it cannot be written.
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.name}.{token_hex(4)}.tmp")
    try:
        _write_synced(temporary, content)
        if overwrite:
            temporary.replace(target)
        else:
            _rename_new(temporary, target)
    except FileExistsError:
        raise BusplanError(f"{path}: already there; give another name, or --force to overwrite it") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise BusplanError(f"{path}: cannot be written: {reason}") from None
    finally:
        with suppress(OSError, ValueError):
            temporary.unlink()


def _write_synced(path: Path, content: bytes) -> None:
    # "x" gives the file the permissions that any new file of the user has.
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _rename_new(temporary: Path, target: Path) -> None:
    """Give a file its name unless the name is taken, even if it was taken a moment ago."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links, which cannot promise the same
        if os.path.lexists(target):
            raise FileExistsError from None
        temporary.replace(target)
