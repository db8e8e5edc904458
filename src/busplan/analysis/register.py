"""Every figure of every command for a kind of bus, by command and key."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

from busplan.analysis.circle.figures import CIRCLE_FIGURES
from busplan.buses.bus import Bus
from busplan.buses.figure import VERDICT_FIGURES, Figure, by_key

Command = Literal["latency", "capacity", "circle-test"]

HOLDERS: Final[Mapping[str, tuple[Command, str]]] = MappingProxyType(
    {
        "changes": ("capacity", "cheapest_change"),
        **dict.fromkeys(("name", "value", "limit"), ("circle-test", "failures")),
        **dict.fromkeys(("source", "removed_mm"), ("circle-test", "contributions")),
    }
)
"""Keys that stand inside a figure, by that figure: they are derived with it."""


def figures_of(bus: Bus) -> dict[Command, dict[str, Figure]]:
    """Figures by command and key. A key that several commands give is the first one's, where no command is named."""
    return {
        "capacity": by_key((*bus.capacity_figures, *VERDICT_FIGURES)),
        "latency": by_key(bus.latency_figures),
        "circle-test": by_key(CIRCLE_FIGURES),
    }
