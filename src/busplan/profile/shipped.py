"""The profiles that come with busplan."""

import os
from functools import cache
from pathlib import Path
from typing import NamedTuple

from busplan.errors import BusplanError
from busplan.profile.toml import LoadedProfile, decode, read_bytes, validate


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
    """Find the file that a command's PROFILE argument means.

    A shipped name means the shipped profile, whatever lies in the working directory, so that the answer does not
    depend on where it is asked. A path is everything else: ./paper-4ms, paper-4ms.toml, or "-" for standard input.

    Returns
    -------
    tuple
        Path, and what to call it in messages.

    Raises
    ------
    BusplanError
        Neither a shipped name nor an existing file.
    """
    if argument == "-":
        return Path("-"), "<stdin>"
    shipped = shipped_folder() / f"{argument}.toml"
    if shipped.stem == argument and os.path.lexists(shipped):
        return shipped, shipped.name
    path = _path(argument)
    if not argument or not os.path.lexists(path):
        shown = argument or repr(argument)
        names = ", ".join(shipped_names())
        raise BusplanError(f"{shown}: no such file, and no shipped profile of that name; shipped are {names}")
    return path, argument


def _path(argument: str) -> Path:
    """Path of an argument; ./- is a file, which must not become the "-" of standard input."""
    path = Path(argument)
    return path.absolute() if str(path) == "-" else path


class MeasurementsFile(NamedTuple):
    """A file of measurements."""

    path: Path
    name: str
    """What to call it in messages."""
    shipped: bool
    """Whether it is an example of ours, with published figures."""


def locate_measurements(argument: str) -> MeasurementsFile:
    """Find the file that a command's MEASUREMENTS argument means.

    A file that is there comes first: measurements of one's own must never be taken for the shipped example.

    Raises
    ------
    BusplanError
        Neither an existing file nor the name of a shipped example.
    """
    if argument == "-":
        return MeasurementsFile(Path("-"), "<stdin>", shipped=False)
    if argument and os.path.lexists(argument):
        return MeasurementsFile(_path(argument), argument, shipped=False)
    names = sorted(path.name for path in shipped_folder().glob("*.csv"))
    if argument in names:
        return MeasurementsFile(shipped_folder() / argument, argument, shipped=True)
    shown = argument or repr(argument)
    raise BusplanError(f"{shown}: no such file, and no shipped example of that name; shipped is {', '.join(names)}")


def load(argument: str) -> LoadedProfile:
    """Read and check the profile that a command's PROFILE argument means.

    Parameters
    ----------
    argument
        Shipped name, path, or "-" for standard input.

    Raises
    ------
    BusplanError
        Not there, not readable, no TOML or no profile; every problem with its place.
    """
    path, name = locate(argument)
    document = decode(read_bytes(path, name=name), name=name)
    return LoadedProfile(validate(document), document)
