"""Findings as lines for people, editors and build logs: concise, or with the line of the file and the cure."""

import re
from collections.abc import Iterator
from textwrap import wrap
from typing import Final, NamedTuple
from unicodedata import category, east_asian_width

from busplan.buses.rule import Severity
from busplan.forms.lines import BLANK, Line, Mark, Tone, plain_text, styled_text
from busplan.gate.finding import Finding, finding_line, finding_parts
from busplan.gate.report import CheckReport, Located
from busplan.printable import printable

TONES: Final[dict[Severity, Tone]] = {"error": "fails", "warning": "warns"}
"""Colour of each severity, which is always said in a word, too."""


def marked_line(text: str, path: str, finding: Finding) -> Line:
    """Mark the place, the code and the severity of a line that begins with them."""
    place, words = finding_parts(path, finding)
    start = len(printable(place)) + 1
    said = Mark(start, start + words.index(": "), TONES[finding.severity])
    return Line(text, "drawn", (Mark(0, start, "title"), said))


def concise(report: CheckReport, *, width: int | None = None) -> str:
    """One line for each finding; in colours if there is a width, at which the terminal breaks the lines itself."""
    lines = [
        marked_line(finding_line(located.path, located.finding), located.path, located.finding)
        for located in report.located
    ]
    return plain_text(lines) if width is None else styled_text(lines)


WIDTH: Final = 100
"""Widest line, in columns: of sentences, which are wrapped, and of source lines, which are cut."""
_INDENT: Final = 4 * " "
_CUT: Final = "..."
_UNBROKEN: Final = "\xa0"
"""A space at which no line ends; printable text has none."""
_NUMBER_AND_WORD: Final = re.compile(r"(?<=[0-9]) (?=[a-z])")


def full(report: CheckReport, *, width: int | None = None) -> str:
    """Each finding with its line of the file; in colours if there is the width of a terminal, in columns."""
    return plain_text(_lines(report, WIDTH)) if width is None else styled_text(_lines(report, min(width, WIDTH)))


def _lines(report: CheckReport, width: int) -> Iterator[Line]:
    for located in report.located:
        yield from _heading(located, width)
        yield from _source(located, width)
        yield from _mending(located, width)
        yield BLANK


def _heading(located: Located, width: int) -> Iterator[Line]:
    """Place, code and severity, which editors read, and the problem, wrapped."""
    place, words = finding_parts(located.path, located.finding)
    head = printable(f"{place} {words.removesuffix(located.finding.message)}")
    first, *others = _wrapped(located.finding.problem, width, first=head)
    yield marked_line(first, located.path, located.finding)
    yield from (Line(line, "drawn") for line in others)


def _source(located: Located, width: int) -> Iterator[Line]:
    number, finding = str(located.finding.line), located.finding
    margin = f"{' ' * len(number)} | "
    shown = _shown(located.source, finding.marked_column - 1, finding.marked_end_column - 1, width - len(margin))
    under = f"{margin}{' ' * _columns(shown.before)}"
    carets = "^" * max(_columns(shown.marked), 1)
    named = f"{under}{carets} {finding.rule}"
    marked = named if len(named) <= width else f"{under}{carets}"
    yield Line(margin.rstrip(), "drawn")
    yield Line(f"{number} | {shown.before}{shown.marked}{shown.after}".rstrip(), "drawn")
    yield Line(marked, "drawn", (Mark(len(under), len(marked), TONES[finding.severity]),))


def _mending(located: Located, width: int) -> Iterator[Line]:
    if located.finding.help:
        yield from (Line(line, "drawn") for line in _wrapped(located.finding.help, width, first="help: "))
    if located.finding.cure:
        yield Line("cheapest cure:", "drawn")
        yield from (Line(f"{_INDENT}{line}", "drawn") for line in located.finding.cure.split("\n"))


def _wrapped(text: str, width: int, *, first: str) -> list[str]:
    """Break a sentence between words, but never between a number and its unit."""
    lines = wrap(
        _NUMBER_AND_WORD.sub(_UNBROKEN, printable(text)),
        width,
        initial_indent=first,
        subsequent_indent=_INDENT,
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
    )
    return [line.replace(_UNBROKEN, " ") for line in lines]


class _Shown(NamedTuple):
    """A source line as shown: what is marked, and what stands around it."""

    before: str
    marked: str
    after: str


def _shown(source: str, start: int, end: int, width: int) -> _Shown:
    """Cut a source line around what is marked; tabs become spaces, so that the carets stand below it."""
    parts = source[:start], source[start:end], source[end:]
    before, marked, after = (
        printable(part, write=lambda character: _INDENT if character == "\t" else " ") for part in parts
    )
    if _columns(before + marked + after) <= width:
        return _Shown(before, marked, after)
    room = width - 2 * len(_CUT)
    marked, rest = marked[:room], marked[room:]
    kept = max(room - len(marked), 0)
    behind = (rest + after)[: max(kept - len(before), kept // 2)]
    ahead = before[max(len(before) - (kept - len(behind)), 0) :]
    return _Shown(
        f"{_CUT if ahead != before else ''}{ahead}", marked, f"{behind}{_CUT if behind != rest + after else ''}"
    )


def _columns(text: str) -> int:
    """Columns that a text takes."""
    return sum(
        0 if category(character) in ("Mn", "Me") else 2 if east_asian_width(character) in "WF" else 1
        for character in text
    )
