"""Check output paths: no input, no other output and no profile may be overwritten."""

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from busplan.errors import BusplanError

_PROFILE: Final = ".toml"


def require_apart(
    outputs: Mapping[str, Path | None], *, inputs: Iterable[Path] = (), of_profiles: bool = False
) -> None:
    """Refuse output paths that would destroy a file; call it before any work.

    Parameters
    ----------
    outputs
        Files to write, by option.
    inputs
        Files to read; "-" is standard input.
    of_profiles
        If True, the outputs are profiles; other outputs must not end in .toml.

    Raises
    ------
    BusplanError
        An output is an input or another output, also through a link, or has the name of a profile without being one.
    """
    asked = {option: path for option, path in outputs.items() if path is not None}
    if not asked:
        return
    read = {_identity(path): "standard input" if str(path) == "-" else path for path in inputs}
    written: dict[object, str] = {}
    for option, path in asked.items():
        if str(path) == "-":
            raise BusplanError(f"{option} -: standard output has the document; give the name of a file")
        place = _identity(path)
        if place in read:
            raise BusplanError(f"{option} {path}: would overwrite {read[place]}, which is read; give another name")
        if place in written:
            raise BusplanError(f"{written[place]} and {option} {path}: the same file; give two names")
        if not of_profiles and any(name.lower().endswith(_PROFILE) for name in (path.name, _real(path).name)):
            raise BusplanError(f"{option} {path}: {_PROFILE} is a profile's name, and no profile is written there")
        written[place] = f"{option} {path}"


def profile_files(*arguments: str) -> Iterator[Path]:
    """Files of PROFILE arguments; invalid ones are left out: reading them will report the error."""
    from busplan.profile.shipped import locate

    for argument in arguments:
        with suppress(BusplanError, ValueError):  # ValueError: a NUL in the path
            yield locate(argument)[0]


def _identity(path: Path) -> object:
    """Identity of a file, equal for all its names."""
    with suppress(OSError, ValueError, AttributeError):  # no such file, and so on; AttributeError: a closed input
        status = os.fstat(sys.stdin.fileno()) if str(path) == "-" else path.stat()
        return status.st_dev, status.st_ino
    # A new file: names that differ in case are one file on some systems.
    real = _real(path)
    return str(real.parent), real.name.casefold()


def _real(path: Path) -> Path:
    with suppress(ValueError):
        return Path(os.path.realpath(path))
    return path
