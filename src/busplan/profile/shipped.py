"""Find and load profiles, shipped ones and files."""

import os
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

from busplan.errors import BusplanError
from busplan.profile.toml import LoadedProfile, decode, read_bytes, validate

SHIPPED_SCHEMA: Final = "#:schema ./busplan.schema.json\n"
"""First line of a shipped profile: the path is valid only in its folder."""


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
    """Find the file of a PROFILE argument.

    A shipped name always means the shipped profile, so that the answer does not depend on the working directory.
    Everything else is a path: ./paper-4ms, paper-4ms.toml, or "-" for standard input.

    Returns
    -------
    tuple
        Path, and name in messages.

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
        raise BusplanError(_unknown(argument, path))
    return path, argument


def _unknown(argument: str, path: Path) -> str:
    """Say that there is no such profile, and which one may be meant: a file without its ending, or a near name."""
    from busplan.nearest import did_you_mean

    shown = argument or repr(argument)
    with_ending = path.with_name(f"{path.name}.toml") if path.name else path
    if argument and os.path.lexists(with_ending):
        return f"{shown}: no such file; did you mean {argument}.toml?"
    near = did_you_mean(argument, shipped_names())
    names = ", ".join(shipped_names())
    return f"{shown}: no such file, and no shipped profile of that name; shipped are {names}{near and f'; {near}'}"


def _path(argument: str) -> Path:
    """Path of an argument; the file ./- becomes absolute, because "-" means standard input."""
    path = Path(argument)
    return path.absolute() if str(path) == "-" else path


class MeasurementsFile(NamedTuple):
    """A file of measurements."""

    path: Path
    name: str
    """Name in messages."""
    shipped: bool
    """Whether it is the shipped example, with published figures."""


def locate_measurements(argument: str) -> MeasurementsFile:
    """Find the file of a MEASUREMENTS argument.

    An existing file comes first, so that the user's measurements are never mistaken for the shipped example.

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
    """Read and check the profile of a PROFILE argument.

    Parameters
    ----------
    argument
        Shipped name, path, or "-" for standard input.

    Raises
    ------
    BusplanError
        The file does not exist, cannot be read or is not a valid profile; every problem has its place.
    """
    path, name = locate(argument)
    document = decode(read_bytes(path, name=name), name=name)
    return LoadedProfile(validate(document), document)
