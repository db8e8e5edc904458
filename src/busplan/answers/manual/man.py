"""The manual as a man page, in the macros of man(7) that groff and mandoc share."""

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from textwrap import wrap
from typing import Final

from busplan.answers.manual.pages import CommandPage, Entry, Manual, spans

# An ASCII character that a user may type must come out as itself: of these, groff makes typographic ones.
_ESCAPES: Final = {"\\": r"\e", "-": r"\-", "'": r"\(aq", "`": r"\(ga", "^": r"\(ha", "~": r"\(ti", '"': r"\(dq"}
_COPIED: Final = (".nr HY 0", ".nh", ".ad l", ".ss 12 0")
"""No hyphens, no wide spaces: neither stands in what a reader copies from the page."""
_WIDTH: Final = 78
_SPECIAL: Final = re.compile("[" + re.escape("".join(_ESCAPES)) + "]")


def roff(text: str) -> str:
    r"""Write text so that none of it is a request, and every character comes out as itself.

    Parameters
    ----------
    text
        Any text; line ends become spaces.

    Examples
    --------
    >>> roff(".B it's\n--nodes")
    '\\&.B it\\(aqs \\-\\-nodes'
    """
    return _no_request(_escaped(" ".join(text.split())))


def _escaped(text: str) -> str:
    return _SPECIAL.sub(lambda match: _ESCAPES[match[0]], text)


def _no_request(line: str) -> str:
    """Keep a line from being read as a request; an apostrophe that begins one is escaped already."""
    return rf"\&{line}" if line.startswith(".") else line


def man_page(manual: Manual) -> str:
    """Write the manual as busplan(1).

    Parameters
    ----------
    manual
        All pages.

    Returns
    -------
    str
        A man page without a date, so that the same program always writes the same page.
    """
    lines = ("", *_lines(manual))
    # A heading opens a paragraph by itself.
    return "".join(
        f"{line}\n" for before, line in pairwise(lines) if line != ".PP" or not before.startswith((".SH", ".SS"))
    )


def _lines(manual: Manual) -> Iterator[str]:
    page = manual.program
    yield f'.TH {page.name.upper()} 1 "" "{roff(f"{page.name} {manual.version}")}" "User Commands"'
    yield from _COPIED
    yield from (".SH NAME", *_prose(f"{page.name} - {page.summary}"))
    yield from (".SH SYNOPSIS", _usage(page))
    yield from (".SH DESCRIPTION", *_paragraphs(page.paragraphs), *_examples(page.examples))
    yield from (".SH OPTIONS", *_entries(page.options))
    yield ".SH COMMANDS"
    for command in manual.commands:
        yield from _command(command)
    for section in manual.sections:
        yield f".SH {roff(section.title.upper())}"
        yield from _paragraphs(section.paragraphs)
        yield from _entries(section.entries)


def _command(page: CommandPage) -> Iterator[str]:
    yield f".SS {roff(page.name)}"
    yield from _paragraphs((page.summary,))
    yield from (".PP", _usage(page))
    yield from _paragraphs(page.paragraphs)
    yield from _examples(page.examples)
    yield from _entries((*page.arguments, *page.options))


def _usage(page: CommandPage) -> str:
    return rf"\fB{roff(page.called)}\fR {roff(page.usage)}".rstrip()


def _paragraphs(texts: Iterable[str]) -> Iterator[str]:
    for text in texts:
        yield from (".PP", *_prose(text))


def _examples(examples: Iterable[str]) -> Iterator[str]:
    for example in examples:
        yield from (".PP", "Example:", ".PP", ".RS 4", ".EX", roff(example), ".EE", ".RE")


def _entries(entries: Iterable[Entry]) -> Iterator[str]:
    for entry in entries:
        names = ", ".join(rf"\fB{roff(name)}\fR" for name in entry.names)
        yield from (".TP", rf"{names} \fI{roff(entry.value)}\fR" if entry.value else names)
        yield from _prose(entry.text)


def _prose(text: str) -> Iterator[str]:
    """Lines of roff; what is to be typed is bold."""
    parts = spans(" ".join(text.split()))
    line = "".join(rf"\fB{_escaped(part)}\fR" if typed else _escaped(part) for part, typed in parts)
    return map(_no_request, wrap(line, _WIDTH, break_long_words=False, break_on_hyphens=False))
