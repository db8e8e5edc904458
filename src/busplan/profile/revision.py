"""Read a profile from a git revision: REV:path."""

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
"""Longest wait for git, which only reads a short file."""

_FORM: Final = re.compile(r"(?P<revision>(?!-)(?:\{[^}]*\}|[^:{])+):(?P<path>.+)", re.DOTALL)
"""A colon in braces belongs to the revision: main@{10:00}:line.toml. A dash at the start would be an option."""
_BLOB: Final = re.compile(r"(?P<id>[0-9a-f]{40,64}) blob (?P<size>[0-9]+)\n")
"""Git's answer for an existing file."""
_NEVER: Final = ("\0", "\n", "\r")
"""Characters that end a name for git."""
_KEPT_VARIABLES: Final = ("GIT_CONFIG", "GIT_EXEC_PATH", "GIT_CEILING_DIRECTORIES", "GIT_DISCOVERY_", "GIT_NO_REPLACE")
"""Prefixes of git's variables that are kept; others, which git sets for hooks, would select another repository."""
_AT_HOME: Final = ("-c", "protocol.allow=never", "-c", "core.fsmonitor=false")
"""No network access, and no program configured in the repository."""
_ALONE: Final = {"LC_ALL": "C", "GIT_TERMINAL_PROMPT": "0", "GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": ""}
"""No network access, even if the configuration of the repository allows a protocol."""


def load_revision(argument: str) -> LoadedProfile:
    """Read and check a profile as `load` does, or from REV:path.

    Parameters
    ----------
    argument
        Shipped name, path, "-" for standard input; or a commit, branch or tag, a colon and a path, relative to the
        current folder, in the git checkout of the path. An existing file of exactly that name comes first.

    Raises
    ------
    BusplanError
        As `load`; or git cannot read the file, with git's message.
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
    """Content of the file in the revision, links followed."""
    # The folder of the path may no longer exist: use the nearest existing one above it.
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
        # Reading the object itself gives git's error message; for a link it succeeds.
        _git(argument, folder, "cat-file", "blob", name)
        raise BusplanError(f"{argument}: leads to no file of revision {revision}; name the file itself, not a link")
    if int(file["size"]) > MAX_FILE_BYTES:
        raise too_large(argument)
    return _git(argument, folder, "cat-file", "blob", file["id"])


def _git(argument: str, folder: Path, *command: str, names: str = "") -> bytes:
    """Run git in a folder and return its output."""
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
    # A warning means that git may have chosen another revision: an ambiguous name, or a reflog that is too short.
    if done.returncode or done.stderr:
        said = printable(" ".join(done.stderr.decode(errors="backslashreplace").split()))
        raise BusplanError(f"{argument}: no file of that name; of REV:path git says: {said or 'nothing'}")
    return done.stdout
