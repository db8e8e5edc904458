"""Every figure of every command for a kind of bus, by command and key."""

from collections.abc import Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Final, Literal

from busplan.analysis.circle.figures import CIRCLE_FIGURES
from busplan.buses.bus import Bus
from busplan.buses.figure import VERDICT_FIGURES, Figure, by_key
from busplan.errors import BusplanError

CommandName = Literal["latency", "capacity", "circle-test"]

_HOLDERS: Final[Mapping[str, tuple[CommandName, str]]] = MappingProxyType(
    {
        "changes": ("capacity", "cheapest_change"),
        **dict.fromkeys(("name", "value", "limit"), ("circle-test", "failures")),
        **dict.fromkeys(("source", "removed_mm"), ("circle-test", "contributions")),
    }
)
"""Keys that stand inside a figure, by that figure: they are derived with it."""


def figures_of(bus: Bus) -> dict[CommandName, dict[str, Figure]]:
    """Figures by command and key. A key that several commands give is the first one's, where no command is named."""
    return {
        "capacity": by_key((*bus.capacity_figures, *VERDICT_FIGURES)),
        "latency": by_key(bus.latency_figures),
        "circle-test": by_key(CIRCLE_FIGURES),
    }


def figure_named(name: str, *, bus: Bus) -> tuple[CommandName, Figure]:
    """Find the figure that a name means.

    Parameters
    ----------
    name
        A key, as "required_us", or one with its command before it, as "circle-test.required_us". A key inside a figure,
        as "removed_mm", means that figure.
    bus
        The kind of bus.

    Raises
    ------
    BusplanError
        There is none; those that are spelt alike are named.

    Examples
    --------
    >>> from busplan.buses import kind_named
    >>> figure_named("latency.gaps_us", bus=kind_named("ieee1394"))[1].meaning
    'both gaps, after each transaction'
    """
    register = figures_of(bus)
    for command, figures in register.items():
        key = name.removeprefix(f"{command}.")
        if key in figures and name in (key, f"{command}.{key}"):
            return command, figures[key]
    before, _, inner = name.rpartition(".")
    held = _HOLDERS.get(inner)
    if held is not None and before in ("", held[0]):
        return held[0], register[held[0]][held[1]]
    known = [key for figures in register.values() for key in figures]
    close = get_close_matches(name.rpartition(".")[2], known, n=3, cutoff=0.5)
    hint = f", did you mean {' or '.join(dict.fromkeys(close))}" if close else ""
    raise BusplanError(f"{name or repr(name)}: no such figure{hint}? Without a figure, explain lists them all")
