"""What all drawings of a map say: names of states, limits, directions and values, and the mark of each region."""

from collections.abc import Mapping
from string import ascii_lowercase
from types import MappingProxyType
from typing import Final, NamedTuple

from busplan.buses.figure import Ink
from busplan.buses.parts import Value
from busplan.forms.blocks import ShownValue, Swatch
from busplan.forms.blocks import State as Tone
from busplan.forms.numbers import period_value, with_unit
from busplan.questions.fit.cycle import TIME
from busplan.questions.fit.network import bus_of, varied_nodes
from busplan.questions.map.cells import Cell, Region, State
from busplan.questions.map.direction import AXES, PERIOD, Direction
from busplan.questions.map.trade_off import TradeOff
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


def looks_of(found: TradeOff) -> Looks:
    """Give each region of a map its look: that of its state, with a letter for each limit that no time helps.

    Parameters
    ----------
    found
        The map.
    """
    looks: dict[tuple[State, tuple[str, ...]], Look] = {}
    taken: set[str] = set()
    for one in found.regions:
        looks[one.state, one.limited_by] = LOOKS[one.state]
        if one.state == "does not fit" and one.limited_by != (TIME,):
            letters = (letter for letter in "".join(one.limited_by) + ascii_lowercase if letter in ascii_lowercase)
            mark = next((letter for letter in letters if letter not in taken), _BARRED.mark)
            taken.add(mark)
            looks[one.state, one.limited_by] = _BARRED._replace(mark=mark)
    return looks


def look_of(cell: Cell, looks: Looks) -> Look:
    """Look of a cell."""
    return looks[cell.state, cell.limited_by]


def legend_of(found: TradeOff, looks: Looks) -> list[Swatch]:
    """Explain each mark of a map once; a letter names its limit.

    Parameters
    ----------
    found
        The map.
    looks
        From `looks_of`.
    """
    entries: dict[str, Swatch] = {}
    for (state, limits), look in looks.items():
        limit = f": {' and '.join(limits)}" if look.ink == _BARRED.ink else ""
        entries.setdefault(look.mark, Swatch(look.ink, look.mark, f"{state_words(state, found)}{limit}"))
    return list(entries.values())


def state_words(state: State, found: TradeOff) -> str:
    """Name of a state on a map."""
    if state == "unsafe":
        return f"unsafe {bus_of(found.profile).safety.setting}"
    return f"{state}, and the circle passes" if state == "fits" and found.with_circle else state


def limit_words(region: Region | Cell, profile: Profile) -> str:
    """What keeps a region from fitting; empty where it fits."""
    words = " and ".join(region.limited_by)
    if region.limited_by != (TIME,):
        return words
    return f"{words}, largest term {bus_of(profile).figures.term_label(region.binding_term)}"


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


def setting_words(found: TradeOff, cell: Cell) -> str:
    """Write the setting of a cell, as "8 axes, period 4 ms"."""
    return ", ".join(_along(one, value, found.profile) for one, value in ((found.x, cell.x), (found.y, cell.y)))


def _along(direction: Direction, value: Value, profile: Profile) -> str:
    text = value_text(direction, value)
    return f"{text} axes" if direction.key == AXES else f"{title_of(direction, profile)} {text}"


def map_title(found: TradeOff) -> str:
    """Say what lies along which direction."""
    return f"{title_of(found.y, found.profile)} up, {title_of(found.x, found.profile)} across"


def cell_words(found: TradeOff, cell: Cell) -> str:
    """Say the setting of a cell, its state and its limit."""
    limit = limit_words(cell, found.profile)
    return f"{setting_words(found, cell)}: {state_words(cell.state, found)}{limit and f', {limit}'}"
