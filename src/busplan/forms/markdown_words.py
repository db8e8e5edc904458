"""GitHub's Markdown: tables and words in which nothing of a profile's text is markup."""

import re
from collections.abc import Iterable, Sequence
from typing import Final

from busplan.printable import printable

_INSIDE: Final = re.compile(r"[\\`*_\[\]<>~&@:$]|(?<=www)\.")
"""Markup inside a line, and what makes a link, a mention or a formula of bare words."""
_AT_START: Final = re.compile(r"^(\d*)([-+#=.)])(?=\s|$|[-=#])")
"""What makes a list, a heading or a rule of the line that it begins."""

BAR: Final = r"\|"
"""A bar inside a cell, also inside code: the table is taken apart before its cells are read."""


def escaped(text: str) -> str:
    r"""Escape Markdown.

    Examples
    --------
    >>> escaped("a *b*")
    'a \\*b\\*'
    """
    return _AT_START.sub(r"\1\\\2", _INSIDE.sub(r"\\\g<0>", printable(" ".join(text.split()))))


def code(text: str) -> str:
    """Write text as code: nothing in it is markup, no mention and no link, and nothing commands a terminal.

    Parameters
    ----------
    text
        Any text; line ends become spaces.

    Examples
    --------
    >>> code("bus.nodes"), code("a ` b")
    ('`bus.nodes`', '`` a ` b ``')
    """
    line = printable(" ".join(text.split()))
    longest = max(map(len, re.findall("`+", line)), default=0)
    fence = "`" * (longest + 1)
    # A backtick at an edge would join the fence.
    space = " " if longest else ""
    return f"{fence}{space}{line}{space}{fence}" if line else "` `"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, left: int | Sequence[bool]) -> list[str]:
    r"""Lay out a table.

    Parameters
    ----------
    headings
        One a column.
    rows
        Cells, as many as headings; Markdown already, but for the bars that would part them.
    left
        Which columns are words, set to the left, or how many of the first; figures are set to the right.

    Returns
    -------
    list
        Lines of Markdown, without line ends.

    Examples
    --------
    >>> table(["name", "us"], [["`a | b`", "1"]], left=1)[-1]
    '| `a \\| b` | 1 |'
    """
    words = [number < left for number in range(len(headings))] if isinstance(left, int) else left
    rule = [":---" if is_words else "---:" for is_words in words]
    return [f"| {' | '.join(cell.replace('|', BAR) for cell in row)} |" for row in (headings, rule, *rows)]
