"""An answer as one self-contained HTML file: no network, no script; light, dark, narrow and printed styles."""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.resources import files
from itertools import groupby
from typing import Final, get_args

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from busplan import __version__
from busplan.buses.figure import unit_of
from busplan.english import json_text, printable_lines
from busplan.forms.blocks import Bar, Block, Cell, Chapter, Command, Report, Sentence, Table
from busplan.forms.charts import Drawing
from busplan.forms.inks import DARK, fills
from busplan.forms.numbers import cell_text, figure_text, sentence_text, shown_blocks, unit_text
from busplan.forms.svg import inline, signed_bar

_DARK_RULES: Final = re.compile(r"@media screen and \(prefers-color-scheme: ?dark\) ?\{([^{}]*\{[^{}]*\})*\s*\}")
_NOT_ON_LIGHT: Final = '&:not([data-jp-theme-light="true"] *)'
"""JupyterLab's light theme stays light on a dark desktop."""


def page(report: Report) -> str:
    """Write an answer as HTML; text from profiles is escaped.

    Parameters
    ----------
    report
        The answer.

    Returns
    -------
    str
        The whole document. The same answer always gives the same document.
    """
    blocks = shown_blocks(report)
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            title=report.title,
            blocks=blocks,
            program=f"busplan {__version__}",
            colours=Markup(_colours()),  # noqa: S704 - our own constants
        )
    )


def fragment(report: Report) -> str:
    """Write the blocks of an answer as a piece of HTML for a notebook, whose styles reach nothing outside it.

    Parameters
    ----------
    report
        The answer.
    """
    blocks = shown_blocks(report)
    folder = files("busplan.forms") / "templates"
    chart, style = ((folder / name).read_text(encoding="utf-8") for name in ("chart.css", "style.css"))
    # The rules are nested in the fragment's own rule, where & stands for its outer element: that is its root.
    sheet = f"{chart}{_colours()}{style}".replace(":root", "&")
    sheet = _DARK_RULES.sub(lambda rules: f"{_NOT_ON_LIGHT} {{\n{rules[0]}\n}}\n", sheet)
    template = _environment().get_template("fragment.html.j2")
    return template.render(blocks=blocks, style=Markup(sheet))  # noqa: S704 - as above


@cache
def _environment() -> Environment:
    """Jinja's environment of all templates, which keeps each compiled."""
    environment = Environment(
        loader=PackageLoader("busplan.forms"),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    for kind in {*get_args(Cell), *get_args(Block)} - {str}:
        environment.tests[kind.__name__.lower()] = lambda piece, kind=kind: isinstance(piece, kind)
    environment.filters |= {
        "exact": lambda value: json_text(value.value),
        "exact_unit": lambda value: unit_of(value.key),
        "figure_text": figure_text,
        "unit": unit_text,
        "plain": sentence_text,
        "runs": lambda blocks: list(_runs(blocks)),
        "groups": _groups,
        "words": cell_text,
        "bar": _bar,
        "drawn": _drawn,
        "holds_sections": lambda section: any(isinstance(block, Chapter) for block in section.blocks),
    }
    return environment


def _colours() -> str:
    """Rules of inks, on a light and on a dark background."""
    light, dark = fills(".chart")
    return f"{light}{DARK}{{\n{dark}}}\n"


def _shown(piece: object) -> object:
    """Text without control characters: a terminal may show the file."""
    return printable_lines(piece) if isinstance(piece, str) and not isinstance(piece, Markup) else piece


def _runs(blocks: Sequence[Block]) -> Iterator[tuple[str, list[Block]]]:
    """Runs of neighbouring blocks with the same layout."""
    for role, run in groupby(blocks, key=_role):
        yield role, list(run)


def _role(block: Block) -> str:
    match block:
        case Sentence():
            return "words"
        case Command():
            return "commands"
        case Chapter():
            return "sections"
    return "body"


def _groups(table: Table) -> list[tuple[str, int]]:
    """Group headings with the number of columns that each spans; empty if no column has a group."""
    groups = [(name, len(list(run))) for name, run in groupby(column.group for column in table.columns)]
    return groups if any(name for name, _ in groups) else []


def _drawn(drawing: Drawing) -> Markup:
    return Markup(inline(drawing))  # noqa: S704 - our own SVG, which is escaped


def _bar(bar: Bar) -> Markup:
    title = f"{figure_text(bar.value)} {bar.value.unit}"
    drawn = signed_bar(float(bar.value.value), least=bar.least, most=bar.most, title=title)
    return Markup(drawn)  # noqa: S704 - our own SVG
