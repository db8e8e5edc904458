"""The one place that writes: the document to stdout, the rest to stderr, files atomically."""

import io
import os
import stat
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from errno import EISDIR
from pathlib import Path
from typing import Any

from busplan.cli.interrupt import StoppedError
from busplan.errors import BusplanError

PLAN_FAILS: int = 1
"""Exit code of a plan that does not hold."""
CANNOT: int = 2
"""Exit code of a run that could not do its job."""

_LONG_NAME = 200
_NEW_MODE = 0o666
"""Permissions of a new file, less what the user's umask takes."""


class PlanFailsError(Exception):
    """The answer is out, and it is that the plan does not hold: exit with `PLAN_FAILS`."""


def say(*messages: str) -> None:
    """Write a summary or errors to stderr, a line each; a closed stderr is no reason to fail."""
    from busplan.printable import printable  # a run that says nothing need not load it

    with suppress(OSError):
        for message in messages:
            # What a user typed or a file is called may hold anything: nothing of it commands the terminal.
            print(printable(message), file=sys.stderr, flush=True)  # noqa: T201 - this is the place that prints


def emit_text(text: str) -> None:
    """Write words for a reader to stdout, in the encoding of the terminal, with escapes for what it lacks.

    Raises
    ------
    BusplanError
        stdout is closed, or cannot take it all.
    """
    sys.stdout.write(text)
    sys.stdout.flush()


def emit_document(document: str | bytes) -> None:
    """Write what a program reads to stdout: its text is UTF-8, whatever the terminal's encoding.

    Raises
    ------
    BusplanError
        As `emit_text`.
    """
    sys.stdout.flush()
    sys.stdout.buffer.write(document_bytes(document))
    sys.stdout.buffer.flush()


def document_bytes(document: str | bytes) -> bytes:
    """Bytes of a document, on every way out; a path that is no UTF-8 becomes escapes, which reading JSON takes back."""
    return document.encode("utf-8", "backslashreplace") if isinstance(document, str) else document


def refuse_terminal(form: str) -> None:
    """Refuse to write bytes that are no text to a terminal.

    Raises
    ------
    BusplanError
        stdout is one.
    """
    if sys.stdout.isatty():
        raise BusplanError(f"--format {form}: is no text for a terminal; give -o FILE.{form}, or send it down a pipe")


def write_document(document: str | bytes, output: Path | None, *, quiet: bool = False) -> None:
    """Write a document to its file, and say so; or to stdout, where no file is asked for.

    Raises
    ------
    BusplanError
        It cannot be written.
    """
    if output is None:
        emit_document(document)
        return
    write_file(output, document_bytes(document), overwrite=True)
    if not quiet:
        say(f"wrote {output}")


def is_styled() -> bool:
    """Whether to write with colours: on a terminal, or where FORCE_COLOR asks for them."""
    return os.environ.get("FORCE_COLOR", "0") not in ("", "0") or sys.stdout.isatty()


def write_file(path: Path, content: bytes, *, overwrite: bool) -> None:
    """Write a file as a whole or not at all.

    Raises
    ------
    BusplanError
        It exists and `overwrite` is false, or it cannot be written.
    """
    with new_file(path, overwrite=overwrite) as file:
        file.write(content)


def partial_path(path: Path) -> Path:
    """What the file of a stopped run is called: rows.csv becomes rows.partial.csv."""
    return path.with_name(f"{path.stem}.partial{path.suffix}")


@contextmanager
def new_file(path: Path, *, overwrite: bool, keeps_partial: bool = False) -> Iterator["NewFile"]:
    """Open a file that appears as a whole or not at all: a temporary one beside it, which takes its name at the end.

    It is opened at once, so that a path that cannot be written is refused before the work for it is done. What fails
    inside leaves the old file as it was. With `keeps_partial`, what a `StoppedError` leaves
    behind takes the partial name.

    Raises
    ------
    BusplanError
        It exists and `overwrite` is false, or it cannot be written.
    """
    target = Path(os.path.realpath(path))
    # What a file is called may be as long as a name can be.
    stem = target.name if len(os.fsencode(target.name)) <= _LONG_NAME else "busplan"
    temporary = target.with_name(f".{stem}.{os.urandom(4).hex()}.tmp")
    stopped: StoppedError | None = None
    with ExitStack() as last:
        with _named(path, target):
            mode = _mode_of(target, overwrite=overwrite)
            last.callback(_remove, temporary)
            file = NewFile(_Raw(temporary, path=path, target=target))
        last.callback(_close, file)
        try:
            # What the caller's own work raises is the caller's to tell.
            yield file
        except StoppedError as error:
            if not keeps_partial:
                raise
            stopped, target, overwrite = error, partial_path(target), True
        if file.abandoned:
            return
        with _named(path, target):
            file.flush()
            os.fsync(file.fileno())
            _give_name(file.fileno(), temporary)
            file.close()
            if mode is not None:
                temporary.chmod(mode)
            if overwrite:
                temporary.replace(target)
            else:
                _rename_new(temporary, target)
        if stopped is not None:
            raise stopped


class _Raw(io.FileIO):
    """A new file that says itself that it cannot be written: a full disk shows in the caller's own write."""

    def __init__(self, temporary: Path, *, path: Path, target: Path) -> None:
        self._names = path, target
        super().__init__(temporary, "xb", opener=_opened)

    def write(self, data: Any, /) -> int:
        with _named(*self._names):
            return super().write(data)


class NewFile(io.BufferedWriter):
    """A file in the making."""

    abandoned = False

    def abandon(self) -> None:
        """Leave what was there before as it is: nothing takes its name at the end."""
        self.abandoned = True


def _opened(temporary: str, flags: int) -> int:
    """Open a file that has no name yet, where the system has such: a process that is killed leaves nothing of it."""
    if hasattr(os, "O_TMPFILE") and Path("/proc/self/fd").is_dir():
        with suppress(OSError):
            return os.open(Path(temporary).parent, os.O_TMPFILE | os.O_WRONLY, _NEW_MODE)
    return os.open(temporary, flags, _NEW_MODE)


def _give_name(descriptor: int, temporary: Path) -> None:
    if os.fstat(descriptor).st_nlink:
        return
    nameless = f"/proc/self/fd/{descriptor}"
    try:
        # A descriptor for the folder, though the path begins at the root: only so does Python follow the link.
        os.link(nameless, temporary, src_dir_fd=descriptor)
    except OSError:  # a file system without hard links
        from shutil import copyfile

        copyfile(nameless, temporary)


def _close(file: NewFile) -> None:
    with suppress(OSError, ValueError, BusplanError):
        file.close()


def _remove(temporary: Path) -> None:
    with suppress(OSError, ValueError):
        temporary.unlink()


@contextmanager
def _named(path: Path, target: Path) -> Iterator[None]:
    """Say in the user's words what cannot be done with a file."""
    try:
        yield
    except FileExistsError:
        raise BusplanError(f"{path}: already there; give another name, or --force to overwrite it") from None
    except FileNotFoundError:
        raise BusplanError(f"{path}: cannot be written: there is no folder {target.parent}") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise BusplanError(f"{path}: cannot be written: {reason}") from None


def _mode_of(target: Path, *, overwrite: bool) -> int | None:
    """Permissions of the file that is to be replaced; what may not be replaced is said before the work for it."""
    if not os.path.lexists(target):
        return None
    if not overwrite:
        raise FileExistsError
    status = target.stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("is no regular file")
    return stat.S_IMODE(status.st_mode)


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
