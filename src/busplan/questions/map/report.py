"""Answer of `busplan map`."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import isclose
from types import MappingProxyType
from typing import Final, NamedTuple

from busplan.buses.figure import Ink
from busplan.buses.limits import Value
from busplan.english import nouns
from busplan.forms.blocks import (
    Block,
    Chart,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Swatch,
    Table,
    TableColumn,
    TableRow,
    count_value,
    joined,
    sentence,
)
from busplan.forms.blocks import State as Tone
from busplan.forms.charts import ChartCell, ChartGrid, Drawing, Entry, Panel, Ruler, choices, letters
from busplan.forms.numbers import period_value, sentence_text, with_unit
from busplan.questions.base.sentences import document, fields, with_profile
from busplan.questions.fit.certainty import TIME
from busplan.questions.fit.network import PERIOD, varied_nodes
from busplan.questions.map import AXES, Cell, Direction, NotDrawn, Region, State, TradeOff
from busplan.questions.sweep.digest import payload_sentences
from busplan.sections.profile import Profile

_DIGITS: Final = 6


class Look(NamedTuple):
    """How a state is drawn."""

    mark: str
    """Its character; a limit of the bus that is broken has a letter of its own."""
    ink: Ink
    tone: Tone
    """Its colour on a terminal."""


LOOKS: Final[Mapping[State, Look]] = MappingProxyType(
    {
        "fits": Look("#", "fits", "passes"),
        "circle fails": Look("%", "uneven", "fails"),
        "circle not judged": Look("+", "unjudged", "warns"),
        "circle cannot be run": Look("/", "refused", "fails"),
        "not shown to fit": Look("?", "unsure", "warns"),
        "unsafe": Look("!", "unsafe", "fails"),
        "does not fit": Look(".", "short", "neutral"),
    }
)
_BARRED: Final = Look("x", "barred", "neutral")
"""Of what does not fit in any time; its letter is that of the limit."""

Looks = Mapping[tuple[State, tuple[str, ...]], Look]
"""The look of each region, by its state and limits."""


def looks_of(trade_off: TradeOff) -> Looks:
    """Give each region of a map its look: that of its state, with a letter for each limit that no time helps.

    Parameters
    ----------
    trade_off
        The map.
    """
    looks = {(region.state, region.limited_by): LOOKS[region.state] for region in trade_off.regions}
    barred = [limits for state, limits in looks if state == "does not fit" and limits != (TIME,)]
    marks = zip(barred, letters(map("".join, barred)), strict=True)
    return looks | {("does not fit", limits): _BARRED._replace(mark=mark) for limits, mark in marks}


def look_of(cell: Cell, looks: Looks) -> Look:
    """Look of a cell."""
    return looks[cell.state, cell.limited_by]


def legend_of(trade_off: TradeOff, looks: Looks) -> Iterator[Entry]:
    """Explain each look; a letter names its limit.

    Parameters
    ----------
    trade_off
        The map.
    looks
        From `looks_of`.
    """
    for (state, limits), look in looks.items():
        limit = f": {' and '.join(limits)}" if look.ink == _BARRED.ink else ""
        yield Entry(look.ink, f"{state_words(state, trade_off)}{limit}", look.mark)


def state_words(state: State, trade_off: TradeOff) -> str:
    """Name of a state on a map."""
    if state == "unsafe":
        return f"unsafe {trade_off.network.bus.safety.setting}"
    return f"{state}, and the circle passes" if state == "fits" and trade_off.with_circle else state


def limit_words(region: Region | Cell, trade_off: TradeOff) -> str:
    """Limits that keep a region from fitting; empty where it fits."""
    words = " and ".join(region.limited_by)
    if region.limited_by != (TIME,):
        return words
    return f"{words}, largest term {trade_off.network.bus.figures.term_label(region.binding_term)}"


def title_of(direction: Direction, profile: Profile) -> str:
    """Name of a direction."""
    if direction.key == AXES:
        return f"axes ({varied_nodes(profile).nodes_key})"
    return "period" if direction.key == PERIOD else direction.key


def value_text(direction: Direction, value: Value) -> str:
    """Write a value of a direction in few characters: a period with its unit, any other in the unit of its key."""
    if isinstance(value, str | bool):
        return str(value).lower() if isinstance(value, bool) else value
    shown = period_value(value) if direction.key == PERIOD else ShownValue(value)
    return with_unit(shown._replace(digits=_DIGITS))


def setting_words(trade_off: TradeOff, cell: Cell) -> str:
    """Write the setting of a cell, as "8 axes, period 4 ms"."""
    return ", ".join(
        _along(direction, value, trade_off.profile)
        for direction, value in ((trade_off.x, cell.x), (trade_off.y, cell.y))
    )


def _along(direction: Direction, value: Value, profile: Profile) -> str:
    text = value_text(direction, value)
    return f"{text} axes" if direction.key == AXES else f"{title_of(direction, profile)} {text}"


def map_title(trade_off: TradeOff) -> str:
    """Quantities on the y and x axis: "period against axes"."""
    directions = (trade_off.y, trade_off.x)
    title = " against ".join(title_of(direction, trade_off.profile) for direction in directions)
    return title if all(map(_is_even, directions)) else f"{title}, in unequal steps"


def _is_even(direction: Direction) -> bool:
    """Whether the values are words, or numbers in equal steps."""
    values = [value for value in direction.values if not isinstance(value, str)]
    steps = [after - before for before, after in pairwise(values)]
    return len(values) < len(direction.values) or all(isclose(step, steps[0], rel_tol=1e-6) for step in steps)


def cell_words(trade_off: TradeOff, cell: Cell) -> str:
    """Say the setting of a cell, its state and its limit."""
    limit = limit_words(cell, trade_off)
    return f"{setting_words(trade_off, cell)}: {state_words(cell.state, trade_off)}{limit and f', {limit}'}"


def map_drawing(trade_off: TradeOff, *, title: str) -> Drawing:
    """Draw the verdict and its limit at each setting.

    Parameters
    ----------
    trade_off
        The map.
    title
        Its message in a sentence.
    """
    looks = looks_of(trade_off)
    legend = list(legend_of(trade_off, looks))
    own_row, own_column = trade_off.own_place or (None, None)
    if own_row is not None:
        legend.append(Entry("frame", "this design"))
    if trade_off.not_drawn:
        legend.append(Entry("blank", "blank: cannot exist"))
    grid = ChartGrid(
        _ruler(trade_off.x, trade_off.profile, own=own_column),
        _ruler(trade_off.y, trade_off.profile, own=own_row),
        tuple(tuple(_cell(trade_off, cell, looks) for cell in row) for row in trade_off.rows),
        tuple(legend),
        None if own_row is None or own_column is None else (own_column, own_row),
    )
    return Drawing(title, (Panel(grid),), has_characters=True)


def _ruler(direction: Direction, profile: Profile, *, own: int | None) -> Ruler:
    title = f"{title_of(direction, profile)}{'' if _is_even(direction) else ' in unequal steps'}"
    return choices(title, (value_text(direction, value) for value in direction.values), own=own)


def _cell(trade_off: TradeOff, cell: Cell | NotDrawn, looks: Looks) -> ChartCell | None:
    if isinstance(cell, NotDrawn):
        return None
    look = look_of(cell, looks)
    return ChartCell(look.ink, look.mark, cell_words(trade_off, cell), look.tone)


def map_report(trade_off: TradeOff) -> Report:
    """Report of `map`."""
    return Report(
        Sentence(("Map of ", Code(trade_off.profile.name))),
        tuple(_blocks(trade_off)),
        map_document(trade_off),
        with_profile(trade_off.profile.name, map_document(trade_off)["cells"]),
    )


def _blocks(trade_off: TradeOff) -> Iterator[Block]:
    """How much fits and whether this design does, the picture, and what limits each region."""
    yield headline(trade_off)
    yield from _remarks(trade_off)
    yield map_chart(trade_off)
    yield regions_table(trade_off)


def headline(trade_off: TradeOff) -> Sentence:
    """Say how many settings fit, and what this design does."""
    drawn, fitting = len(trade_off.cells), sum(cell.state == "fits" for cell in trade_off.cells)
    circle = " with a circle that passes" if trade_off.with_circle else ""
    counts = sentence(
        f"{{}}: {{}} of {{}} {nouns(drawn, 'setting')} are shown to fit{circle}.",
        Code(trade_off.profile.name),
        count_value(fitting),
        count_value(drawn),
    )
    own = trade_off.own
    if own is None:
        return joined(counts, Sentence(("This design is not on the map: it has other values.",)))
    limit = limit_words(own, trade_off)
    text = (
        f"This design ({setting_words(trade_off, own)}): {state_words(own.state, trade_off)}{limit and f', {limit}'}."
    )
    tone = LOOKS[own.state].tone
    return joined(Sentence(counts.parts, "fails" if tone == "neutral" else tone), Sentence((text,)))


def _remarks(trade_off: TradeOff) -> Iterator[Sentence]:
    """Say what is not drawn or not judged, and why."""
    missing = trade_off.not_drawn
    if missing:
        number = count_value(len(missing))
        yield sentence(f"{{}} {nouns(len(missing), 'setting')} cannot exist, as {missing[0].reason}.", number)
    if any(cell.state == "circle not judged" for cell in trade_off.cells):
        yield Sentence(
            ("Not every circle is judged: no contour tolerance is asked for, or no error source matters.",), "warns"
        )
    yield from payload_sentences(trade_off.profile, (trade_off.x.key, trade_off.y.key))


def map_chart(trade_off: TradeOff) -> Chart:
    """The picture, with how much fits and what lies along which direction."""
    fitting = sum(cell.state == "fits" for cell in trade_off.cells)
    marked = "" if trade_off.own is None else ", this design marked"
    caption = sentence(
        f"{{}} of {{}} settings fit, {map_title(trade_off)}{marked}", *_counts(fitting, len(trade_off.cells))
    )
    return Chart(map_drawing(trade_off, title=sentence_text(headline(trade_off))), caption)


def _counts(*numbers: int) -> tuple[ShownValue, ...]:
    return tuple(count_value(number) for number in numbers)


def regions_table(trade_off: TradeOff) -> Table:
    """How many cells each region has, and what limits it; the legend of the picture."""
    columns = (
        TableColumn("state", kind="words"),
        TableColumn("limited by", kind="words", wraps=True),
        TableColumn("settings"),
    )
    rows = (_region_row(trade_off, region) for region in trade_off.regions)
    return Table(columns, tuple(rows), Sentence(("What limits each region",)))


def _region_row(trade_off: TradeOff, region: Region) -> TableRow:
    look = looks_of(trade_off)[region.state, region.limited_by]
    name = Swatch(look.ink, look.mark, state_words(region.state, trade_off))
    cells = count_value(region.cells, "cells")
    return TableRow((name, limit_words(region, trade_off), cells))


def map_document(trade_off: TradeOff) -> JsonDocument:
    """Document of `busplan map --format json`."""
    return document(
        "map",
        profile=trade_off.profile.name,
        timing_model=trade_off.network.bus.deciding_model,
        x={"key": trade_off.x.key, "values": list(trade_off.x.values)},
        y={"key": trade_off.y.key, "values": list(trade_off.y.values)},
        with_circle=trade_off.with_circle,
        design=None if trade_off.own is None else _record(trade_off, trade_off.own),
        regions=[fields(region, *region._fields) for region in trade_off.regions],
        cells=[_record(trade_off, cell) for cell in trade_off.cells],
        not_drawn=[
            {trade_off.x.key: absent.x, trade_off.y.key: absent.y, "reason": absent.reason}
            for absent in trade_off.not_drawn
        ],
    )


def _record(trade_off: TradeOff, cell: Cell) -> Record:
    """A cell as plain data, its values under the keys of the directions, as in a row of a sweep."""
    safety = trade_off.network.bus.safety.figure
    return {
        trade_off.x.key: cell.x,
        trade_off.y.key: cell.y,
        **fields(cell, "nodes", "axes", "state", "limited_by", "binding_term", "verdict"),
        **fields(cell, "margin_corrected_us", "uncertainty_us"),
        **({} if safety is None else {safety.key: cell.is_safe}),
        **fields(cell, "circle_passed"),
    }
