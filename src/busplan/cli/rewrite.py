"""Change files of the user in place: a profile with --apply, a baseline.

Unlike an output file, such a file keeps its owner and mode, must not have further hard links, and is locked against
other runs.
"""

import os
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from busplan.cli.output import say
from busplan.errors import BusplanError
from busplan.files import NewFile, lock, new_file

if TYPE_CHECKING:
    from busplan.profile.document import Document


PATIENCE_S: Final = 30.0
"""Longest wait for another run, which only reads and writes a short file."""
_LOOK_AGAIN_S: Final = 0.02


@contextmanager
def changing(path: Path) -> Iterator[None]:
    """Lock a file against other runs between reading and writing it.

    The folder is locked, because the file is replaced or may not exist yet. The lock ends with the process at the
    latest. BusplanError: there is no such folder, or another run holds the lock too long.
    """
    if os.name == "nt":  # Windows locks no folder
        yield
        return
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
    end = time.monotonic() + PATIENCE_S
    try:
        while not lock(folder):
            if time.monotonic() > end:
                raise BusplanError(
                    f"{path}: another run has been changing a file of this folder for {PATIENCE_S:g} s; try again"
                )
            time.sleep(_LOOK_AGAIN_S)
    except OSError as error:  # some network file systems have no locks
        say(f"{path}: its folder cannot be locked ({error.strerror}); let no other run write it meanwhile")


def require_changeable(path: Path) -> os.stat_result | None:
    """Refuse a file that cannot be changed in place; call it before the work.

    Returns
    -------
    os.stat_result or None
        Status of the file, symbolic links followed; None if it does not exist.

    Raises
    ------
    BusplanError
        It is not a regular file, is read-only, or has further hard links.
    """
    try:
        status = path.stat()
    except (OSError, ValueError):  # reading it will report the error
        return None
    if not stat.S_ISREG(status.st_mode):
        raise BusplanError(f"{path}: is not a regular file, so it cannot be changed")
    # Root could write it nevertheless, so check the mode, too.
    if not status.st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH) or not os.access(path, os.W_OK):
        mode = stat.S_IMODE(status.st_mode)
        raise BusplanError(f"{path}: is read-only (mode {mode:04o}) and stays as it is; make it writable first")
    if status.st_nlink > 1:
        raise BusplanError(
            f"{path}: has {status.st_nlink} hard links, which replacing it would break; copy it and change the copy"
        )
    return status


def rewrite(path: Path, content: bytes) -> None:
    """Replace the content of a file atomically; it keeps owner and mode.

    BusplanError: it cannot be changed (see `require_changeable`) or written, or its owner cannot be kept.
    """
    status = require_changeable(path)
    with new_file(path, overwrite=True) as file:
        if status is not None:
            _keep_owner(file, status, path)
        file.write(content)


def _keep_owner(file: NewFile, status: os.stat_result, path: Path) -> None:
    new = os.fstat(file.fileno())
    if (new.st_uid, new.st_gid) == (status.st_uid, status.st_gid):
        return
    try:
        os.fchown(file.fileno(), status.st_uid, status.st_gid)
    except OSError as error:
        raise BusplanError(
            f"{path}: belongs to user {status.st_uid} and group {status.st_gid}, which cannot be kept "
            f"({error.strerror}); it stays as it is"
        ) from None


def require_own_file(argument: str) -> None:
    """Refuse a PROFILE argument that is not a file of the user, or a file that cannot be changed.

    BusplanError: standard input, a shipped profile, or a file that is read-only or has hard links.
    """
    from busplan.profile.sources import shipped_names

    if argument == "-":
        raise BusplanError("--apply: standard input cannot be written back; give the profile as a file")
    if argument in shipped_names():
        raise BusplanError(
            f"--apply: {argument} is a shipped profile and stays as it is; busplan init my-machine --from {argument} "
            "writes one of your own"
        )
    require_changeable(Path(argument))


def apply_changes(
    document: "Document",
    changes: Mapping[str, object],
    *,
    notes: Mapping[str, str] | None = None,
    are_choices: bool = False,
) -> None:
    """Change values in a profile's file; comments, layout and line ends stay.

    Parameters
    ----------
    document
        The text that the changes are made for, from a file of the user (see `require_own_file`).
    changes, notes, are_choices
        As for `profile.edit.edited`.

    Raises
    ------
    BusplanError
        The file was changed meanwhile, a change cannot be made, or the file cannot be written. The file is unchanged.
    """
    from busplan.profile.document import decode, read_bytes
    from busplan.profile.edit import edited_file

    name = document.name
    path = Path(name)
    with changing(path):
        # Absolute, because "-" would mean standard input.
        content = read_bytes(path.absolute(), name=name)
        if decode(content, name=name) != document:
            raise BusplanError(f"--apply: {name} was changed meanwhile, and stays as it is now; run the command again")
        rewrite(path, edited_file(content, changes, name=name, notes=notes, are_choices=are_choices))
