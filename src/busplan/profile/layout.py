"""The layout of a TOML text, and the splices that change one value, one key or one comment of it."""

import json
import math
import re
import tomllib
from collections.abc import Iterator, Sequence
from typing import Final

from busplan.errors import BusplanError
from busplan.printable import printable
from busplan.profile.positions import KeyPath, scan

_BARE_KEY: Final = re.compile(r"[A-Za-z0-9_-]+")
_HEADER_END: Final = re.compile(r"[ \t]*\]")
_BEFORE_COMMENT: Final = re.compile(r"  +(?=#)")


def canonical(value: object) -> str:
    """Write data so that equal means equal in type as well; an empty table is as good as none."""
    return json.dumps(_pruned(value), sort_keys=True, default=repr)


def _pruned(value: object) -> object:
    if not isinstance(value, dict):
        return value
    pruned = {key: _pruned(one) for key, one in value.items()}
    return {key: one for key, one in pruned.items() if one != {}}


def written(value: object) -> str:
    """Write a value as TOML.

    Raises
    ------
    TypeError
        No boolean, number, text or sequence of them.
    ValueError
        A number that is not finite.
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not finite")
        return repr(float(value))
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for one control character.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Sequence):
        return f"[{', '.join(map(written, value))}]"
    raise TypeError(f"{value!r} is no value of a profile")


def _key(path: KeyPath) -> str:
    return ".".join(str(part) if _BARE_KEY.fullmatch(str(part)) else written(str(part)) for part in path)


class Layout:
    """What stands where in one text.

    A *statement* is a key with a value on lines of its own; an *inline table* is such a value, and holds keys that
    have none; a *header* is a line [a.b].
    """

    def __init__(self, name: str, text: str) -> None:
        self.name = name
        self.text = text
        self.places, self.comments = scan(text)
        self.valued = {path for path, place in self.places.items() if place.value_start != place.key_start}
        """Paths with a value text of their own."""
        outside = [path for path in self.places if self.holder(path) is None]
        self.statements = [path for path in outside if path in self.valued]
        self.headers = {path: self.line_start(self.places[path].key_start) for path in outside if self.is_header(path)}
        """Path and line start of each header."""
        self.line_end = "\r\n" if text[: text.find("\n") + 1].endswith("\r\n") else "\n"

    def holder(self, path: KeyPath) -> KeyPath | None:
        """The innermost value that a path lies in."""
        return next((path[:size] for size in range(len(path) - 1, 0, -1) if path[:size] in self.valued), None)

    def is_header(self, path: KeyPath) -> bool:
        """Whether a path is what a line [a.b] names in full."""
        place = self.places[path]
        before = self.text[self.line_start(place.key_start) : place.key_start]
        return (
            path not in self.valued
            and before.lstrip().startswith("[")
            and _HEADER_END.match(self.text, place.key_end) is not None
        )

    def line_start(self, offset: int) -> int:
        """Start of the line of an offset."""
        return self.text.rfind("\n", 0, offset) + 1

    def next_line(self, offset: int) -> int:
        """Start of the line behind that of an offset, or the end of the text."""
        return self.text.find("\n", offset) + 1 or len(self.text)

    def indent(self, line_start: int) -> str:
        """Blanks that a line begins with."""
        return self.text[line_start : len(self.text) - len(self.text[line_start:].lstrip(" \t"))]

    def refusal(self, path: KeyPath, reason: str) -> BusplanError:
        """Make the error for a change that the layout does not allow."""
        return BusplanError(f"{self.name}: {_key(path)} cannot be changed in place: {reason}")

    def spliced(self, start: int, end: int, new: str) -> str:
        """The text with something else between two offsets."""
        return self.text[:start] + new + self.text[end:]

    def changed(self, path: KeyPath, value: object) -> str:
        """The text with one change made."""
        holder = self.holder(path)
        if holder is not None and self.text[self.places[holder].value_start] != "{":
            raise self.refusal(path, f"{_key(holder)} is no table")
        if path in self.places:
            if path not in self.valued or self.text[self.places[path].value_start] == "{":
                raise self.refusal(path, "it is a table; name its keys")
            if value is None:
                return self.without(path, holder)
            return self.replaced(path, value)
        if value is None:
            return self.text
        return self.with_statement(path, value) if holder is None else self.with_member(holder, path, value)

    def replaced(self, path: KeyPath, value: object) -> str:
        """The text with another value; a comment behind it stays in its column."""
        place = self.places[path]
        new = self.value_text(path, value)
        end = place.value_end
        space = _BEFORE_COMMENT.match(self.text, end)
        if space and "\n" not in self.text[place.value_start : end] + new:
            width = end - place.value_start + len(space.group())
            new, end = f"{new} ".ljust(width), space.end()
        return self.spliced(place.value_start, end, new)

    def value_text(self, path: KeyPath, value: object) -> str:
        """A value as it shall stand: what is equal stays as written, an array of the same length keeps its layout."""
        place = self.places[path]
        start, end = place.value_start, place.value_end
        old = self.text[start:end]
        if canonical(tomllib.loads(f"x = {old}")["x"]) == canonical(value):
            return old
        elements = [(*path, index) for index in range(len(self.places)) if (*path, index) in self.places]
        if elements and not isinstance(value, str) and isinstance(value, Sequence) and len(value) == len(elements):
            pieces = []
            for element, item in zip(elements, value, strict=True):
                pieces += [self.text[start : self.places[element].value_start], self.value_text(element, item)]
                start = self.places[element].value_end
            return "".join((*pieces, self.text[start:end]))
        if any(start <= comment < end for comment in self.comments):
            raise self.refusal(path, "there are comments among its old values, and the new ones are not as many")
        return written(value)

    def without(self, path: KeyPath, holder: KeyPath | None) -> str:
        """The text without a key: its comments stay, on lines of their own; beside an inline table they cannot."""
        place = self.places[path]
        if holder is None:
            start, end = self.line_start(place.key_start), self.next_line(place.value_end)
            indent = self.indent(start)
            kept = (self.text[at : self.next_line(at)].rstrip() for at in self.comments if start <= at < end)
            return self.spliced(start, end, "".join(f"{indent}{comment}{self.line_end}" for comment in kept))
        members = self.members(holder)
        index = members.index(path)
        if index > 0:
            start, end = self.places[members[index - 1]].value_end, place.value_end
        else:
            start, end = self.places[holder].value_start + 1, place.value_end
            if len(members) > 1:
                end = self.text.index(",", end) + 1
        if any(start <= comment < end for comment in self.comments):
            raise self.refusal(path, "there are comments beside it in its inline table")
        return self.spliced(start, end, "")

    def members(self, holder: KeyPath) -> list[KeyPath]:
        """Keys with values of one inline table, in the order they stand."""
        inside = (path for path in self.valued if len(path) > len(holder) and self.holder(path) == holder)
        return sorted(inside, key=lambda path: self.places[path].value_start)

    def with_member(self, holder: KeyPath, path: KeyPath, value: object) -> str:
        """The text with one more key in an inline table."""
        new = f"{_key(path[len(holder) :])} = {written(value)}"
        members = self.members(holder)
        if members:
            end = self.places[members[-1]].value_end
            return self.spliced(end, end, f", {new}")
        place = self.places[holder]
        return self.spliced(place.value_start, place.value_end, f"{{ {new} }}")

    def with_statement(self, path: KeyPath, value: object) -> str:
        """The text with one more line: in the table's section, or where its dotted keys stand, or in a new section."""
        table = path[:-1]
        section = table if not table or table in self.headers else None
        if section is None:
            home = next((table[:size] for size in range(len(table), 0, -1) if table[:size] in self.places), ())
            dotted = [one for one in self.statements if home and one[: len(home)] == home]
            dotted = [one for one in dotted if len(self.section(one)) < len(home)]
            if not dotted:
                return self.with_section(path, value)
            anchor, section = dotted[-1], self.section(dotted[-1])
        else:
            own = [one for one in self.statements if self.section(one) == section]
            if not own:
                return self.first_of_section(section, path, value)
            anchor = own[-1]
        start = self.line_start(self.places[anchor].key_start)
        return self.with_line(self.next_line(self.places[anchor].value_end), start, path[len(section) :], value)

    def section(self, statement: KeyPath) -> KeyPath:
        """Path of the header that a statement stands under."""
        at = self.places[statement].key_start
        above = ((start, path) for path, start in self.headers.items() if start < at)
        return max(above, default=(0, ()))[1]

    def first_of_section(self, section: KeyPath, path: KeyPath, value: object) -> str:
        """The text with a line in a section that has none, or above the first header."""
        if section:
            start = self.headers[section]
            return self.with_line(self.next_line(start), start, path[len(section) :], value)
        start = min(self.headers.values(), default=len(self.text))
        return self.with_line(start, start, path, value)

    def with_line(self, at: int, like: int, key: KeyPath, value: object) -> str:
        """The text with a new line at an offset, indented as the line that starts at another."""
        line = f"{self.indent(like)}{_key(key)} = {written(value)}{self.line_end}"
        before = self.line_end if at and self.text[at - 1] != "\n" else ""
        return self.spliced(at, at, before + line)

    def with_section(self, path: KeyPath, value: object) -> str:
        """The text with a new table at its end."""
        text = self.text if not self.text or self.text.endswith("\n") else f"{self.text}{self.line_end}"
        blank = self.line_end if text else ""
        return f"{text}{blank}[{_key(path[:-1])}]{self.line_end}{_key(path[-1:])} = {written(value)}{self.line_end}"

    def noted(self, table: KeyPath, note: str) -> str:
        """The text with a comment above a table, or above the first line that speaks of it."""
        starts = [self.headers[table]] if table in self.headers else list(self.lines_of(table))
        if not starts:
            raise self.refusal(table, "there is no such table to write a comment above")
        top = starts[0]
        # A line without control characters; and a suppression stays next to the line it speaks of.
        shown = printable(note)
        mark = f"# {shown.partition(':')[0]}:"
        line = f"{self.indent(top)}# {shown}{self.line_end}"
        while top:
            above = self.line_start(top - 1)
            comment = self.text[above:top].lstrip(" \t")
            if top - len(comment) not in self.comments:
                break
            if comment.startswith(mark):
                return self.spliced(above, top, line)
            top = above
        return self.spliced(top, top, line)

    def lines_of(self, table: KeyPath) -> Iterator[int]:
        """Starts of the statements that a table is made of or lies in."""
        for statement in self.statements:
            size = min(len(statement), len(table))
            if statement[:size] == table[:size]:
                yield self.line_start(self.places[statement].key_start)
