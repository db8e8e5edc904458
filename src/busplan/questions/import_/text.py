"""The text of a profile from facts: a line for each, with grade and place in its comment."""

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import PurePath
from typing import Any, Final, NamedTuple

from busplan.errors import BusplanError
from busplan.printable import printable
from busplan.profile.toml import MAX_FILE_BYTES
from busplan.profile.write import short_text, value_text, whole
from busplan.questions.import_.record import Fact

_COMMENTS_AT: Final = 27
_LONGEST_NAME: Final = 32
_LONGEST_PROFILE_NAME: Final = 100
_UNITS: Final = {"us": 1.0, "ms": 1000.0}


class ProfileLine(NamedTuple):
    """A line of a profile."""

    section: str
    """bus, cycle, group.NAME, group.NAME.execution or message.NAME."""
    key: str
    fact: Fact

    @property
    def dotted(self) -> str:
        """Its dotted key."""
        return f"{self.section}.{self.key}"

    @property
    def plain(self) -> Any:
        """Its value as TOML has it."""
        return whole(self.fact.value)


def profile_text(rows: Sequence[ProfileLine], *, name: str, files: Sequence[tuple[str, str]]) -> str:
    """The text of a profile.

    Parameters
    ----------
    rows
        Its lines, those of a section side by side.
    name
        Name of the profile.
    files
        File and format of each source, for the description.

    Raises
    ------
    BusplanError
        It is larger than a profile may be.
    """
    sources = ", ".join(f"{PurePath(file).name} ({title})" for file, title in files)
    head = [
        "schema_version = 1",
        f"name = {value_text(printable(name)[:_LONGEST_PROFILE_NAME].strip() or 'machine')}",
        f"description = {value_text(printable(f'Imported from {sources}')[:2000])}",
    ]
    text = "\n".join([*head, sections_text(rows)])
    text = text.encode("utf-8", "backslashreplace").decode()
    if len(text.encode()) > MAX_FILE_BYTES:
        count = sum(row.key == "nodes" for row in rows)
        raise BusplanError(
            f"the profile would be larger than {MAX_FILE_BYTES:,} bytes: {count} groups of devices that differ from "
            "their neighbours; import a part of the machine"
        )
    return text


def sections_text(rows: Sequence[ProfileLine]) -> str:
    """The text of sections, each after an empty line."""
    return "".join(f"{line}\n" for line in _sections(rows))


def _sections(rows: Sequence[ProfileLine]) -> Iterator[str]:
    for section, section_rows in groupby(rows, lambda row: row.section):
        yield ""
        first, _, rest = section.partition(".")
        name, _, inner = rest.partition(".")
        if inner:
            yield f"[{first}.{inner}]"
        elif name:
            yield f"[[{first}]]"
            yield f"name = {value_text(name)}"
        else:
            yield f"[{first}]"
        for row in section_rows:
            line, comment = f"{row.key} = {short_text(row.fact.value)}", row.fact.comment
            yield f"{line:{_COMMENTS_AT - 1}} # {comment}" if comment else line


def group_name(text: str, taken: set[str]) -> str:
    """A name that a profile takes, not used before: letters, digits, - and _.

    Examples
    --------
    >>> taken = set()
    >>> group_name("L7EC-1000S/C(COE)", taken), group_name("L7EC-1000S/C(COE)", taken), group_name("2 drives", taken)
    ('L7EC-1000S-C-COE', 'L7EC-1000S-C-COE-2', 'n2-drives')
    """
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-")[:_LONGEST_NAME] or "node"
    name = name if name[0].isalpha() else f"n{name}"
    free = name
    number = 1
    while free in taken:
        number += 1
        free = f"{name}-{number}"
    taken.add(free)
    return free


def time_us(text: str) -> float:
    """A time with its unit, as a kind of bus has its usual period [us].

    Examples
    --------
    >>> time_us("4ms"), time_us("250us")
    (4000.0, 250.0)
    """
    unit = text[-2:]
    return float(text[:-2]) * _UNITS[unit]


def assumed(rows: Iterable[ProfileLine]) -> list[ProfileLine]:
    """Rows that nobody has measured or configured."""
    return [row for row in rows if row.fact.grade == "assumed" and row.key not in ("grade", "kind", "master_grade")]
