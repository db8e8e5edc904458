"""The one place that writes: the document to stdout, the rest to stderr, files atomically."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from errno import EISDIR
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import typer

from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.report.lines import Line

PLAN_FAILS: int = 1
"""Exit code of a plan that does not hold."""
CANNOT: int = 2
"""Exit code of a run that could not do its job."""

_STYLES = {"good": "bold green", "bad": "bold red", "warning": "yellow", "heading": "bold", "plain": "", "table": ""}


def say(message: str) -> None:
    """Write a summary or an error to stderr; a closed stderr is no reason to fail."""
    with suppress(OSError):
        print(message, file=sys.stderr, flush=True)  # noqa: T201 - this is the place that prints


def emit_text(text: str) -> None:
    """Write the document to stdout."""
    _to_stdout(lambda: sys.stdout.write(text))


def emit(lines: Iterable["Line"]) -> None:
    """Write a report to stdout: with colours on a terminal, and none under NO_COLOR."""
    # A pipe gets plain lines, and does not wait for the renderer to load.
    if sys.stdout.isatty() or os.environ.get("FORCE_COLOR"):
        _to_stdout(lambda: _print_styled(lines))
    else:
        emit_text("".join(f"{line.text}\n" for line in lines))


def _print_styled(lines: Iterable["Line"]) -> None:
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False, markup=False, emoji=False)
    for line in lines:
        # On a narrow terminal the terminal breaks the lines of a table: no figure is ever cut.
        console.print(Text(line.text, style=_STYLES[line.tone]), soft_wrap=line.tone in ("table", "heading"))


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
    """Write a file as a whole or not at all.

    Raises
    ------
    BusplanError
        It exists and `overwrite` is false, or it cannot be written.
    """
    with new_file(path, overwrite=overwrite) as file:
        file.write(content)


@contextmanager
def new_file(path: Path, *, overwrite: bool) -> Iterator[BinaryIO]:
    """Open a file that appears as a whole or not at all: a temporary one beside it, which takes its name at the end.

    It is opened at once, so that a path that cannot be written is refused before the work for it is done. What fails
    inside leaves the old file as it was.

    Raises
    ------
    BusplanError
        It exists and `overwrite` is false, or it cannot be written.
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{target.name}.{os.urandom(4).hex()}.tmp")
    try:
        _refuse_target(target, overwrite=overwrite)
        # "x" gives the file the permissions that any new file of the user has.
        with temporary.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
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


def _refuse_target(target: Path, *, overwrite: bool) -> None:
    """Say before the work what renaming would say after it."""
    if target.is_dir():
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
    if not overwrite and os.path.lexists(target):
        raise FileExistsError


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
