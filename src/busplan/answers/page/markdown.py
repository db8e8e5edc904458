"""A page as Markdown for a repository: the same content, with a Mermaid chart of the timeline, and else tables."""

from collections.abc import Iterator
from typing import Final

from busplan.answers.page.content import (
    Cell,
    Chapter,
    ChapterLink,
    Code,
    Drawing,
    Page,
    Part,
    ShownFigure,
    SourceCommand,
    Swatch,
    Table,
)
from busplan.forms.markdown import code, escaped, table

_OWN: Final = 2
"""Level of a row in bold."""


def page_markdown(page: Page) -> str:
    """Write a page; whatever a profile is called, it is no markup.

    Parameters
    ----------
    page
        Its content.
    """
    return "\n".join(_page(page)) + "\n"


def _page(page: Page) -> Iterator[str]:
    named = page.title in (chapter.name for chapter in page.chapters)
    yield f"# {code(page.title) if named else escaped(page.title)}"
    if page.comparison is not None:
        yield from ("", "## Comparison", "")
        yield from _table(page.comparison)
    single = len(page.chapters) == 1
    for chapter in page.chapters:
        yield from _chapter(chapter, level=2 if single else 3, heading=not single or page.title != chapter.name)
    yield from ("", f"Made by {escaped(page.program)}. Times are in us where nothing else is said.")


def _chapter(chapter: Chapter, *, level: int, heading: bool) -> Iterator[str]:
    if heading:
        yield from ("", f'<a id="{chapter.anchor}"></a>', "", f"## {code(chapter.name)}")
    if chapter.description:
        yield from ("", escaped(chapter.description))
    facts = (f"{word} {fact.text}{f' {fact.unit}' if fact.unit else ''}" for word, fact in chapter.facts)
    yield from ("", f"{', '.join(facts)}; profile {code(chapter.origin)}.")
    for part in chapter.parts:
        yield from ("", f"{'#' * level} {part.title}")
        yield from _part(chapter, part)


def _part(chapter: Chapter, part: Part) -> Iterator[str]:
    for line in part.lines:
        yield from ("", escaped(line))
    for verdict in part.verdicts:
        yield from ("", f"**{verdict.question} {verdict.answer}.**")
        yield ""
        yield from (f"- {escaped(line)}" for line in verdict.lines)
    for chart in part.charts:
        if chart.fallback:
            yield from ("", escaped(chart.caption), "", "```mermaid", chart.fallback.rstrip("\n"), "```")
    for one in part.tables:
        yield from ("", f"{escaped(one.caption)}:", "")
        yield from _table(one)
    if part.commands:
        yield from ("", "```sh", *(chapter.line(anchor) for anchor in part.commands), "```")


def _table(one: Table) -> list[str]:
    # A drawing has no place here; what it shows stands in figures beside it.
    shown = [index for index, column in enumerate(one.columns) if column.kind != "drawing"]
    columns = [one.columns[index] for index in shown]
    headings = [escaped(" ".join(filter(None, (column.group, column.heading)))) or " " for column in columns]
    rows = ([_in_row(_cell(row.cells[index]), level=row.level) for index in shown] for row in one.rows)
    figures = (place for place, column in enumerate(columns) if column.kind == "figures" and not one.stacks)
    return table(headings, rows, left=next(figures, len(columns)))


def _in_row(text: str, *, level: int) -> str:
    return f"**{text}**" if level == _OWN and text else text


def _cell(cell: Cell) -> str:
    match cell:
        case ShownFigure():
            text = cell.text
        case ChapterLink():
            origin = "" if cell.origin == cell.text else f" {code(cell.origin)}"
            text = f"[{code(cell.text)}](#{cell.anchor}){origin}"
        case SourceCommand():
            text = code(cell.line)
        case Code():
            text = code(cell.text)
        case Swatch():
            text = escaped(cell.text)
        case Drawing():
            text = ""
        case _:
            text = escaped(cell)
    return text
