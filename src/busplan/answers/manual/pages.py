"""Pages of the manual, in no format: what every renderer writes.

Text is prose in which `backticks` mark what a user types; option names need none.
"""

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

_TYPED: Final = re.compile(r"`([^`]+)`|(?<![\w`-])(--?[A-Za-z][\w-]*)")


class Entry(NamedTuple):
    """A name and what it means: of an argument, an option, a variable, a file, an exit code."""

    names: tuple[str, ...]
    value: str
    """What stands for the value of an option; empty where it has none."""
    text: str


class ManualSection(NamedTuple):
    """Paragraphs, then entries."""

    title: str
    paragraphs: tuple[str, ...]
    entries: tuple[Entry, ...]


class CommandPage(NamedTuple):
    """One command, or the program itself."""

    name: str
    called: str
    """The words that call it, as busplan capacity."""
    usage: str
    """What may follow them, as [OPTIONS] PROFILE."""
    summary: str
    """One sentence: what the command answers."""
    paragraphs: tuple[str, ...]
    examples: tuple[str, ...]
    arguments: tuple[Entry, ...]
    options: tuple[Entry, ...]


class Manual(NamedTuple):
    """The program, its commands, and what holds for all of them."""

    program: CommandPage
    version: str
    commands: tuple[CommandPage, ...]
    sections: tuple[ManualSection, ...]


def spans(text: str) -> Iterator[tuple[str, bool]]:
    """Split prose into what a user reads and what a user types.

    Examples
    --------
    >>> list(spans("Give --nodes 4 to `busplan plan`."))
    [('Give ', False), ('--nodes', True), (' 4 to ', False), ('busplan plan', True), ('.', False)]
    """
    end = 0
    for match in _TYPED.finditer(text):
        if match.start() > end:
            yield text[end : match.start()], False
        yield match[1] or match[2], True
        end = match.end()
    if end < len(text):
        yield text[end:], False
