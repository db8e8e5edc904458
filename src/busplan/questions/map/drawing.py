"""The picture of a map: names and marks of its cells."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import isclose
from types import MappingProxyType
from typing import Final, NamedTuple

from busplan.buses.figure import Ink
from busplan.buses.parts import Value
from busplan.forms.blocks import ShownValue
from busplan.forms.blocks import State as Tone
from busplan.forms.charts import Cell as ChartCell
from busplan.forms.charts import Drawing, Entry, Grid, Panel, Ruler, choices, letters
from busplan.forms.numbers import period_value, with_unit
from busplan.questions.fit.certainty import TIME
from busplan.questions.fit.network import PERIOD, varied_nodes
from busplan.questions.map.direction import AXES, Direction
from busplan.questions.map.trade_off import Cell, NotDrawn, Region, State, TradeOff
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
    grid = Grid(
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
