"""A card in characters: subject, verdict, a bar of the period, and named lines."""

from typing import Final

from busplan.forms.blocks import Card, Gauge
from busplan.forms.lines import Line, Mark, wrapped
from busplan.forms.numbers import sentence_line
from busplan.printable import printable

_WIDTH: Final = 80
"""Width without a terminal, and the largest one."""
_INDENT: Final = "  "
_LABEL: Final = 18
"""Where the words of a line begin."""
_GAP: Final = 2
"""Fewest blanks between subject and verdict."""


def card_lines(card: Card, width: int | None) -> list[Line]:
    """Write a card as lines.

    Parameters
    ----------
    card
        The card.
    width
        Width of the terminal, in columns; None without one.
    """
    room = min(width or _WIDTH, _WIDTH)
    lines = [*_head(card, room), *([_bar(card.gauge, room)] if card.gauge else [])]
    for label, words in card.lines:
        said = sentence_line(words)
        before = f"{_INDENT}{label:<{_LABEL - len(_INDENT)}}"
        marks = tuple(Mark(mark.start + len(before), mark.end + len(before), mark.tone) for mark in said.marks)
        lines += wrapped(Line(f"{before}{said.text}", said.tone, marks), room if width else None, hang=_LABEL)
    return lines


def _head(card: Card, width: int) -> list[Line]:
    """Subject on the left and verdict on the right; below each other where they need more than a line."""
    subject, verdict = sentence_line(card.subject).text, printable(card.verdict.text)
    gap = width - len(subject) - len(verdict)
    if gap < _GAP:
        return [
            *wrapped(Line(subject, "title"), width),
            *wrapped(Line(f"{_INDENT}{verdict}", card.verdict.state), width),
        ]
    start = len(subject) + gap
    marks = (Mark(0, len(subject), "title"), Mark(start, start + len(verdict), card.verdict.state))
    return [Line(f"{subject}{' ' * gap}{verdict}", "neutral", marks)]


def _bar(gauge: Gauge, width: int) -> Line:
    """The period: # used, ~ in doubt, . free, r to stay free; the cycle may use it up to |."""
    cells = width - len(_INDENT) - 2
    marks = list[Mark]()
    text = ""
    for part in gauge.parts():
        before = len(text)
        text += part.letter * (round(part.end * cells) - len(text))
        marks.append(Mark(len(_INDENT) + 1 + before, len(_INDENT) + 1 + len(text), part.state))
    end = round(gauge.most * cells)
    if end < cells:
        text = f"{text[:end]}|{text[end + 1 :]}"
    return Line(f"{_INDENT}[{text}]", "drawn", tuple(marks))
