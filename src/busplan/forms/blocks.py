"""Blocks of an answer: sentences, tables, charts and commands, in sections.

A block holds content, not appearance: a figure keeps its exact value, and a state is a word, not a colour. Each form
writes every block in its own way.
"""

from collections.abc import Mapping, Sequence
from string import Formatter
from typing import Any, Final, Literal, NamedTuple

from busplan.buses.figure import Figure, Ink
from busplan.forms.charts import Drawing

State = Literal["passes", "fails", "warns", "neutral"]
"""Verdict of a piece of text; it sets the colour."""
JsonDocument = dict[str, Any]
Record = dict[str, Any]
"""One row of plain data: value by column."""


class ShownValue(NamedTuple):
    """Exact value of a figure, and its way of writing."""

    value: Any
    """Value as in the JSON document; None without one."""
    key: str = ""
    """Key in the register of figures and in JSON; its suffix is the unit of the value."""
    unit: str = ""
    """Unit in which the value is written: "um" for a key in mm, "%" for a share."""
    decimals: int | None = None
    """Decimals of a number; None for all. A number too small for them has three digits instead."""
    signed: bool = False
    """Whether a positive number has a plus sign."""
    state: State = "neutral"
    digits: int | None = None
    """Significant digits of a number without `decimals`; None for all."""
    fixed: bool = False
    """Whether a number is always rounded to `decimals`; one too small for them is written as zero."""
    grouped: bool = False
    """Whether commas separate the thousands of a number without `decimals`."""
    hexadecimal: bool = False
    """Whether a whole number is written as 0x1f."""


class Words(NamedTuple):
    """Text with a state."""

    text: str
    state: State = "neutral"


class Code(NamedTuple):
    """Verbatim text: a name, a key, a path or an argument."""

    text: str


class SectionLink(NamedTuple):
    """A name that links to a section."""

    text: str
    key: str
    """Key of the section."""
    origin: str
    """PROFILE argument, quoted for a shell. It tells profiles of the same name apart."""


class Swatch(NamedTuple):
    """Entry of a drawing's legend: colour, letter or mark, and name."""

    ink: Ink
    letter: str
    text: str


class Bar(NamedTuple):
    """A value as a bar, on the scale of all rows of its column, which includes zero."""

    value: ShownValue
    least: float
    most: float


class Command(NamedTuple):
    """A shell command."""

    line: str


Part = str | ShownValue | Words | Code
"""A piece of a sentence."""


class Sentence(NamedTuple):
    """Text with figures in it: one sentence, or a few."""

    parts: tuple[Part, ...]
    state: State = "neutral"


Cell = str | ShownValue | Words | Code | SectionLink | Swatch | Bar | Command | Sentence


class TableColumn(NamedTuple):
    """A column of a table."""

    heading: str
    unit: str = ""
    kind: Literal["words", "figures", "drawing"] = "figures"
    group: str = ""
    """Heading above neighbouring columns of the same group."""
    rank: int = 0
    """Order in which columns leave a table that is too wide for a terminal, the largest first; 0 for one that stays."""
    leaves: Literal["out", "below"] = "out"
    """Place of the column after it has left: none, or a line below its row."""
    wraps: bool = False
    """Whether a narrow terminal wraps the words of the column at spaces."""
    is_detail: bool = False
    """Whether only a whole answer shows the column."""

    @property
    def name(self) -> str:
        """Name of the column in a sentence."""
        return " ".join(filter(None, (self.group, self.heading or self.unit)))


class TableRow(NamedTuple):
    """A row of a table."""

    cells: tuple[Cell, ...]
    level: int = 0
    """Level of the row: 1 for a part of the row above it that has level 0."""
    highlighted: bool = False
    """Whether the row is bold, to be read first."""
    is_detail: bool = False
    """Whether only a whole answer shows the row."""


class Table(NamedTuple):
    """A table."""

    columns: tuple[TableColumn, ...]
    rows: tuple[TableRow, ...]
    caption: Sentence | None = None
    stacks: bool = False
    """Whether a narrow screen shows each row as a list of its cells, because nobody compares them down a column."""
    heads: int = 1
    """Number of first columns that name a row. They are repeated where a narrow terminal continues the table below."""


class Chart(NamedTuple):
    """A drawing with a caption."""

    drawing: Drawing
    caption: Sentence
    legend: Sentence | None = None
    """Advice on reading the SVG, after the caption."""


class Snippet(NamedTuple):
    """Lines of TOML for the reader to copy into a file."""

    lines: tuple[str, ...]


class CalculationStep(NamedTuple):
    """A step of a derivation: symbol = formula = numbers = result."""

    reference: str
    symbol: str
    formula: str
    numbers: str
    result: ShownValue | Words


class Calculation(NamedTuple):
    """A derivation."""

    steps: tuple[CalculationStep, ...]


class Gauge(NamedTuple):
    """Use of a period, in shares of it, 0..1."""

    used: float
    """Used share [1]; more than 1 if the period does not suffice."""
    doubt: float
    """Uncertainty of the used share [1]."""
    free_until: float
    """Share at which the reserve begins [1]."""
    most: float
    """Share that may be used, with the reserve [1]."""
    state: State

    def parts(self) -> "list[GaugePart]":
        """Parts of the period, in this order: used, in doubt, free, to stay free, other use."""
        ends = (self.used, self.used + self.doubt, self.free_until, self.most, 1.0)
        states: tuple[State, ...] = (self.state, "warns", "neutral", "neutral", "neutral")
        cut: list[GaugePart] = []
        for name, letter, end, state in zip(_GAUGE_PARTS, "#~.r ", ends, states, strict=True):
            start = cut[-1].end if cut else 0.0
            cut.append(GaugePart(name, letter, start, min(1.0, max(start, end)), state))
        return cut


_GAUGE_PARTS: Final = ("used", "doubt", "free", "reserve", "other")


class GaugePart(NamedTuple):
    """A part of a period."""

    name: str
    letter: str
    start: float
    """Start and end as shares of the period, 0..1 [1]."""
    end: float
    state: State


class Card(NamedTuple):
    """The first answer: subject, verdict, a bar of the period, and named lines."""

    subject: Sentence
    verdict: Words
    gauge: Gauge | None
    lines: tuple[tuple[str, Sentence], ...]
    details: tuple[tuple[str, Sentence], ...] = ()
    """Further lines that only a whole answer shows."""

    @property
    def whole(self) -> "Card":
        """The card with all its lines."""
        return self._replace(lines=(*self.lines, *self.details), details=())


class Slider(NamedTuple):
    """A choice of one value."""

    title: str
    values: tuple[str, ...]
    place: int
    """Index of the first value shown."""


class Explorer(NamedTuple):
    """The answer at every setting of two or three sliders.

    A page shows the sliders' one, other forms show the blocks.
    """

    sliders: tuple[Slider, ...]
    """Sliders along the rows and the columns of each map, and along the maps."""
    cards: tuple[tuple[Card | None, ...], ...]
    """Card of each cell, by map, row and column; None for an impossible setting."""
    first_card: Card
    """Card of the sliders' first places."""
    maps: tuple[Drawing, ...]
    """Maps, each with a frame around the cell of the sliders."""
    first_map: int
    """Index of the map shown first."""
    blocks: "tuple[Block, ...]"


class Detail(NamedTuple):
    """Blocks that only a whole answer shows."""

    blocks: "tuple[Block, ...]"
    adds: str = ""
    """Name of the blocks, for the last line of an answer without them; empty where nothing needs to be said."""
    instead: "tuple[Block, ...]" = ()
    """Blocks that other answers show in their place."""


class Chapter(NamedTuple):
    """Blocks under a title."""

    title: Sentence
    blocks: "tuple[Block, ...]"
    kind: str = ""
    """Name for the style sheet: the section has the CSS class `part-<kind>`."""
    key: str = ""
    """Anchor of links to the section; empty without links."""
    is_folded: bool = False
    """Whether a screen shows only the title until it is opened; print shows all."""


Block = Sentence | Table | Chart | Command | Snippet | Calculation | Card | Explorer | Detail | Chapter


class Report(NamedTuple):
    """An answer of plain values, ready for every form."""

    title: Sentence
    """Title of a page."""
    blocks: Sequence[Block]
    """Content for people."""
    document: Mapping[str, Any]
    """Content for JSON: plain data, not blocks."""
    records: Sequence[Record] | None = None
    """Rows for CSV; None if the answer is more than one table."""
    is_page: bool = False
    """Whether every form shows the title; other answers may be part of a page."""
    is_whole: bool = False
    """Whether details are shown, and a narrow terminal leaves out no column."""
    next_commands: tuple[Command, ...] = ()
    """Commands for the next questions."""
    whole_by: str = ""
    """Advice on seeing the details that tables leave out; empty in a file."""


def first_drawing(blocks: Sequence[Block]) -> Drawing | None:
    """First drawing of an answer; None without one."""
    for block in blocks:
        drawing = block.drawing if isinstance(block, Chart) else None
        if isinstance(block, Chapter | Detail | Explorer):
            drawing = first_drawing(block.blocks)
        if drawing is not None:
            return drawing
    return None


def sentence(template: str, *parts: Part, state: State = "neutral") -> Sentence:
    """A sentence from a template in which each {} stands for a part.

    Examples
    --------
    >>> sentence("Set {} first.", Code("bus.nodes")).parts
    ('Set ', Code(text='bus.nodes'), ' first.')
    """
    pieces = list(Formatter().parse(template))
    words = [piece[0] for piece in pieces]
    # The template may end in a part.
    words += [""] * (pieces[-1][1] is not None)
    woven: list[Part] = [words[0]]
    for part, behind in zip(parts, words[1:], strict=True):
        woven += [part, behind]
    return Sentence(tuple(part for part in woven if part != ""), state)


def joined(*sentences: Sentence, by: str = " ") -> Sentence:
    """Join sentences, or pieces of one, with a separator; the state is that of the first."""
    parts: list[Part] = []
    for words in sentences:
        parts += [by, *words.parts] if parts else words.parts
    return Sentence(tuple(parts), sentences[0].state)


def figure_value(figure: Figure, value: Any) -> ShownValue:
    """A value with the unit and decimals of its figure; False fails where True is better."""
    fails = figure.sort == "truth" and figure.better == "more" and value is False
    decimals = figure.decimals if figure.sort == "number" else None
    return ShownValue(
        value,
        figure.key,
        figure.column or figure.unit,
        decimals,
        state="fails" if fails else "neutral",
        hexadecimal=figure.is_hexadecimal,
    )


def attribute_value(figure: Figure, owner: object) -> ShownValue:
    """Value of a figure, from a mapping by key or from the attribute named `figure.key`."""
    value = owner[figure.key] if isinstance(owner, Mapping) else getattr(owner, figure.key)
    return figure_value(figure, value)


def count_value(value: float, key: str = "", *, grouped: bool = False) -> ShownValue:
    """A count, written without a unit."""
    return ShownValue(value, key, grouped=grouped)


def state_of(passes: object) -> State:
    """State of a result that passes or fails."""
    return "passes" if passes else "fails"
