"""The reference pages: Markdown files next to this module, one for each topic.

The repository shows their prose, and the README links to it. `busplan manual TOPIC` prints a page with the tables that
it asks for, made from the program; a build that publishes pages takes them from there, too.
"""

import re
from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent
"""Folder of the pages."""
TOUR: Final = "commands"
"""Topic to read first."""
_HEADING: Final = "# "
_TABLE: Final = re.compile(r"^> `busplan manual \w+` has a table here: ([a-z ]+?)(?: of `([\w-]+)`)?\.$", re.MULTILINE)
"""Place of a table in a page: what it has, and of which kind of bus or command."""


def topics() -> dict[str, str]:
    """List the topics.

    Returns
    -------
    dict
        Heading of each page by topic (its file name): the tour of the commands, then the others by name.

    Examples
    --------
    >>> topics()["limits"]
    'Limits of validity'
    """
    names = sorted((path.stem for path in FOLDER.glob("*.md")), key=lambda name: (name != TOUR, name))
    return {name: _heading(name) for name in names}


def page(topic: str) -> str:
    """Page of a topic, with its tables.

    Parameters
    ----------
    topic
        One of `topics`.

    Returns
    -------
    str
        The page in GitHub Markdown.

    Raises
    ------
    FileNotFoundError
        There is no such topic.
    """
    return _TABLE.sub(_table, _prose(topic))


def _table(place: re.Match[str]) -> str:
    from busplan.manual.tables import made_table  # noqa: PLC0415 - most pages have no table, and a list has no page

    return "\n".join(made_table(place[1], place[2] or ""))


def _prose(topic: str) -> str:
    return (FOLDER / f"{topic}.md").read_text(encoding="utf-8")


def _heading(topic: str) -> str:
    return _prose(topic).partition("\n")[0].removeprefix(_HEADING)
