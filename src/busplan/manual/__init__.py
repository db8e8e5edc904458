"""The reference pages: Markdown files next to this module, one for each topic.

The repository shows them, the README links to them, and `busplan manual TOPIC` prints them.
"""

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent
"""Folder of the pages."""
_HEADING: Final = "# "


def topics() -> dict[str, str]:
    """List the topics.

    Returns
    -------
    dict
        Heading of each page by topic (its file name), sorted by topic.

    Examples
    --------
    >>> topics()["limits"]
    'Limits of validity'
    """
    return {path.stem: _heading(path.stem) for path in sorted(FOLDER.glob("*.md"))}


def page(topic: str) -> str:
    """Read the page of a topic.

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
    return (FOLDER / f"{topic}.md").read_text(encoding="utf-8")


def _heading(topic: str) -> str:
    return page(topic).partition("\n")[0].removeprefix(_HEADING)
