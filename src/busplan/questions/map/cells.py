"""A cell of a map: the verdict at one setting, and what limits it."""

from collections.abc import Mapping
from math import isnan
from typing import Any, Final, Literal, NamedTuple, get_args

from busplan.buses.parts import Value
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS, NOT_SHOWN, VerdictWord
from busplan.questions.fit.cycle import TIME
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.profile import Profile

State = Literal[
    "fits",
    "circle fails",
    "circle not judged",
    "circle cannot be run",
    "not shown to fit",
    "unsafe",
    "does not fit",
]
STATES: Final[tuple[State, ...]] = get_args(State)
"""In the order of reports."""
CELL_FIGURES: Final = (
    *("nodes", "axes", "verdict", "binding_term", "exceeded", "not_shown", "circle_refused_by"),
    *("margin_corrected_us", "uncertainty_us"),
)
"""Columns of a sweep that a cell is made of."""


class MapPoint(NamedTuple):
    """One combination of values that a profile can have."""

    changes: dict[str, Value]
    """New values by key of the profile."""
    profile: Profile
    """The profile with them."""


class Cell(NamedTuple):
    """The verdict at one setting."""

    x: Value
    y: Value
    nodes: int
    axes: int
    state: State
    limited_by: tuple[str, ...]
    """Limits that are broken; of a circle that fails, what it does not hold, and of one that cannot be run, the keys
    that refuse it; none where it fits."""
    binding_term: str
    """The largest term of the cycle."""
    verdict: VerdictWord
    margin_corrected_us: float
    uncertainty_us: float | None
    """None where nothing is known of it."""
    is_safe: bool
    circle_refused_by: tuple[str, ...] = ()
    """Keys for which its circle cannot be run, whatever the state."""
    circle_passed: bool | None = None
    """None where no circle was run, or no tolerance judges it."""


class NotDrawn(NamedTuple):
    """A combination of values that no profile can have."""

    x: Value
    y: Value
    reason: str


class Region(NamedTuple):
    """All cells of one state with one limit."""

    state: State
    limited_by: tuple[str, ...]
    binding_term: str | None
    """The largest term of the cycle, where time is the limit."""
    cells: int


def cell_of(setting: MapPoint, figures: Mapping[str, Any], *, x: Value, y: Value) -> Cell:
    """Make a cell before any circle.

    Parameters
    ----------
    setting
        The setting.
    figures
        `CELL_FIGURES` of a sweep at the setting, under the timing model that decides.
    x, y
        Values of the map's directions.
    """
    network = network_of(setting.profile)
    unsafe = tuple(one.key for one in bus_of(setting.profile).limits if one.is_safety and one.is_broken(network))
    verdict = figures["verdict"]
    keys = figures["not_shown" if verdict == NOT_SHOWN else "exceeded"]
    broken = tuple(key for key in keys if key != TIME) or (TIME,)
    refused = tuple(figures["circle_refused_by"])
    state, limits = _judged(verdict, broken=broken, unsafe=unsafe, refused=refused)
    return Cell(
        x=x,
        y=y,
        nodes=int(figures["nodes"]),
        axes=int(figures["axes"]),
        state=state,
        limited_by=limits,
        binding_term=figures["binding_term"],
        verdict=verdict,
        margin_corrected_us=figures["margin_corrected_us"],
        uncertainty_us=None if isnan(figures["uncertainty_us"]) else figures["uncertainty_us"],
        is_safe=not unsafe,
        circle_refused_by=refused,
    )


def _judged(
    verdict: VerdictWord, *, broken: tuple[str, ...], unsafe: tuple[str, ...], refused: tuple[str, ...]
) -> tuple[State, tuple[str, ...]]:
    """State and limits: what does not fit is never called unsafe, and what is unsafe never a fit."""
    if verdict == DOES_NOT_FIT:
        return verdict, broken
    if unsafe:
        return "unsafe", unsafe
    if verdict != FITS:
        return verdict, broken
    return ("circle cannot be run", refused) if refused else (verdict, ())
