"""What a page is made of in any form: figures that know where they come from, tables, parts and chapters."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

from busplan.answers.documents import Document
from busplan.printable import json_text

Tone = Literal["good", "bad", "warning", "plain"]


class ShownFigure(NamedTuple):
    """One value as it is shown, with the place of the exact one in a command's JSON."""

    text: str
    unit: str
    value: Any
    """As the JSON document has it."""
    source: str
    """Id of the command on the page."""
    pointer: str
    """Place in its document (RFC 6901)."""

    @property
    def exact(self) -> str:
        """The value in JSON."""
        return json_text(self.value)


class SourceCommand(NamedTuple):
    """One command and the document that it writes: what the figures are taken from."""

    anchor: str
    """Id of the command on the page."""
    line: str
    """The command, as a shell takes it."""
    purpose: str
    """What it gives, in a few words."""
    document: Document

    def value(self, pointer: str) -> Any:
        """Look up what stands at a place of the document."""
        found: Any = self.document
        for step in pointer.split("/")[1:]:
            found = found[int(step) if isinstance(found, list) else step]
        return found

    def figure(self, pointer: str, write: Callable[[Any], str], unit: str = "") -> ShownFigure:
        """Take a figure from the document; what does not exist is a dash.

        Parameters
        ----------
        pointer
            Its place, as /results/0/margin_us.
        write
            From the exact value to what is shown.
        unit
            Unit of what is shown.
        """
        value = self.value(pointer)
        return ShownFigure("-" if value is None else write(value), unit, value, self.anchor, pointer)


class Drawing(NamedTuple):
    """Markup of ours that stands for itself: an SVG."""

    svg: str


class Swatch(NamedTuple):
    """The colour and the letter of one kind of time, and what it is called."""

    kind: str
    letter: str
    text: str


class ChapterLink(NamedTuple):
    """A profile's name, leading to its chapter."""

    text: str
    anchor: str
    origin: str
    """Where the profile is from: names may be the same."""


class Code(NamedTuple):
    """Words of a file or a shell, as they are."""

    text: str


Cell = str | ShownFigure | Drawing | Swatch | ChapterLink | Code | SourceCommand


class TableColumn(NamedTuple):
    """A column of a table."""

    heading: str
    kind: Literal["words", "figures", "drawing"] = "figures"
    group: str = ""
    """What stands above it and its neighbours of the same group."""


class Row(NamedTuple):
    """A row of a table."""

    cells: tuple[Cell, ...]
    level: int = 0
    """1 for a part of the row above it, 2 for the one that a reader looks for: it is set in bold."""


class Table(NamedTuple):
    """A table with its caption."""

    caption: str
    columns: tuple[TableColumn, ...]
    rows: tuple[Row, ...]
    stacks: bool = False
    """Whether a phone shows each row as lines: a table of words, which nobody compares down a column."""

    @property
    def groups(self) -> tuple[tuple[str, int], ...]:
        """The headings above the columns' own with how many columns each spans; nothing where there are none."""
        found: list[tuple[str, int]] = []
        for column in self.columns:
            if found and found[-1][0] == column.group:
                found[-1] = (column.group, found[-1][1] + 1)
            else:
                found.append((column.group, 1))
        return tuple(found) if any(group for group, _ in found) else ()


class Chart(NamedTuple):
    """A picture with what it shows in words."""

    css: str
    caption: str
    svg: str
    fallback: str = ""
    """The same in Mermaid, for a page without SVG."""


class ShownVerdict(NamedTuple):
    """One question and its answer."""

    question: str
    answer: str
    tone: Tone
    lines: tuple[str, ...]
    source: str = ""
    pointer: str = ""
    """Place of these lines, joined, in the command's document; empty where it has none."""
    figures: tuple[tuple[str, ShownFigure], ...] = ()
    """What a reader looks for first."""


class Part(NamedTuple):
    """One section of a chapter."""

    key: str
    title: str
    lines: tuple[str, ...] = ()
    verdicts: tuple[ShownVerdict, ...] = ()
    charts: tuple[Chart, ...] = ()
    tables: tuple[Table, ...] = ()
    commands: tuple[str, ...] = ()
    """Ids of the commands that give it."""


class Chapter(NamedTuple):
    """All of one profile."""

    anchor: str
    name: str
    origin: str
    """The PROFILE argument, as a shell takes it."""
    description: str
    facts: tuple[tuple[str, ShownFigure], ...]
    parts: tuple[Part, ...]
    sources: tuple[SourceCommand, ...]

    def line(self, anchor: str) -> str:
        """The command of that id."""
        return next(one.line for one in self.sources if one.anchor == anchor)


class Page(NamedTuple):
    """The whole page."""

    title: str
    program: str
    """What made it."""
    comparison: Table | None
    chapters: tuple[Chapter, ...]
