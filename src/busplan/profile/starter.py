"""A new profile from a shipped one, with its comments and layout."""

import re
from typing import Final

from busplan.errors import BusplanError
from busplan.profile.shipped import locate, shipped_names
from busplan.profile.toml import decode, read_bytes, validate
from busplan.profile.write import value_text

_CIRCLE: Final = re.compile(r"^(\[circle\].*\n)", re.MULTILINE)
_TURN: Final = (
    'path = "iso230-4"          # one whole turn is measured, behind a lead-in; the paper has a "trapezoid"\n'
)
_SUPPRESSION: Final = re.compile(r"^# busplan: ignore\[.*\n|[ \t]+# busplan: ignore\[.*", re.MULTILINE)


def starter_text(source: str, *, name: str) -> str:
    """Text of a shipped profile under a new name.

    Parameters
    ----------
    source
        Name of the shipped profile.
    name
        Name of the new profile.

    Raises
    ------
    BusplanError
        No such shipped profile, or an invalid name.
    """
    if source not in shipped_names():
        raise BusplanError(f"--from {source}: no shipped profile; shipped are {', '.join(shipped_names())}")
    path, _ = locate(source)
    document = decode(read_bytes(path, name=source), name=source)
    place = document.places["name",]
    # Remove suppressions: they were decided for the shipped profile, not for the new machine.
    before, after = document.text[: place.value_start], document.text[place.value_end :]
    text = before + value_text(name) + _CIRCLE.sub(rf"\1{_TURN}", _SUPPRESSION.sub("", after))
    # The path to the schema is valid only in the shipped folder.
    text = text.removeprefix("#:schema ./busplan.schema.json\n")
    try:
        validate(decode(text.encode(), name=source))
    except (BusplanError, UnicodeEncodeError):  # UnicodeEncodeError: a file name that is not UTF-8
        raise BusplanError(f"{name!r}: no name for a profile; expected 1 to 100 printable characters") from None
    return text
