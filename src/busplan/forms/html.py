"""An answer as one HTML file that needs no network, with light, dark, narrow and printed styles.

The sliders of an explorer are the only script.
"""

import json
import re
from base64 import b64encode
from collections.abc import Iterator, Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from itertools import groupby
from typing import Final, get_args

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from busplan import __version__
from busplan.buses.figure import unit_of
from busplan.english import json_text, printable_lines
from busplan.forms.blocks import Bar, Block, Card, Cell, Chapter, Command, Explorer, Gauge, Report, Sentence, Table
from busplan.forms.charts import Drawing
from busplan.forms.inks import DARK, fills
from busplan.forms.numbers import cell_text, figure_text, sentence_text, shown_blocks, unit_text
from busplan.forms.svg import inline, signed_bar

_DARK_RULES: Final = re.compile(r"@media screen and \(prefers-color-scheme: ?dark\) ?\{([^{}]*\{[^{}]*\})*\s*\}")
_NOT_ON_LIGHT: Final = '&:not([data-jp-theme-light="true"] *)'
"""Selector against JupyterLab's light theme, which stays light on a dark desktop."""


def page(report: Report) -> str:
    """HTML document of an answer; text from profiles is escaped.

    The same answer always gives the same document.
    """
    blocks = shown_blocks(report)
    script = ""
    if any(isinstance(block, Explorer) for block in blocks):
        script = (files("busplan.forms") / "templates" / "explore.js").read_text(encoding="utf-8")
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            title=report.title,
            blocks=blocks,
            program=f"busplan {__version__}",
            colours=Markup(_colours()),  # noqa: S704 - our own constants
            script=Markup(script),  # noqa: S704 - our own file
            script_hash=f"sha256-{b64encode(sha256(script.encode()).digest()).decode()}",
        )
    )


def fragment(report: Report) -> str:
    """HTML of an answer's blocks for a notebook. Its styles reach nothing outside it."""
    # A notebook runs no script of ours.
    blocks = [
        piece for block in shown_blocks(report) for piece in (block.blocks if isinstance(block, Explorer) else [block])
    ]
    folder = files("busplan.forms") / "templates"
    chart, style = ((folder / name).read_text(encoding="utf-8") for name in ("chart.css", "style.css"))
    # The rules are nested in the fragment's own rule, where & stands for its outer element, their root.
    sheet = f"{chart}{_colours()}{style}".replace(":root", "&")
    sheet = _DARK_RULES.sub(lambda rules: f"{_NOT_ON_LIGHT} {{\n{rules[0]}\n}}\n", sheet)
    template = _environment().get_template("fragment.html.j2")
    return template.render(blocks=blocks, style=Markup(sheet))  # noqa: S704 - as above


@cache
def _environment() -> Environment:
    """Jinja's environment of all templates, which keeps the compiled ones."""
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
        "settings": _settings,
        "holds_sections": lambda section: any(isinstance(block, Chapter) for block in section.blocks),
    }
    return environment


def _colours() -> str:
    """CSS rules of inks, on light and on dark backgrounds."""
    light, dark = fills(".chart")
    return f"{light}{DARK}{{\n{dark}}}\n"


def _shown(piece: object) -> object:
    """Text without control characters, because a terminal may show the file."""
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
    """Group headings, each with the number of columns that it spans; empty without groups."""
    groups = [(name, len(list(run))) for name, run in groupby(column.group for column in table.columns)]
    return groups if any(name for name, _ in groups) else []


def _settings(explorer: Explorer) -> Markup:
    """Cards of an explorer as JSON for its script. Repeated texts are replaced by numbers."""
    labels: dict[str, int] = {}
    texts: dict[str, int] = {}

    def number(words: str, seen: dict[str, int]) -> int:
        return seen.setdefault(printable_lines(words), len(seen))

    def setting(card: Card | None) -> list[object] | None:
        if card is None:
            return None
        lines = [
            [number(label, labels), number(sentence_text(words), texts), words.state] for label, words in card.lines
        ]
        subject, word = number(sentence_text(card.subject), texts), number(card.verdict.text, texts)
        return [subject, word, card.verdict.state, _shares(card.gauge), lines]

    settings = [[setting(card) for card in cards] for cards in explorer.cards]
    text = json.dumps({"labels": [*labels], "texts": [*texts], "settings": settings}, separators=(",", ":"))
    # No text of a profile can end the element.
    return Markup(text.replace("<", "\\u003c"))  # noqa: S704 - as above


def _shares(gauge: Gauge | None) -> list[tuple[str, float, float]] | None:
    """Class of each part of a bar, with its ends [%]."""
    if gauge is None:
        return None
    parts = [
        (f"{part.name} {part.state}", round(100 * part.start, 3), round(100 * part.end, 3))
        for part in gauge.parts()
        if part.end > part.start
    ]
    end = round(100 * gauge.most, 3)
    return [*parts, *([("end", end, end)] if gauge.most < 1 else [])]


def _drawn(drawing: Drawing) -> Markup:
    return Markup(inline(drawing))  # noqa: S704 - our own SVG, which is escaped


def _bar(bar: Bar) -> Markup:
    title = f"{figure_text(bar.value)} {bar.value.unit}"
    drawn = signed_bar(float(bar.value.value), least=bar.least, most=bar.most, title=title)
    return Markup(drawn)  # noqa: S704 - our own SVG
