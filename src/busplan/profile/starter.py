"""A new profile from a shipped one, comments and layout kept."""

import re
from typing import Final

from busplan.errors import BusplanError
from busplan.profile.shipped import locate, shipped_names
from busplan.profile.toml import decode, read_bytes, validate
from busplan.profile.write import value_text

_SUPPRESSION: Final = re.compile(r"^# busplan: ignore\[.*\n|[ \t]+# busplan: ignore\[.*", re.MULTILINE)


def starter_text(source: str, *, name: str) -> str:
    """Text of a shipped profile under a new name.

    Parameters
    ----------
    source
        Name of the shipped profile.
    name
        Name of the new one.

    Raises
    ------
    BusplanError
        No such shipped profile, or a name that a profile cannot have.
    """
    if source not in shipped_names():
        raise BusplanError(f"--from {source}: no shipped profile; shipped are {', '.join(shipped_names())}")
    path, _ = locate(source)
    document = decode(read_bytes(path, name=source), name=source)
    place = document.places["name",]
    # Nobody has looked at the new machine yet: what the gate may not say of the shipped one, it says of this one.
    before, after = document.text[: place.value_start], document.text[place.value_end :]
    text = before + value_text(name) + _SUPPRESSION.sub("", after)
    # The line that names the schema is right in the shipped folder alone.
    text = text.removeprefix("#:schema ./busplan.schema.json\n")
    try:
        validate(decode(text.encode(), name=source))
    except (BusplanError, UnicodeEncodeError):  # the latter: a file name that is no UTF-8
        raise BusplanError(f"{name!r}: no name for a profile; expected 1 to 100 printable characters") from None
    return text
