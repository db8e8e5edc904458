"""Profiles as they stood in a revision of the git checkout they lie in: REV:path."""

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Final

from busplan.errors import BusplanError
from busplan.printable import printable
from busplan.profile.shipped import load, locate
from busplan.profile.toml import MAX_FILE_BYTES, LoadedProfile, decode, too_large, validate

TIMEOUT_S: Final = 10.0
"""What git may take for one answer; it reads a page of text from a disk."""

_FORM: Final = re.compile(r"(?P<revision>(?!-)(?:\{[^}]*\}|[^:{])+):(?P<path>.+)", re.DOTALL)
"""A colon in braces belongs to the revision: main@{10:00}:line.toml. What begins with a dash would be an option."""
_BLOB: Final = re.compile(r"(?P<id>[0-9a-f]{40,64}) blob (?P<size>[0-9]+)\n")
"""How git answers for a file that is there."""
_NEVER: Final = ("\0", "\n", "\r")
"""What git takes for the end of a name."""
_KEPT_VARIABLES: Final = ("GIT_CONFIG", "GIT_EXEC_PATH", "GIT_CEILING_DIRECTORIES", "GIT_DISCOVERY_", "GIT_NO_REPLACE")
"""Of git's variables, those that say how to work. The others, which git sets for its hooks, name a repository."""
_AT_HOME: Final = ("-c", "protocol.allow=never", "-c", "core.fsmonitor=false")
"""Reading a page of text from a disk asks no other machine, and runs no program that a repository names."""
_ALONE: Final = {"LC_ALL": "C", "GIT_TERMINAL_PROMPT": "0", "GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": ""}
"""Likewise. A repository may allow itself a protocol, `protocol.ext.allow`; the variable's empty list comes first."""


def load_revision(argument: str) -> LoadedProfile:
    """Read and check the profile that an argument means: as `load`, and REV:path beside it.

    Parameters
    ----------
    argument
        Shipped name, path, "-" for standard input; or a commit, branch or tag, a colon and a path, from the current
        folder, in the git checkout that the path lies in. What is there under exactly that name comes first.

    Raises
    ------
    BusplanError
        As `load`; or git does not read the file, with what git says.
    """
    form = _FORM.fullmatch(argument)
    if form is None or any(mark in argument for mark in _NEVER) or _is_there(argument):
        return load(argument)
    document = decode(_content(argument, form["revision"], Path(form["path"])), name=argument)
    return LoadedProfile(validate(document), document)


def _is_there(argument: str) -> bool:
    try:
        locate(argument)
    except BusplanError:
        return False
    return True


def _content(argument: str, revision: str, path: Path) -> bytes:
    """Bytes of the file, links followed as a checkout would."""
    # The repository is that of the path's folder, or of the nearest one above it that is still there.
    folder = path.parent
    try:
        while not folder.is_dir():
            folder = folder.parent
    except OSError as error:
        raise BusplanError(f"{argument}: cannot be read: {error.strerror}") from None
    name = f"{revision}:./{path.relative_to(folder).as_posix()}"
    check = ("cat-file", "--batch-check", "--follow-symlinks")
    file = _BLOB.fullmatch(_git(argument, folder, *check, names=name).decode(errors="replace"))
    if file is None:
        # Asked for the object itself, git says why it reads none; a link it reads as a text.
        _git(argument, folder, "cat-file", "blob", name)
        raise BusplanError(f"{argument}: leads to no file of revision {revision}; name the file itself, not a link")
    if int(file["size"]) > MAX_FILE_BYTES:
        raise too_large(argument)
    return _git(argument, folder, "cat-file", "blob", file["id"])


def _git(argument: str, folder: Path, *command: str, names: str = "") -> bytes:
    """Run git in a folder and give what it writes."""
    git = shutil.which("git")
    if git is None:
        raise BusplanError(f"{argument}: no such file; to read REV:path needs git, and there is no git on PATH")
    kept = {
        key: value for key, value in os.environ.items() if not key.startswith("GIT_") or key.startswith(_KEPT_VARIABLES)
    }
    try:
        done = subprocess.run(  # noqa: S603 - no shell; -C takes a folder of any name
            [git, *_AT_HOME, "-C", str(folder), *command],
            check=False,
            capture_output=True,
            env={**kept, **_ALONE},
            input=os.fsencode(names),
            timeout=TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        raise BusplanError(f"{argument}: git gave no answer within {TIMEOUT_S:g} s") from None
    except OSError as error:
        raise BusplanError(f"{argument}: git cannot be run: {error.strerror}") from None
    # What git warns of is another revision than the one that was meant: a name of two things, a log that is too short.
    if done.returncode or done.stderr:
        said = printable(" ".join(done.stderr.decode(errors="backslashreplace").split()))
        raise BusplanError(f"{argument}: no file of that name; of REV:path git says: {said or 'nothing'}")
    return done.stdout
