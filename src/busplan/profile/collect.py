"""Which profiles a list of paths means: files, folders, shipped names, standard input."""

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from busplan.errors import BusplanError
from busplan.profile.shipped import locate
from busplan.profile.toml import MAX_FILE_BYTES

_CLAIM = re.compile(rb"^[ \t]*[\"']?schema_version[\"']?[ \t]*=", re.MULTILINE)
_SKIPPED_FOLDERS = {"node_modules", "__pycache__"}


class Source(NamedTuple):
    """One profile to read, and what to call it."""

    path: Path
    name: str


class Collection(NamedTuple):
    """What a list of paths means."""

    sources: tuple[Source, ...]
    skipped: tuple[str, ...]
    """TOML files below a folder that claim no `schema_version`."""
    failures: tuple[str, ...]
    """One message for each path that means nothing."""


def collect(arguments: Sequence[str], *, stdin_name: str = "<stdin>") -> Collection:
    """Find the profiles that a list of paths means, each once.

    Parameters
    ----------
    arguments
        Files, folders (every *.toml below that claims a `schema_version`; hidden folders are left out), shipped names,
        and "-" for standard input.
    stdin_name
        What to call standard input.

    Returns
    -------
    Collection
        Sources in the order of the arguments, and by name within a folder.
    """
    sources: dict[str, Source] = {}
    skipped: list[str] = []
    failures: list[str] = []
    for argument in arguments:
        try:
            if argument == "-":
                sources.setdefault(stdin_name, Source(Path("-"), stdin_name))
            elif Path(argument).is_dir():
                below = list(_below(argument, skipped))
                if not below:
                    failures.append(f"{argument}: no profile below this folder (a *.toml with a schema_version)")
                sources.update({source.name: source for source in below if source.name not in sources})
            else:
                source = Source(*locate(argument))
                sources.setdefault(source.name, source)
        except (BusplanError, ValueError) as error:  # ValueError: a NUL in the path
            failures.append(str(error))
    return Collection(tuple(sources.values()), tuple(skipped), tuple(failures))


def _below(folder: str, skipped: list[str]) -> Iterator[Source]:
    """Every profile below a folder, in the order of their names."""
    for root, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in _SKIPPED_FOLDERS)
        for name in sorted(files):
            if not name.endswith(".toml"):
                continue
            path = Path(root) / name
            shown = path.as_posix()
            if _claims(path):
                yield Source(path, shown)
            else:
                skipped.append(shown)


def _claims(path: Path) -> bool:
    """Whether a TOML file says that it is a profile; one that cannot be read may be one."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return _CLAIM.search(file.read(MAX_FILE_BYTES)) is not None
    except OSError:
        return True
