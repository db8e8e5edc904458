"""An answer as one self-contained HTML file: no network, no script; light, dark, narrow and printed styles."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from busplan import __version__
from busplan.buses.figure import unit_of
from busplan.forms import blocks as made_of
from busplan.forms.blocks import Bar, Block, Chapter, Chart, Command, Report, Sentence, Table
from busplan.forms.columns import cell_text, sentence_text
from busplan.forms.details import shown_blocks
from busplan.forms.inks import DARK, fills
from busplan.forms.numbers import figure_text, unit_text
from busplan.forms.signed_bar import signed_bar
from busplan.printable import json_text, printable_lines

_TYPES: Final = ("ShownValue", "Words", "Code", "SectionLink", "Swatch", "Bar", "Command", "Sentence")
_BLOCKS: Final = ("Facts", "Table", "Chart", "Snippet", "Calculation", "Question", "Chapter")


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
    environment = Environment(
        loader=PackageLoader("busplan.forms"),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    for name in (*_TYPES, *_BLOCKS):
        kind = getattr(made_of, name)
        environment.tests[name.lower()] = lambda one, kind=kind: isinstance(one, kind)
    environment.filters |= {
        "exact": lambda value: json_text(value.value),
        "exact_unit": lambda value: unit_of(value.key),
        "figure_text": figure_text,
        "unit": unit_text,
        "plain": sentence_text,
        "runs": lambda found: list(_runs(found)),
        "groups": _groups,
        "words": cell_text,
        "bar": _bar,
        # SVG from `forms.svg` is escaped already.
        "svg": Markup,
        "holds_sections": lambda section: any(isinstance(one, Chapter) for one in section.blocks),
    }
    found = shown_blocks(report)
    light, dark = fills(".chart")
    styles = dict.fromkeys(chart.drawing.stylesheet for chart in _charts(found))
    colours = Markup(f"{''.join(styles)}{light}{DARK}{{\n{dark}}}\n")  # noqa: S704 - our own constants
    return environment.get_template("page.html.j2").render(
        title=report.title,
        blocks=found,
        program=f"busplan {__version__}",
        colours=colours,
    )


def _shown(piece: object) -> object:
    """Text without control characters: a terminal may show the file."""
    return printable_lines(piece) if isinstance(piece, str) and not isinstance(piece, Markup) else piece


def _charts(blocks: Sequence[Block]) -> Iterator[Chart]:
    for block in blocks:
        if isinstance(block, Chart):
            yield block
        elif isinstance(block, Chapter):
            yield from _charts(block.blocks)


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
    found = [(name, len(list(run))) for name, run in groupby(column.group for column in table.columns)]
    return found if any(name for name, _ in found) else []


def _bar(bar: Bar) -> Markup:
    title = f"{figure_text(bar.value)} {bar.value.unit}"
    drawn = signed_bar(float(bar.value.value), least=bar.least, most=bar.most, title=title)
    return Markup(drawn)  # noqa: S704 - our own SVG
