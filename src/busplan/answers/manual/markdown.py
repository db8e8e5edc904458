"""The manual as one Markdown page, which reads well as it stands too."""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from busplan.answers.manual.pages import CommandPage, Entry, Manual, spans
from busplan.forms.markdown_words import code, table

# Only what is markup where it stands: the text is the program's own, and people read this file as it is.
_INLINE: Final = re.compile(
    r"([\\`*|~]|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])|\](?=[(\[:])|<(?=[A-Za-z/!?])|&(?=#?[A-Za-z0-9]+;))"
)
_LEADING: Final = re.compile(r"^([0-9]*)([-+#>=.)])")


def markdown_page(manual: Manual) -> str:
    """Write the manual as a reference.

    Parameters
    ----------
    manual
        All pages.

    Returns
    -------
    str
        GitHub's Markdown without a date, so that the same program always writes the same page.
    """
    return "\n\n".join(_blocks(manual)) + "\n"


def _blocks(manual: Manual) -> Iterator[str]:
    program = manual.program
    yield f"# {program.name} {manual.version}"
    yield from _page(program)
    yield "## Commands"
    rows = ([f"[{code(page.called)}](#{_anchor(page.called)})", _prose(page.summary)] for page in manual.commands)
    yield "\n".join(table(["command", "what it answers"], rows, left=2))
    for page in manual.commands:
        yield f"## {page.called}"
        yield from _page(page)
    for section in manual.sections:
        yield f"## {section.title}"
        yield from map(prose, section.paragraphs)
        yield from _entries(["name", "meaning"], section.entries)


def _page(page: CommandPage) -> Iterator[str]:
    yield prose(page.summary)
    yield _typed(f"{page.called} {page.usage}")
    yield from map(prose, page.paragraphs)
    for example in page.examples:
        yield "Example:"
        yield _typed(example)
    yield from _entries(["argument", "meaning"], page.arguments)
    yield from _entries(["option", "meaning"], page.options)


def _entries(headings: Sequence[str], entries: Iterable[Entry]) -> Iterator[str]:
    rows = [[_called(entry), _prose(entry.text)] for entry in entries]
    if rows:
        yield "\n".join(table(headings, rows, left=2))


def _called(entry: Entry) -> str:
    names = ", ".join(map(code, entry.names))
    return f"{names} {code(entry.value)}" if entry.value else names


def _typed(text: str) -> str:
    return f"```sh\n{text}\n```"


def _anchor(heading: str) -> str:
    return heading.replace(" ", "-")


def prose(text: str) -> str:
    r"""Write a paragraph: what is to be typed as code, and none of the rest as markup.

    Parameters
    ----------
    text
        Prose as in `Entry.text`; line ends become spaces.

    Examples
    --------
    >>> prose("*Give* --nodes to `busplan plan`, T_exec in us [1].")
    '\\*Give\\* `--nodes` to `busplan plan`, T_exec in us [1].'
    """
    return _LEADING.sub(r"\1\\\2", _prose(text))


def _prose(text: str) -> str:
    parts = spans(" ".join(text.split()))
    return "".join(code(part) if typed else _INLINE.sub(r"\\\1", part) for part, typed in parts)
