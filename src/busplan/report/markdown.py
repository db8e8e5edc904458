"""GitHub's Markdown: tables and words in which nothing of a profile's text is markup."""

import re
from collections.abc import Iterable, Sequence
from typing import Final

_SPECIAL: Final = re.compile(r"([\\`*_{}\[\]()<>#+\-.!|~&@:])")


def escaped(text: str) -> str:
    r"""Write words so that none of them is markup, in a line or a cell of a table.

    Examples
    --------
    >>> escaped("a|b *c*")
    'a\\|b \\*c\\*'
    """
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def code(text: str) -> str:
    r"""Write text as code, as it is: nothing in it is markup, no mention and no link; a cell of a table may hold it.

    Parameters
    ----------
    text
        Any text; line ends become spaces.

    Examples
    --------
    >>> code("bus.nodes"), code("a ` b"), code("x | y")
    ('`bus.nodes`', '`` a ` b ``', '`x \\| y`')
    """
    line = " ".join(text.split())
    longest = max(map(len, re.findall("`+", line)), default=0)
    fence = "`" * (longest + 1)
    # A backtick at an edge would join the fence; a backslash before a bar is part of the table's own language.
    space = " " if longest else ""
    return f"{fence}{space}{line}{space}{fence}".replace("|", r"\|") if line else "` `"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, left: int) -> list[str]:
    """Lay out a table, its cells as they are: who calls has escaped them.

    Parameters
    ----------
    headings
        One a column.
    rows
        Cells, as many as headings.
    left
        How many of the first columns are words, set to the left; the others are figures, set to the right.

    Returns
    -------
    list
        Lines of Markdown, without line ends.
    """
    rule = [":---" if number < left else "---:" for number in range(len(headings))]
    return [f"| {' | '.join(row)} |" for row in (headings, rule, *rows)]
