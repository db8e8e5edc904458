"""`--apply`: write recommended values into the profile's own file, all or none."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from busplan.cli.rewrite import changing, require_changeable, rewrite
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.profile.document import Document


def require_own_file(argument: str) -> None:
    """Refuse a PROFILE argument that is not a file of the user, or a file that cannot be changed.

    Raises
    ------
    BusplanError
        Standard input, a shipped profile, or a file that is read-only or has hard links.
    """
    from busplan.profile.shipped import shipped_names

    if argument == "-":
        raise BusplanError("--apply: standard input cannot be written back; give the profile as a file")
    if argument in shipped_names():
        raise BusplanError(
            f"--apply: {argument} is a shipped profile and stays as it is; busplan init my-machine --from {argument} "
            "writes one of your own"
        )
    require_changeable(Path(argument))


def apply_changes(
    document: "Document", changes: Mapping[str, object], *, notes: Mapping[str, str] | None = None
) -> None:
    """Change values in a profile's file; comments, layout and line ends stay.

    Parameters
    ----------
    document
        The text that the changes are made for, from a file of the user (see `require_own_file`).
    changes, notes
        As for `profile.edit.edited`.

    Raises
    ------
    BusplanError
        The file was changed meanwhile, a change cannot be made, or the file cannot be written. The file is unchanged.
    """
    from busplan.profile.edit import edited_file
    from busplan.profile.toml import decode, read_bytes

    name = document.name
    path = Path(name)
    with changing(path):
        # Absolute, because "-" would mean standard input.
        content = read_bytes(path.absolute(), name=name)
        if decode(content, name=name) != document:
            raise BusplanError(f"--apply: {name} was changed meanwhile, and stays as it is now; run the command again")
        rewrite(path, edited_file(content, changes, name=name, notes=notes))
