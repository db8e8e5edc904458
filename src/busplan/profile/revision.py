"""Profiles as they stood in a revision of the git checkout they lie in: REV:path."""

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Final, NamedTuple

from busplan.errors import BusplanError
from busplan.profile.shipped import load, locate
from busplan.profile.toml import MAX_FILE_BYTES, LoadedProfile, decode, too_large, validate

TIMEOUT_S: Final = 10.0
"""What git may take for one answer; it reads a page of text from a disk."""

_FORM: Final = re.compile(r"(?P<revision>(?:\{[^}]*\}|[^:{])+):(?P<path>.+)", re.DOTALL)
"""A colon in braces belongs to the revision: main@{10:00}:line.toml."""
_OBJECT: Final = re.compile(r"(?P<id>[0-9a-f]{40,64}) (?P<kind>\w+) (?P<size>[0-9]+)")
"""How git answers for what is there."""
_DAMAGED: Final = "git cannot read it here: an object is damaged or was not fetched; git fsck tells"
_NOT_FETCHED: Final = re.compile(rb"promisor remote|lazy fetching disabled|transport '[^']*' not allowed")
"""How git speaks of what a partial clone has left at its origin."""
_NEVER: Final = ("\0", "\n", "\r")
"""What git takes for the end of a name."""
_KEPT_VARIABLES: Final = ("GIT_CONFIG", "GIT_EXEC_PATH", "GIT_CEILING_DIRECTORIES", "GIT_DISCOVERY_", "GIT_NO_REPLACE")
"""Of git's variables, those that say how to work. The others, which git sets for its hooks, name a repository."""
_AT_HOME: Final = ("-c", "protocol.allow=never", "-c", "core.fsmonitor=false")
"""Reading a page of text from a disk asks no other machine, and runs no program that a repository names."""
_ALONE: Final = {"LC_ALL": "C", "GIT_TERMINAL_PROMPT": "0", "GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": ""}
"""Likewise. A repository may allow itself a protocol, `protocol.ext.allow`; the variable's empty list comes first."""


class _Place(NamedTuple):
    """A file of a revision, and the folder whose repository is meant."""

    argument: str
    revision: str
    folder: Path
    rest: str
    """Path from the folder."""


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
        As `load`; or no git, no repository, no such revision, no such file in it, or no answer from git.
    """
    form = _FORM.fullmatch(argument)
    if form is None or any(mark in argument for mark in _NEVER) or _is_there(argument):
        return load(argument)
    document = decode(_content(_place(argument, form["revision"], form["path"])), name=argument)
    return LoadedProfile(validate(document), document)


def _is_there(argument: str) -> bool:
    try:
        locate(argument)
    except BusplanError:
        return False
    return True


def _place(argument: str, revision: str, path: str) -> _Place:
    """Find the repository by the path's folder, or by the nearest one above it that is still there."""
    folder = Path(path).parent
    try:
        while not folder.is_dir():
            folder = folder.parent
    except OSError as error:
        raise BusplanError(f"{argument}: cannot be read: {error.strerror}") from None
    return _Place(argument, revision, folder, Path(path).relative_to(folder).as_posix())


def _content(place: _Place) -> bytes:
    """Bytes of the file, links followed as a checkout would."""
    # The names go through standard input: none of them can be an option.
    asked = f"{place.revision}^{{tree}}\n{place.revision}:./{place.rest}\n"
    answer = _git(place, "cat-file", "--batch-check", "--follow-symlinks", names=os.fsencode(asked)).decode(
        errors="replace"
    )
    tree, _, rest = answer.partition("\n")
    if _OBJECT.fullmatch(tree) is None:
        state = "ambiguous" if tree.endswith(" ambiguous") else "unknown"
        if state == "unknown" and _is_commit(place):
            raise BusplanError(f"{place.argument}: is in revision {place.revision}, and {_DAMAGED}")
        raise BusplanError(
            f"{place.argument}: revision {place.revision} is {state} in the git repository of "
            f"{place.folder.resolve()}; expected a commit, branch or tag, as HEAD~1 or main"
        )
    said = rest.partition("\n")[0]
    file = _OBJECT.fullmatch(said)
    if file is None and said.endswith(" missing"):
        _require_readable(place)
    if file is None or file["kind"] != "blob":
        raise BusplanError(f"{place.argument}: {_no_file(place, said, is_object=file is not None)}")
    if int(file["size"]) > MAX_FILE_BYTES:
        raise too_large(place.argument)
    return _git(place, "cat-file", "blob", file["id"])


def _require_readable(place: _Place) -> None:
    """Tell a file that the revision does not have from one that it has and git cannot read."""
    listed = _git(place, "ls-tree", "-z", "--end-of-options", f"{place.revision}^{{tree}}", "--", f"./{place.rest}")
    if listed:
        raise BusplanError(f"{place.argument}: is in revision {place.revision}, and {_DAMAGED}")


def _is_commit(place: _Place) -> bool:
    """Tell a revision whose files git cannot read from none at all."""
    asked = os.fsencode(f"{place.revision}^{{commit}}\n")
    answer = _git(place, "cat-file", "--batch-check", names=asked).decode(errors="replace")
    return _OBJECT.fullmatch(answer.strip()) is not None


def _no_file(place: _Place, said: str, *, is_object: bool) -> str:
    """Say what stands in the revision instead of a file."""
    if is_object:
        return f"is a directory in revision {place.revision}; give a file"
    if said.startswith(("symlink ", "dangling ", "loop ")):
        return f"is a link in revision {place.revision} that leads to no file of it; name the file itself"
    return (
        f"no such file in revision {place.revision}; the path starts at the current folder, not at the top of the "
        "repository"
    )


def _git(place: _Place, *arguments: str, names: bytes = b"") -> bytes:
    """Run git in the place's folder and give what it writes."""
    git = shutil.which("git")
    if git is None:
        raise BusplanError(f"{place.argument}: no such file; to read REV:path needs git, and there is no git on PATH")
    kept = {
        key: value for key, value in os.environ.items() if not key.startswith("GIT_") or key.startswith(_KEPT_VARIABLES)
    }
    try:
        done = subprocess.run(  # noqa: S603 - no shell; -C takes a folder of any name
            [git, *_AT_HOME, "-C", str(place.folder), *arguments],
            check=False,
            capture_output=True,
            env={**kept, **_ALONE},
            input=names,
            timeout=TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        raise BusplanError(f"{place.argument}: git gave no answer within {TIMEOUT_S:g} s") from None
    except OSError as error:
        raise BusplanError(f"{place.argument}: git cannot be run: {error.strerror}") from None
    if _NOT_FETCHED.search(done.stderr):
        raise BusplanError(
            f"{place.argument}: an object of it was not fetched into this partial clone, and busplan asks no other "
            "machine; fetch it with git first"
        )
    if done.returncode:
        raise BusplanError(f"{place.argument}: no such file, and {_refusal(place, done.stderr)}")
    # What git warns of is another revision than the one that was meant: a name of two things, a log that is too short.
    doubt = re.search(rb"^warning: (.*)$", done.stderr, re.MULTILINE)
    if doubt:
        warning = doubt[1].decode(errors="backslashreplace")
        raise BusplanError(f"{place.argument}: git is not sure what is meant: {warning}; name the commit by its id")
    return done.stdout


def _refusal(place: _Place, stderr: bytes) -> str:
    """Say why git reads nothing here."""
    said = stderr.decode(errors="backslashreplace").splitlines()
    reason = next((line for line in said if line.startswith("fatal: ")), "fatal: no reason given").removeprefix(
        "fatal: "
    )
    if reason.startswith("not a git repository"):
        return f"no git repository to read REV:path from at {place.folder.resolve()}"
    return f"git cannot read it as REV:path: {reason}"
