"""Values of files into an existing profile: its comments and other keys stay, and nothing is changed unasked."""

import re
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal

from busplan.errors import BusplanError
from busplan.profile.document import Document
from busplan.profile.edit import edited_file
from busplan.profile.keys import flat, named_tables, path_of
from busplan.profile.toml import decode, read_bytes, validate
from busplan.profile.write import short_text
from busplan.questions.import_.record import Reading
from busplan.questions.import_.text import ProfileLine, sections_text
from busplan.sections.profile import Profile

_OURS: Final = re.compile(r"# was (?:published|measured|derived|assumed): .*:\d+$")
"""A comment that an import wrote, once its value has changed."""
_ALIKE: Final = {"nodes": "bus", "axes": "node", "read_bytes": "payload", "write_bytes": "payload"}
_BASE_BITS: Final = 11
"""Section of a group's key in a profile whose nodes are alike; of all others it is node."""


def updated(
    machine: Reading, rows: Sequence[ProfileLine], *, path: Any, name: str, take: Literal["file", "profile"] | None
) -> tuple[Profile, str]:
    """A profile with the values of files, and its text; what was changed goes into the machine's remarks.

    Parameters
    ----------
    machine
        What the files say.
    rows
        The same as lines of a profile.
    path, name
        File of the profile, and its name in messages.
    take
        Whose value counts where both differ; None to refuse that.

    Raises
    ------
    BusplanError
        Another kind of bus, other groups, or values that differ and nothing says which to take.
    """
    content = read_bytes(path, name=name)
    document = decode(content, name=name)
    profile = validate(document)
    if profile.bus.kind != machine.kind:
        raise BusplanError(f"{name} is of {profile.bus.kind} and {machine.file} of {machine.kind}: of two machines")
    data = document.data()
    rows = [row for row in _renamed(rows, data, name) if row.fact.grade != "assumed" and row.key != "kind"]
    known: dict[str, Any] = dict(flat(data))
    added = [row for row in rows if row.section.startswith("message.") and f"{row.section}.identifier" not in known]
    changes: dict[str, ProfileLine] = {}
    differing: list[str] = []
    removed: dict[str, None] = {}
    for row in rows:
        old = known.get(row.dotted)
        per_axis = known.get(f"{row.dotted}_per_axis")
        if per_axis is not None:
            old = (old or 0) + per_axis * _axes(row, known)
        if row in added or old == row.plain:
            continue
        if old is not None:
            differing.append(f"{row.dotted} = {short_text(old)} in {name}, {short_text(row.plain)} at {row.fact.place}")
        if old is None or take == "file":
            changes[row.dotted] = row
            removed |= {f"{row.dotted}_per_axis": None} if per_axis is not None else {}
    if differing and take is None:
        raise BusplanError(f"{name} and the files differ; --take file or --take profile says which counts:", *differing)
    machine.remarks += [f"{'changed' if take == 'file' else 'kept'}: {said}" for said in differing]
    asked = {*known, *(key.removesuffix("_per_axis") for key in removed)}
    machine.remarks += [f"added: {key} = {short_text(row.plain)}" for key, row in changes.items() if key not in asked]
    machine.remarks += [f"added: {row.section}" for row in added if row.key == "identifier"]
    values = {key: row.plain for key, row in changes.items()}
    # With LF alone, and without a mark, offsets are those of the text.
    text = _commented(decode(edited_file(content, {**values, **removed}, name=name), name=name), changes)
    if added:
        text = f"{text.rstrip()}\n{sections_text(added)}"
    profile = validate(Document(name, text))
    text = text.replace("\n", "\r\n") if b"\r\n" in content else text
    return profile, f"{BOM_UTF8.decode()}{text}" if content.startswith(BOM_UTF8) else text


def _axes(row: ProfileLine, known: Mapping[str, Any]) -> int:
    """Axes of the nodes of a row."""
    key = "node.axes" if row.section == "payload" else f"{row.section}.axes"
    return int(known.get(key, 0))


def _renamed(rows: Sequence[ProfileLine], data: Mapping[str, Any], name: str) -> Iterator[ProfileLine]:
    """Rows with the names that the profile has: of groups in their order, of messages by identifier."""
    groups = list(dict.fromkeys(row.section.split(".")[1] for row in rows if row.section.startswith("group.")))
    own = list(named_tables(data.get("group")) or {})
    names: dict[str, str] = {}
    if groups and not own and len(groups) == 1:
        names = {groups[0]: ""}
    elif groups and len(groups) != len(own):
        listed = ", ".join(own) or "none"
        raise BusplanError(
            f"{name} has the groups {listed}, the files give {', '.join(groups)}: which is which is not clear; change "
            "the groups by hand, or import anew"
        )
    elif groups:
        names = dict(zip(groups, own, strict=True))
    tables = named_tables(data.get("message")) or {}
    usual_bits = data.get("bus", {}).get("identifier_bits", _BASE_BITS)
    identifiers = {
        (table.get("identifier"), table.get("identifier_bits", usual_bits)): key for key, table in tables.items()
    }
    bits = {row.section: row.plain for row in rows if row.key == "identifier_bits"}
    messages = {
        row.section: identifiers.get((row.plain, bits.get(row.section, _BASE_BITS)))
        for row in rows
        if row.key == "identifier"
    }
    for row in rows:
        first, _, rest = row.section.partition(".")
        group, _, inner = rest.partition(".")
        if inner:
            continue
        if first == "group":
            section = f"group.{names[group]}" if names[group] else _ALIKE.get(row.key, "node")
            yield row._replace(section=section)
        elif first == "message" and messages.get(row.section):
            yield row._replace(section=f"message.{messages[row.section]}")
        else:
            yield row


def _commented(document: Document, changes: Mapping[str, ProfileLine]) -> str:
    """The text with the grade and place of each new value beside it, unless the user's own comment stands there."""
    text, beside, data = document.text, document.comments_beside, document.data()
    paths = {path_of(data, key): row for key, row in changes.items()}
    for path, row in sorted(paths.items(), key=lambda item: -document.places[item[0]].value_end):
        at, end = beside.get(path), document.places[path].value_end
        line_end = text.find("\n", end)
        line_end = len(text) if line_end < 0 else line_end
        if at is None:
            text = f"{text[:end]} # {row.fact.comment}{text[line_end:]}"
        elif _OURS.match(text[at:line_end]):
            text = f"{text[:at]}# {row.fact.comment}{text[line_end:]}"
    return text
