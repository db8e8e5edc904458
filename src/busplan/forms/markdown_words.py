"""GitHub Markdown: escaped text, code and tables."""

import re
from collections.abc import Iterable, Sequence
from typing import Final

from busplan.printable import printable

_INSIDE: Final = re.compile(r"[\\`*_\[\]<>~&@:$]|(?<=www)\.")
"""Markup inside a line, and characters that turn plain words into a link, a mention or a formula."""
_AT_START: Final = re.compile(r"^(\d*)([-+#=.)])(?=\s|$|[-=#])")
"""Markup at the start of a line: a list, a heading or a rule."""

BAR: Final = r"\|"
"""Escaped bar in a cell; code needs it, too: Markdown splits a table into cells first."""


def escaped(text: str) -> str:
    r"""Escape Markdown.

    Examples
    --------
    >>> escaped("a *b*")
    'a \\*b\\*'
    """
    return _AT_START.sub(r"\1\\\2", _INSIDE.sub(r"\\\g<0>", printable(" ".join(text.split()))))


def code(text: str) -> str:
    """Write text as inline code; control characters are escaped.

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
        One for each column, in Markdown.
    rows
        Cells in Markdown, as many as headings; bars are escaped here.
    left
        Which columns are left-aligned: one flag each, or how many of the first. The others are right-aligned.

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
