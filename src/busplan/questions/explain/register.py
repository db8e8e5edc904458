"""Register of the figures of all commands for a kind of bus, by command and key."""

from collections.abc import Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Final, Literal

from busplan.buses.bus import Bus
from busplan.buses.figure import VERDICT_FIGURES, Figure, by_key
from busplan.errors import BusplanError
from busplan.questions.circle.figures import CIRCLE_BY_KEY

CommandName = Literal["latency", "capacity", "circle-test"]

_HOLDERS: Final[Mapping[str, tuple[CommandName, str]]] = MappingProxyType(
    {
        **dict.fromkeys(("changes", "circle_is_untested"), ("capacity", "cheapest_change")),
        **dict.fromkeys(("change", "key", "from", "to", "margin_change_us", "note"), ("capacity", "sensitivity")),
        **dict.fromkeys(
            (
                *("binding_term_us", "next_binding_term", "next_binding_term_us", "next_margin_corrected_us"),
                *("next_safe_nodes", "next_safe_limited_by"),
            ),
            ("capacity", "next_bottleneck"),
        ),
        **dict.fromkeys(("input", "label", "standard_uncertainty_us", "share"), ("capacity", "uncertainty_parts")),
        **dict.fromkeys(("name", "value", "limit", "limit_is_default"), ("circle-test", "failures")),
        **dict.fromkeys(("source", "removed_mm"), ("circle-test", "contributions")),
    }
)
"""Figure that contains a key, for keys inside a figure."""


def figures_of(bus: Bus) -> dict[CommandName, dict[str, Figure]]:
    """Figures by command and key. Without a command, a key means that of the first command that has it."""
    return {
        "capacity": by_key((*bus.figures.capacity, *VERDICT_FIGURES)),
        "latency": by_key(bus.figures.latency),
        "circle-test": dict(CIRCLE_BY_KEY),
    }


def figure_named(name: str, *, bus: Bus) -> tuple[CommandName, Figure]:
    """Find a figure by its name.

    Parameters
    ----------
    name
        A key ("required_us"), or a command and a key ("circle-test.required_us"). A key inside a figure ("removed_mm")
        means that figure.
    bus
        The kind of bus.

    Raises
    ------
    BusplanError
        There is none; the message suggests similar names.

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
