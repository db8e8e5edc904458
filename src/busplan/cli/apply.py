"""`--apply`: recommended values go into the profile's own file, in place, as a whole or not at all."""

from collections.abc import Mapping
from pathlib import Path

from busplan.cli.output import write_file
from busplan.errors import BusplanError


def require_own_file(argument: str) -> None:
    """Refuse a PROFILE argument that names no file of the user's; to be called before the work.

    Raises
    ------
    BusplanError
        Standard input, or a shipped profile.
    """
    from busplan.profile.shipped import shipped_names

    if argument == "-":
        raise BusplanError("--apply: standard input cannot be written back; give the profile as a file")
    if argument in shipped_names():
        raise BusplanError(
            f"--apply: {argument} is a shipped profile and stays as it is; busplan init my-machine --from {argument} "
            "writes one of your own"
        )


def apply_changes(argument: str, changes: Mapping[str, object], *, notes: Mapping[str, str] | None = None) -> None:
    """Change values of the profile's file; comments, layout and line ends stay.

    Parameters
    ----------
    argument
        The PROFILE argument: a file (see `require_own_file`).
    changes, notes
        As for `profile.edit.edited`.

    Raises
    ------
    BusplanError
        A change that cannot be made, or a file that cannot be written; it is as it was.
    """
    from busplan.profile.edit import edited_file
    from busplan.profile.toml import read_bytes

    require_own_file(argument)
    path = Path(argument)
    content = edited_file(read_bytes(path, name=argument), changes, name=argument, notes=notes)
    write_file(path, content, overwrite=True)
