"""What an answer is made of: sentences, tables, charts and commands, in sections.

A block says what there is, and never how it looks: a figure keeps its exact value, a state is said, not coloured. Each
form writes every block in its own way.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from string import Formatter
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

from busplan.buses.figure import Figure, Ink
from busplan.forms.lines import Line

BlockOrPart = TypeVar("BlockOrPart")
State = Literal["passes", "fails", "warns", "neutral"]
"""What something says of the plan."""
JsonDocument = dict[str, Any]
Record = dict[str, Any]
"""One row of plain data, by column."""


class ShownValue(NamedTuple):
    """One figure: exact, with what it takes to write it."""

    value: Any
    """As the JSON document has it; None where there is none."""
    key: str = ""
    """Its key, in the register of figures and in JSON; its end says the unit of the value."""
    unit: str = ""
    """Unit to write it in: "um" for a key in mm, "%" for a share."""
    decimals: int | None = None
    """Decimals of a number; None for as many as it has."""
    signed: bool = False
    """Whether a plus is written, too."""
    at: str = ""
    """Place in the answer's JSON document (RFC 6901); empty where it has none."""
    state: State = "neutral"
    command: str = ""
    """Id of the `Command` whose document that is, where the answer holds several."""
    digits: int | None = None
    """Significant digits of a number without `decimals`; None for as many as it has."""
    fixed: bool = False
    """Whether what is too small for `decimals` is rounding, and written as zero."""
    grouped: bool = False
    """Whether commas part its thousands."""


class Words(NamedTuple):
    """Words with a state."""

    text: str
    state: State = "neutral"


class Code(NamedTuple):
    """Words of a file, a shell or a user, as they are."""

    text: str


class SectionLink(NamedTuple):
    """A name that leads to a section."""

    text: str
    key: str
    """Key of the section."""
    origin: str
    """Where it is from, as a shell takes it: names may be the same."""


class Swatch(NamedTuple):
    """A part of the time: its colour, its letter or mark, and what it is called."""

    ink: Ink
    letter: str
    text: str


class Bar(NamedTuple):
    """A value as a bar on a scale that it shares with the rows above and below; zero is on the scale."""

    value: ShownValue
    least: float
    most: float


class Command(NamedTuple):
    """A command, as a shell takes it."""

    line: str
    purpose: str = ""
    """What it gives, in a few words."""
    key: str = ""
    """Id that values refer to."""


Part = str | ShownValue | Code
"""A piece of a sentence."""


class Sentence(NamedTuple):
    """Words with figures between them, one sentence or a few that belong together."""

    parts: tuple[Part, ...]
    state: State = "neutral"


Cell = str | ShownValue | Words | Code | SectionLink | Swatch | Bar | Command | Sentence


class TableColumn(NamedTuple):
    """A column of a table."""

    heading: str
    unit: str = ""
    kind: Literal["words", "figures", "drawing"] = "figures"
    group: str = ""
    """What stands above it and its neighbours of the same group."""


class TableRow(NamedTuple):
    """A row of a table."""

    cells: tuple[Cell, ...]
    level: int = 0
    """1 for a part of the row above it."""
    highlighted: bool = False
    """Whether it is the row that a reader looks for."""


class Table(NamedTuple):
    """A table."""

    columns: tuple[TableColumn, ...]
    rows: tuple[TableRow, ...]
    caption: Sentence | None = None
    stacks: bool = False
    """Whether its rows are read one by one: nobody compares them down a column."""


class Facts(NamedTuple):
    """Figures with their names, in a row."""

    items: tuple[tuple[str, ShownValue | Code], ...]


class Drawing(ABC):
    """What a chart shows, drawn in the ways that it has; None in a way that it has not."""

    stylesheet: ClassVar[str] = ""
    """Style of its SVG, once a page."""
    shape: ClassVar[Literal["wide", "round"]] = "wide"

    @abstractmethod
    def svg(self) -> str | None:
        """Draw it as markup that fills the width of its place."""

    def characters(self, width: int) -> list[Line] | None:  # noqa: ARG002 - not every drawing has this way
        """Draw it in characters, in so many columns."""
        return None

    def mermaid(self) -> str | None:
        """Write it for Mermaid."""
        return None


class Chart(NamedTuple):
    """A drawing with what it shows in words."""

    drawing: Drawing
    caption: Sentence
    legend: Sentence | None = None
    """How its SVG is read, behind the caption; where it is drawn in characters, they say it themselves."""


class Snippet(NamedTuple):
    """Lines to copy into a file."""

    lines: tuple[str, ...]
    language: str = "toml"


class CalculationStep(NamedTuple):
    """One step of a derivation: symbol = formula = numbers = result."""

    reference: str
    symbol: str
    formula: str
    numbers: str
    result: ShownValue | Words


class Calculation(NamedTuple):
    """A derivation."""

    steps: tuple[CalculationStep, ...]


class Question(NamedTuple):
    """A question with its answer in a word, why, and the figures to look at first."""

    question: str
    answer: Words
    sentences: tuple[Sentence, ...]
    facts: Facts
    at: str = ""
    """Place of the sentences, joined, in the JSON document; empty where they have none."""
    command: str = ""
    """As for `ShownValue`."""


class Chapter(NamedTuple):
    """Blocks under a title."""

    title: Sentence
    blocks: "tuple[Block, ...]"
    kind: str = ""
    """What it is about, for a style sheet."""
    key: str = ""
    """Its name on a page, where a link leads to it."""


Block = Sentence | Facts | Table | Chart | Command | Snippet | Calculation | Question | Chapter


class Report(NamedTuple):
    """An answer, ready for every form; each part is made when a form asks for it."""

    title: Sentence
    """Heading of a page."""
    blocks: Callable[[], Sequence[Block]]
    """For people."""
    document: Callable[[], Mapping[str, Any]]
    """For JSON: the record, and not the blocks."""
    records: Callable[[], Sequence[Record]] | None = None
    """For CSV: the rows of the record; None where they are no one table."""
    is_page: bool = False
    """Whether it is a page of its own, whose title stands in every form; other answers may be part of one."""


def sentence(template: str, *parts: Part, state: State = "neutral") -> Sentence:
    """Put figures into words.

    Parameters
    ----------
    template
        The words, with {} for each part.
    parts
        What stands there.
    state
        What it says of the plan.

    Examples
    --------
    >>> sentence("Set {} first.", Code("bus.nodes")).parts
    ('Set ', Code(text='bus.nodes'), ' first.')
    """
    pieces = list(Formatter().parse(template))
    words = [piece[0] for piece in pieces]
    # Behind the last part there may be no words.
    words += [""] * (pieces[-1][1] is not None)
    found: list[Part] = [words[0]]
    for part, behind in zip(parts, words[1:], strict=True):
        found += [part, behind]
    return Sentence(tuple(one for one in found if one != ""), state)


def joined(*sentences: Sentence, by: str = " ") -> Sentence:
    """Put sentences, or pieces of one, behind one another; the state is that of the first."""
    parts: list[Part] = []
    for one in sentences:
        parts += [by, *one.parts] if parts else one.parts
    return Sentence(tuple(parts), sentences[0].state)


def figure_value(figure: Figure, value: Any, *, at: str = "") -> ShownValue:
    """A value of a registered figure, as tables write it; a truth that should be and is not fails."""
    fails = figure.sort == "truth" and figure.better == "more" and value is False
    decimals = figure.decimals if figure.sort == "number" else None
    return ShownValue(
        value, figure.key, figure.column or figure.unit, decimals, at=at, state="fails" if fails else "neutral"
    )


def attribute_value(figure: Figure, owner: object, *, at: str) -> ShownValue:
    """The value that an owner has of a registered figure, under its key.

    Parameters
    ----------
    figure
        The figure.
    owner
        What has it as an attribute.
    at
        Place of the owner in the JSON document.
    """
    return figure_value(figure, getattr(owner, figure.key), at=f"{at}/{figure.key}")


def count_value(value: float, key: str = "", *, at: str = "", grouped: bool = False) -> ShownValue:
    """A number of things."""
    return ShownValue(value, key, at=at, grouped=grouped)


def state_of(passes: object) -> State:
    """State of what passes or fails."""
    return "passes" if passes else "fails"


def values_in(item: object) -> Iterator[ShownValue]:
    """Every figure of a block, or of several, in reading order."""
    if isinstance(item, ShownValue):
        yield item
    elif isinstance(item, tuple):
        for one in item:
            yield from values_in(one)


def with_values(item: BlockOrPart, change: Callable[[ShownValue], ShownValue]) -> BlockOrPart:
    """Copy a block with every figure of it changed.

    Parameters
    ----------
    item
        The block, or what it is made of.
    change
        From a figure to the one in its place.
    """
    if isinstance(item, ShownValue):
        return change(item)  # type: ignore[return-value]
    if not isinstance(item, tuple):
        return item
    parts = [with_values(one, change) for one in item]
    return item._make(parts) if hasattr(item, "_make") else tuple(parts)  # type: ignore[return-value]
