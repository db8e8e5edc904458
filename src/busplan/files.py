"""Atomic writing of files: the old file stays whole until the new one is."""

import io
import os
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from errno import EISDIR
from pathlib import Path
from typing import Any, Final

from busplan.errors import BusplanError

_LONG_NAME: Final = 200
_NEW_MODE: Final = 0o666
"""Permissions of a new file, before the umask."""


EMPTY_PATH: Final = "the path is empty; give the name of a file"


def given_path(path: str | os.PathLike[str]) -> Path:
    """A path that a person gives. pathlib takes an empty one for the working folder; here it raises BusplanError."""
    if not os.fspath(path):
        raise BusplanError(f"'': {EMPTY_PATH}")
    return Path(path)


def document_bytes(document: str | bytes) -> bytes:
    """UTF-8 of a document; bytes of a path that are not UTF-8 become JSON escapes."""
    return document.encode("utf-8", "backslashreplace") if isinstance(document, str) else document


def write_file(path: Path, content: bytes, *, overwrite: bool) -> None:
    """Write a file atomically.

    It raises BusplanError if the file exists and `overwrite` is false, or if it cannot be written.
    """
    with new_file(path, overwrite=overwrite) as file:
        file.write(content)


_OPENED: Final = ("/dev/fd/", "/dev/stdin", "/proc/")
"""Paths of pipes with a writer: in a shell, <(command) is /dev/fd/N."""


def is_unwritten_pipe(path: Path) -> bool:
    """Whether a file is a named pipe, which may wait for a writer for ever when it is opened."""
    return path.is_fifo() and not str(path).startswith(_OPENED)


_KINDS: Final = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFDIR: "a directory",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def require_regular(path: Path, *, or_written_pipe: bool = False) -> None:
    """Refuse a file that may have no end or is read more than once, as a device; a pipe with a writer may be allowed.

    BusplanError: it is no such file, does not exist or cannot be looked at.
    """
    try:
        mode = path.stat().st_mode
    except OSError as error:
        raise BusplanError(f"{path}: cannot be read: {error.strerror}") from None
    if not stat.S_ISREG(mode) and not (or_written_pipe and stat.S_ISFIFO(mode) and not is_unwritten_pipe(path)):
        raise BusplanError(f"{path}: is {_KINDS.get(stat.S_IFMT(mode), 'no file')}; give a regular file")


@contextmanager
def new_file(path: Path, *, overwrite: bool) -> Iterator["NewFile"]:
    """Open a file for atomic writing: a temporary file next to it is renamed at the end.

    It is opened at once, so that a path that cannot be written fails before the work. After an error, the old file is
    unchanged. BusplanError is raised if the file exists and `overwrite` is false, or if it cannot be written.
    """
    target = Path(os.path.realpath(path))
    # The longest possible name leaves no room for a suffix.
    stem = target.name if len(os.fsencode(target.name)) <= _LONG_NAME else "busplan"
    temporary = target.with_name(f".{stem}.{os.urandom(4).hex()}.tmp")
    with ExitStack() as last:
        with naming_errors(path, target):
            mode = _mode_of(target, overwrite=overwrite)
            last.callback(_remove, temporary)
            file = NewFile(_Raw(temporary, path=path, target=target))
        last.callback(_close, file)
        # Errors of the caller's own work pass through.
        yield file
        if file.abandoned:
            return
        with naming_errors(path, target):
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


class _Raw(io.FileIO):
    """A new file whose write errors name the user's path. A full disk shows in the caller's own write."""

    def __init__(self, temporary: Path, *, path: Path, target: Path) -> None:
        self._names = path, target
        super().__init__(temporary, "xb", opener=_opened)

    def write(self, data: Any, /) -> int:
        with naming_errors(*self._names):
            return super().write(data)


class NewFile(io.BufferedWriter):
    """A file that is not yet complete."""

    abandoned = False

    def abandon(self) -> None:
        """Discard the new file at the end and leave an old file unchanged."""
        self.abandoned = True


def _opened(temporary: str, flags: int) -> int:
    """Open a file without a name, if the system supports it, so that a killed process leaves nothing behind."""
    if hasattr(os, "O_TMPFILE") and Path("/proc/self/fd").is_dir():
        with suppress(OSError):
            return os.open(Path(temporary).parent, os.O_TMPFILE | os.O_WRONLY, _NEW_MODE)
    return os.open(temporary, flags, _NEW_MODE)


def _give_name(descriptor: int, temporary: Path) -> None:
    if os.fstat(descriptor).st_nlink:
        return
    nameless = f"/proc/self/fd/{descriptor}"
    try:
        # An absolute path does not use src_dir_fd, but it makes Python follow the link.
        os.link(nameless, temporary, src_dir_fd=descriptor)
    except OSError:  # The file system has no hard links.
        from shutil import copyfile  # noqa: PLC0415 - loaded where it is needed

        copyfile(nameless, temporary)


def _close(file: NewFile) -> None:
    with suppress(OSError, ValueError, BusplanError):
        file.close()


def _remove(temporary: Path) -> None:
    with suppress(OSError, ValueError):
        temporary.unlink()


def lock(descriptor: int) -> bool:
    """Lock an open file or folder until it is closed or the process ends; False if another process has the lock.

    A file system without locks raises OSError.
    """
    from fcntl import LOCK_EX, LOCK_NB, flock  # noqa: PLC0415 - as above

    try:
        flock(descriptor, LOCK_EX | LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextmanager
def naming_errors(path: Path, target: Path) -> Iterator[None]:
    """Convert the operating system's errors about a target to messages with the user's path."""
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
    """Permissions of the file to be replaced, None for a new file.

    A file that may not be replaced raises BusplanError.
    """
    if not os.path.lexists(target):
        return None
    if not overwrite:
        raise FileExistsError
    status = target.stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("is not a regular file")
    return stat.S_IMODE(status.st_mode)


def _rename_new(temporary: Path, target: Path) -> None:
    """Rename a file, but never over an existing one."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError:  # Without hard links in the file system, this is not atomic.
        if os.path.lexists(target):
            raise FileExistsError from None
        temporary.replace(target)
