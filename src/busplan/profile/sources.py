"""Sources of profiles: shipped ones, files, folders, standard input and revisions of git."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

from busplan.english import printable
from busplan.errors import BusplanError
from busplan.files import given_path
from busplan.profile.document import MAX_FILE_BYTES, LoadedProfile, decode, read_bytes, too_large, validate


@cache
def shipped_folder() -> Path:
    """Folder of the shipped profiles: inside the installed package, or `profiles/` of a source checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "_shipped"
    return installed if installed.is_dir() else package.parents[1] / "profiles"


def shipped_names() -> list[str]:
    """Names of the shipped profiles, sorted."""
    return sorted(path.stem for path in shipped_folder().glob("*.toml"))


def locate(argument: str) -> tuple[Path, str]:
    """Path of a PROFILE argument, and its name in messages.

    A shipped name always means the shipped profile, so that the answer does not depend on the working directory.
    Everything else is a path: ./paper-4ms, paper-4ms.toml, or "-" for standard input. An argument that is neither a
    shipped name nor an existing file raises BusplanError.
    """
    if argument == "-":
        return Path("-"), "<stdin>"
    shipped = shipped_folder() / f"{argument}.toml"
    if shipped.stem == argument and os.path.lexists(shipped):
        return shipped, shipped.name
    path = _path(argument)
    if not os.path.lexists(path):
        raise BusplanError(_unknown(argument, path))
    return path, argument


def _unknown(argument: str, path: Path) -> str:
    """Message for an unknown profile, with the one that may be meant: a file without its ending, or a near name."""
    from busplan.english import did_you_mean

    with_ending = path.with_name(f"{path.name}.toml") if path.name else path
    if os.path.lexists(with_ending):
        return f"{argument}: no such file; did you mean {argument}.toml?"
    near = did_you_mean(argument, shipped_names())
    if not near:
        beside: list[str] = []
        with suppress(OSError, ValueError):  # no such folder; a NUL in the path
            beside = sorted(file.stem for file in path.parent.glob("*.toml"))
        files = did_you_mean(path.stem, beside, write=lambda stem: f"{path.with_name(stem)}.toml")
        if files:
            return f"{argument}: no such file; {files}"
    names = ", ".join(shipped_names())
    return f"{argument}: no such file, and no shipped profile of that name; shipped are {names}{near and f'; {near}'}"


def _path(argument: str) -> Path:
    """Path of an argument; the file ./- becomes absolute, because "-" means standard input."""
    path = given_path(argument)
    return path.absolute() if str(path) == "-" else path


class MeasurementsFile(NamedTuple):
    """A file of measurements."""

    path: Path
    name: str
    """Name in messages."""
    shipped: bool
    """Whether it is the shipped example, with published figures."""


def locate_measurements(argument: str) -> MeasurementsFile:
    """Path of a MEASUREMENTS argument.

    An existing file comes first, so that the user's measurements are never mistaken for the shipped example. Without a
    file or an example of that name it raises BusplanError.
    """
    if argument == "-":
        return MeasurementsFile(Path("-"), "<stdin>", shipped=False)
    path = _path(argument)
    if os.path.lexists(path):
        return MeasurementsFile(path, argument, shipped=False)
    names = sorted(path.name for path in shipped_folder().glob("*.csv"))
    if argument in names:
        return MeasurementsFile(shipped_folder() / argument, argument, shipped=True)
    raise BusplanError(f"{argument}: no such file, and no shipped example of that name; shipped is {', '.join(names)}")


def load(argument: str) -> LoadedProfile:
    """Read and check the profile of a PROFILE argument: a shipped name, a path, or "-" for standard input.

    A file that does not exist or cannot be read raises BusplanError, as does one that is not a valid profile; every
    problem has its place.
    """
    path, name = locate(argument)
    document = decode(read_bytes(path, name=name), name=name)
    return LoadedProfile(validate(document), document)


SETTINGS_FILE: Final = "busplan.toml"
"""Settings of `busplan check`; a file of this name is never a profile."""
TIMEOUT_S: Final = 10.0
"""Longest wait for git, which only reads a short file [s]."""

_FORM: Final = re.compile(r"(?P<revision>(?!-)(?:\{[^}]*\}|[^:{])+):(?P<path>.+)", re.DOTALL)
"""Form REV:path. A colon in braces belongs to the revision, as in main@{10:00}:line.toml; a leading dash would be an
option.
"""
_BLOB: Final = re.compile(r"(?P<id>[0-9a-f]{40,64}) blob (?P<size>[0-9]+)\n")
"""Git's answer for an existing file."""
_NEVER: Final = ("\0", "\n", "\r")
"""Characters that end a name for git."""
_KEPT_VARIABLES: Final = ("GIT_CONFIG", "GIT_EXEC_PATH", "GIT_CEILING_DIRECTORIES", "GIT_DISCOVERY_", "GIT_NO_REPLACE")
"""Prefixes of git's variables that are kept. Others, which git sets for hooks, would select another repository."""
_AT_HOME: Final = ("-c", "protocol.allow=never", "-c", "core.fsmonitor=false")
"""Options against network access and against programs configured in the repository."""
_ALONE: Final = {"LC_ALL": "C", "GIT_TERMINAL_PROMPT": "0", "GIT_NO_LAZY_FETCH": "1", "GIT_ALLOW_PROTOCOL": ""}
"""Variables against network access, even if the repository's configuration allows a protocol."""


def load_revision(argument: str) -> LoadedProfile:
    """Read and check a profile as `load` does, or from REV:path.

    REV is a commit, branch or tag, and the path is relative to the current folder, in its own git checkout. An existing
    file of exactly that name comes first. If git cannot read the file, BusplanError has git's message.
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
    """Content of the file in the revision; links are followed."""
    # The folder of the path may no longer exist, so the nearest existing one above it is used.
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
        # Reading the object itself gives git's error message. For a link it succeeds.
        _git(argument, folder, "cat-file", "blob", name)
        raise BusplanError(f"{argument}: leads to no file of revision {revision}; name the file itself, not a link")
    if int(file["size"]) > MAX_FILE_BYTES:
        raise too_large(argument)
    return _git(argument, folder, "cat-file", "blob", file["id"])


def _git(argument: str, folder: Path, *command: str, names: str = "") -> bytes:
    """Output of git, run in a folder."""
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
    # After a warning git may have chosen another revision: an ambiguous name, or a reflog that is too short.
    if done.returncode or done.stderr:
        message = printable(" ".join(done.stderr.decode(errors="backslashreplace").split()))
        raise BusplanError(f"{argument}: no file of that name; of REV:path git says: {message or 'nothing'}")
    return done.stdout


_CLAIM = re.compile(rb"^(?:\xef\xbb\xbf)?[ \t]*[\"']?schema_version[\"']?[ \t]*=", re.MULTILINE)
_SKIPPED_FOLDERS = {"node_modules", "__pycache__"}


class ProfileSource(NamedTuple):
    """A profile to read with its name in messages, or a path without one."""

    path: Path
    name: str
    failure: str | None = None
    """Reason why there is no profile to read."""
    is_shipped: bool = False
    """Whether it is a shipped profile, named as such."""


class Collection(NamedTuple):
    """Profiles in a list of paths."""

    sources: tuple[ProfileSource, ...]
    skipped: tuple[str, ...]
    """Files without a `schema_version`: TOML files below a folder, and with `skip_others` also named ones."""


def collect(arguments: Sequence[str], *, stdin_name: str = "<stdin>", skip_others: bool = False) -> Collection:
    """Find the profiles in a list of paths, each once, in their order; those of a folder are sorted by name.

    Arguments are files, folders (every *.toml below that has a `schema_version`, except in hidden folders), shipped
    names, and "-" for standard input. With `skip_others` a named file without `schema_version` is skipped, not refused.
    A path without a profile is a source with a failure. Names are relative to the working folder for files below it.
    """
    sources: dict[str, ProfileSource] = {}
    names: set[str] = set()
    skipped: list[str] = []
    for argument in arguments:
        for source in _meant(argument, stdin_name=stdin_name, skipped=skipped, skip_others=skip_others):
            key = _place(source.path).as_posix() if source.failure is None else source.failure
            if key in sources:
                continue
            # A shipped profile and a file can have the same name; the second one gets its full path.
            taken = source.failure is None and source.name in names
            sources[key] = source._replace(name=source.path.absolute().as_posix()) if taken else source
            names.add(source.name)
    return Collection(tuple(sources.values()), tuple(dict.fromkeys(skipped)))


def _meant(argument: str, *, stdin_name: str, skipped: list[str], skip_others: bool) -> Iterator[ProfileSource]:
    """Sources of an argument: a file, or every profile below a folder."""
    try:
        path, name = locate(argument)
        if argument == "-":
            yield ProfileSource(path, stdin_name)
        elif name != argument:  # It is a shipped name, whatever the working folder contains.
            yield ProfileSource(path, name, is_shipped=True)
        elif path.is_dir():
            yield from _below(path, skipped)
        elif path.name == SETTINGS_FILE and not skip_others:
            yield ProfileSource(path, name, f"{name}: has settings of `busplan check`, but no profile")
        elif skip_others and path.is_file() and (path.name == SETTINGS_FILE or not claims(path)):
            skipped.append(_name(path))
        else:
            yield ProfileSource(path, _name(path))
    except (BusplanError, ValueError) as error:  # ValueError: a NUL in the path
        yield ProfileSource(Path(argument), argument, str(error))


def _place(path: Path) -> Path:
    """Normal form of a path: relative to the working folder for files below it, otherwise absolute."""
    if not path.is_absolute() and ".." not in path.parts:
        return path
    real = Path(os.path.realpath(path)) if path.name == ".." else Path(os.path.realpath(path.parent), path.name)
    here = Path.cwd()
    return real.relative_to(here) if real.is_relative_to(here) else real


def _name(path: Path) -> str:
    """Name of a file: relative to the working folder if it is below it, otherwise as given."""
    place = _place(path)
    return (path if place.is_absolute() else place).as_posix()


def _below(folder: Path, skipped: list[str]) -> Iterator[ProfileSource]:
    """Sources below a folder: every profile, sorted by name, and every folder that cannot be read."""
    unreadable: list[OSError] = []
    has_profile = False
    for root, folders, files in os.walk(folder, onerror=unreadable.append):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in _SKIPPED_FOLDERS)
        for name in sorted(files):
            if not name.endswith(".toml") or name == SETTINGS_FILE:
                continue
            path = Path(root) / name
            if claims(path):
                has_profile = True
                yield ProfileSource(path, _name(path))
            else:
                skipped.append(_name(path))
    for error in unreadable:
        name = _name(Path(error.filename))
        yield ProfileSource(Path(error.filename), name, f"{name}: cannot be read: {error.strerror}")
    if not has_profile and not unreadable:
        name = _name(folder)
        yield ProfileSource(folder, name, f"{name}: no profile below this folder (a *.toml with a schema_version)")


def claims(path: Path) -> bool:
    """Whether a TOML file has a `schema_version`; True for an unreadable one, so that reading it reports the error."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return _CLAIM.search(file.read(MAX_FILE_BYTES)) is not None
    except OSError:
        return True
