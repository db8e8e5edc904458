"""Files of the user's that are changed and stay theirs: a profile under --apply, a baseline.

A document is replaced by the next one. These keep owner and mode, are not taken apart from their other names, and one
run at a time changes them.
"""

import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from busplan.cli.output import NewFile, new_file, say
from busplan.errors import BusplanError

PATIENCE_S: Final = 30.0
"""How long to wait for another run, which reads and writes a page meanwhile."""
_LOOK_AGAIN_S: Final = 0.02


@contextmanager
def changing(path: Path) -> Iterator[None]:
    """Keep other runs from changing a file between its reading and its writing.

    The folder is locked, not the file: the file is replaced, and may not be there yet. The lock ends with the process,
    whatever ends it.

    Raises
    ------
    BusplanError
        There is no such folder, or another run does not end.
    """
    folder = Path(os.path.realpath(path)).parent
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise BusplanError(f"{path}: cannot be written: folder {folder}: {error.strerror}") from None
    try:
        _lock(descriptor, path)
        yield
    finally:
        os.close(descriptor)


def _lock(folder: int, path: Path) -> None:
    from fcntl import LOCK_EX, LOCK_NB, flock

    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            flock(folder, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end:
                raise BusplanError(
                    f"{path}: another run has been changing a file of this folder for {PATIENCE_S:g} s; try again"
                ) from None
            time.sleep(_LOOK_AGAIN_S)
            continue
        except OSError as error:  # some network file systems have no locks
            say(f"{path}: its folder cannot be locked ({error.strerror}); let no other run write it meanwhile")
        return


def require_changeable(path: Path) -> os.stat_result | None:
    """Refuse a file that cannot be changed and stay what it is; to be called before the work.

    Returns
    -------
    os.stat_result or None
        Of the file, symbolic links followed; None if there is none.

    Raises
    ------
    BusplanError
        No regular file, a read-only one, or one with further hard links.
    """
    try:
        status = path.stat()
    except (OSError, ValueError):  # who reads it says why
        return None
    if not stat.S_ISREG(status.st_mode):
        raise BusplanError(f"{path}: is no regular file, so it cannot be changed")
    # Root may write anything: what a mode forbids is meant for root, too.
    if not status.st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH) or not os.access(path, os.W_OK):
        mode = stat.S_IMODE(status.st_mode)
        raise BusplanError(f"{path}: is read-only (mode {mode:04o}) and stays as it is; make it writable first")
    if status.st_nlink > 1:
        raise BusplanError(
            f"{path}: has {status.st_nlink} hard links, which a new file would part; make a copy of it, and change that"
        )
    return status


def rewrite(path: Path, content: bytes) -> None:
    """Give a file other content, as a whole or not at all; it keeps owner and mode.

    Raises
    ------
    BusplanError
        It cannot be changed (see `require_changeable`) or written, or its owner cannot be kept.
    """
    status = require_changeable(path)
    with new_file(path, overwrite=True) as file:
        if status is not None:
            _keep_owner(file, status, path)
        file.write(content)


def _keep_owner(file: NewFile, status: os.stat_result, path: Path) -> None:
    own = os.fstat(file.fileno())
    if (own.st_uid, own.st_gid) == (status.st_uid, status.st_gid):
        return
    try:
        os.fchown(file.fileno(), status.st_uid, status.st_gid)
    except OSError as error:
        raise BusplanError(
            f"{path}: belongs to user {status.st_uid} and group {status.st_gid}, and would not any more "
            f"({error.strerror}); it stays as it is"
        ) from None
