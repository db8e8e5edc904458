r"""Change values of a profile's text in place: what is not changed keeps its bytes, its comments and its layout.

Each change is one small splice at the places that the scanner finds (see `layout`), and the text is scanned again
before the next. Nothing here is trusted: the finished text is parsed, compared with the data that was asked for, and
validated.
"""

import codecs
import tomllib
from collections.abc import Mapping
from typing import Any

from busplan.errors import BusplanError, PlacedError
from busplan.profile.document import Document, TomlTable
from busplan.profile.layout import Layout, canonical
from busplan.profile.positions import KeyPath
from busplan.profile.toml import decode, validate


def edited(document: Document, changes: Mapping[str, object], *, notes: Mapping[str, str] | None = None) -> str:
    r"""Text of a profile with other values.

    Parameters
    ----------
    document
        A valid profile; its line ends may be LF or CRLF.
    changes
        New value by dotted key, None to remove the key if it is there: {"bus.nodes": 3, "node.axes": None}. A value
        is a boolean, an int, a float, a text, or a sequence of them; one that is equal already stays as written.
        A key or table that is not there yet is added: keys behind the last one of their table, tables at the end.
    notes
        A comment of one line by dotted table, for the line above it: {"node.execution": "busplan calibrate: ..."}. It
        takes the place of a comment there that begins alike, up to the colon.

    Returns
    -------
    str
        The new text: a valid profile with exactly the data asked for.

    Raises
    ------
    BusplanError
        A change that cannot be made in place, or that makes no valid profile.
    TypeError, ValueError
        What is given as a value can be none in TOML, or is not finite: a caller's mistake.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> text = edited(load("paper-4ms").document, {"bus.nodes": 16, "limits.min_spare_nodes": 3})
    >>> print(*(line for line in text.splitlines() if line.startswith(("nodes", "min_spare"))), sep="\n")
    nodes = 16                 # distributed nodes, host not counted
    min_spare_nodes = 3
    """
    text, wanted = document.text, document.data()
    # What is set goes before what is removed, so that no table is ever without keys in between.
    for key, value in sorted(changes.items(), key=lambda change: change[1] is None):
        path = tuple(key.split("."))
        text = Layout(document.name, text).changed(path, value)
        _change(wanted, path, value)
    for key, note in (notes or {}).items():
        text = Layout(document.name, text).noted(tuple(key.split(".")), note)
    _check(document.name, text, wanted)
    return text


def edited_file(
    content: bytes, changes: Mapping[str, object], *, name: str, notes: Mapping[str, str] | None = None
) -> bytes:
    """Bytes of a profile's file with other values: `edited`, and a byte order mark and CRLF line ends stay.

    Parameters
    ----------
    content
        The file.
    changes, notes
        As for `edited`.
    name
        What to call the file in messages.

    Raises
    ------
    BusplanError
        As `edited`; or the file is no profile, or would be longer than one may be.
    """
    decode(content, name=name)
    mark = codecs.BOM_UTF8 if content.startswith(codecs.BOM_UTF8) else b""
    text = edited(Document(name, content.removeprefix(mark).decode()), changes, notes=notes)
    try:
        result = mark + text.encode()
    except UnicodeEncodeError:
        raise BusplanError(f"{name}: a new value is no text that UTF-8 can hold") from None
    decode(result, name=name)
    return result


def _check(name: str, text: str, wanted: TomlTable) -> None:
    """Refuse a text that is no profile or has other data than asked for."""
    try:
        validate(Document(name, text))
    except PlacedError as error:
        changed = (f"{name}: with the changes, {one.message}" for one in error.placed)
        raise BusplanError(*changed) from None
    if canonical(tomllib.loads(text)) != canonical(wanted):
        raise BusplanError(f"{name}: the layout of the file cannot take the changes; make them by hand")


def _change(data: TomlTable, path: KeyPath, value: object) -> None:
    """Make a change in the data as `Layout.changed` makes it in the text."""
    table: Any = data
    for part in path[:-1]:
        table = table.setdefault(part, {})
    if value is None:
        table.pop(path[-1], None)
    else:
        table[path[-1]] = value
