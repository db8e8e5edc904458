"""The map of a profile: a sweep over two keys, with the verdict and its limit in each cell."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import isnan
from typing import Any, Final, Literal, NamedTuple, get_args

from busplan.buses.network import Network
from busplan.buses.parts import Value
from busplan.errors import BusplanError
from busplan.progress import Progress, ignored
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS, NOT_SHOWN, TIME, VerdictWord
from busplan.questions.fit.circle_refusal import refusals
from busplan.questions.fit.network import PERIOD, changed
from busplan.questions.map.direction import (
    AXES,
    Direction,
    default_direction,
    nodes_with,
    own_value,
    profile_key,
)
from busplan.questions.sweep.circles import MOST_CIRCLES_UNASKED, CircleOutcome, Mapper, Point, circle_outcomes
from busplan.questions.sweep.grid import Grid, axis_of
from busplan.questions.sweep.table import figure_table
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
    *("nodes", "axes", "verdict", "binding_term", "exceeded", "not_shown"),
    *("margin_corrected_us", "uncertainty_us"),
)
"""Columns of a sweep that a cell is made of."""


class Cell(NamedTuple):
    """The verdict at one setting."""

    x: Value
    y: Value
    nodes: int
    axes: int
    state: State
    limited_by: tuple[str, ...]
    """Limits that are broken; for a circle that fails, its failures; for a circle that cannot be run, the keys that
    prevent it; empty where the cell fits."""
    binding_term: str
    """The largest term of the cycle."""
    verdict: VerdictWord
    margin_corrected_us: float | None
    """None of messages alone."""
    uncertainty_us: float | None
    """None where it is unknown."""
    is_safe: bool
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


def cell_of(network: Network, figures: Mapping[str, Any], *, x: Value, y: Value) -> Cell:
    """Make a cell from its capacity alone, before any circle test.

    Parameters
    ----------
    network
        The network at the setting.
    figures
        `CELL_FIGURES` of a sweep at the setting, under the timing model that decides.
    x, y
        Values of the map's directions.
    """
    unsafe = tuple(limit.key for limit in network.bus.limits if limit.role == "safety" and limit.is_broken(network))
    verdict: VerdictWord = figures["verdict"]
    state: State = verdict
    limits: tuple[str, ...] = ()
    # "Does not fit" goes before "unsafe", and both before "not shown".
    if unsafe and verdict != DOES_NOT_FIT:
        state, limits = "unsafe", unsafe
    elif verdict != FITS:
        keys = figures["not_shown" if verdict == NOT_SHOWN else "exceeded"]
        limits = tuple(key for key in keys if key != TIME) or (TIME,)
    return Cell(
        x=x,
        y=y,
        **{name: figures[name] for name in ("nodes", "axes", "binding_term", "verdict")},
        state=state,
        limited_by=limits,
        margin_corrected_us=_known(figures["margin_corrected_us"]),
        uncertainty_us=_known(figures["uncertainty_us"]),
        is_safe=not unsafe,
    )


def _known(number: float) -> float | None:
    return None if isnan(number) else number


def _with_circle(cell: Cell, outcome: CircleOutcome) -> Cell:
    cell = cell._replace(circle_passed=outcome.passed)
    if outcome.passed is False:
        return cell._replace(state="circle fails", limited_by=outcome.failures)
    return cell if outcome.passed else cell._replace(state="circle not judged")


Place = tuple[int, int]
"""Row and column of a cell."""


class TradeOff(NamedTuple):
    """Answer of `map`: the verdict over two keys of a profile."""

    network: Network
    x: Direction
    y: Direction
    rows: tuple[tuple[Cell | NotDrawn, ...], ...]
    """A row for each value of `y`, a cell for each value of `x`."""
    with_circle: bool

    @property
    def profile(self) -> Profile:
        """The profile of the network."""
        profile: Profile = self.network.profile
        return profile

    @property
    def cells(self) -> tuple[Cell, ...]:
        """Cells that are drawn, row by row."""
        return tuple(cell for row in self.rows for cell in row if isinstance(cell, Cell))

    @property
    def not_drawn(self) -> tuple[NotDrawn, ...]:
        """Combinations of values that no profile can have, row by row."""
        return tuple(cell for row in self.rows for cell in row if isinstance(cell, NotDrawn))

    @property
    def own_place(self) -> Place | None:
        """Row and column of the profile's own setting; None if it is not on the map."""
        own_x, own_y = (own_value(direction.key, self.network) for direction in (self.x, self.y))
        if own_x not in self.x.values or own_y not in self.y.values:
            return None
        return self.y.values.index(own_y), self.x.values.index(own_x)

    @property
    def own(self) -> Cell | None:
        """Cell of the profile's own setting; None if it is not on the map."""
        if self.own_place is None:
            return None
        row, column = self.own_place
        cell = self.rows[row][column]
        return cell if isinstance(cell, Cell) else None

    @property
    def regions(self) -> tuple[Region, ...]:
        """Cells by state and limit: the states in the order of `STATES`, of each the largest region first."""
        counts = Counter(map(_region, self.cells))
        regions = [region._replace(cells=number) for region, number in counts.items()]
        return tuple(sorted(regions, key=lambda region: (STATES.index(region.state), -region.cells)))


def _region(cell: Cell) -> Region:
    is_time = cell.limited_by == (TIME,)
    return Region(cell.state, cell.limited_by, cell.binding_term if is_time else None, 0)


def trade_off(
    network: Network,
    *,
    x: Direction | None = None,
    y: Direction | None = None,
    with_circle: bool = False,
    mapper: Mapper = map,
    progress: Progress = ignored,
) -> TradeOff:
    """Tell where over two keys the cycle of a profile fits, and what limits it elsewhere.

    Each cell is what `capacity` says of the setting under the timing model that decides.

    Parameters
    ----------
    network
        The network.
    x, y
        Quantities on the x and y axis, each a key with its values, from `checked_direction`. By default the axes of all
        nodes, and the period.
    with_circle
        Run the circle test of every cell that fits.
    mapper
        How circle tests are run: the built-in `map`, or one that uses other processes.
    progress
        Called now and then with the circle tests that are done, and all of them.

    Returns
    -------
    TradeOff
        Rows of cells; combinations of values that no profile can have are no cells.

    Raises
    ------
    BusplanError
        Both directions are one key, no setting can exist, or there would be too many circle tests.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> from busplan.questions.fit.network import network_of
    >>> result = trade_off(network_of(load("paper-4ms").profile), y=Direction("cycle.period_us", (500, 4000)))
    >>> [[cell.state for cell in row[:3]] for row in result.rows]
    [['fits', 'does not fit', 'does not fit'], ['fits', 'fits', 'fits']]
    """
    profile = network.profile
    if x is None:
        is_free = y is None or profile_key(y.key, profile) != profile_key(AXES, profile)
        x = default_direction(AXES if is_free else PERIOD, network)
    if y is None:
        y = default_direction(AXES if x.key == PERIOD else PERIOD, network)
    key_x, key_y = (profile_key(direction.key, profile) for direction in (x, y))
    if key_x == key_y:
        raise BusplanError(f"x = {x.key} and y = {y.key} both vary {key_x}; give two keys")
    settings = {
        (row, column): _setting(network, (x.key, value_x), (y.key, value_y))
        for row, value_y in enumerate(y.values)
        for column, value_x in enumerate(x.values)
    }
    possible = {place: setting for place, setting in settings.items() if isinstance(setting, _Setting)}
    if not possible:
        raise BusplanError(f"no setting of this map can exist: {next(iter(settings.values()))}")
    figures = dict(_swept(network, [setting.changes for setting in possible.values()]))
    cells = {
        (row, column): cell_of(setting.network, figures[setting.values], x=x.values[column], y=y.values[row])
        for (row, column), setting in possible.items()
    }
    if with_circle:
        fitting = [place for place, cell in cells.items() if cell.state == "fits"]
        if len(fitting) > MOST_CIRCLES_UNASKED:
            raise BusplanError(
                f"{len(fitting):,} settings fit, and a map runs up to {MOST_CIRCLES_UNASKED:,} circle tests; "
                "give fewer values"
            )
        refused = {place: tuple(cause.name for cause in refusals(possible[place].network)) for place in fitting}
        for place in [place for place in fitting if refused[place]]:
            cells[place] = cells[place]._replace(state="circle cannot be run", limited_by=refused[place])
            fitting.remove(place)
        points = [possible[place].changes for place in fitting]
        outcomes = circle_outcomes(profile, points, mapper=mapper, progress=progress)
        cells |= {place: _with_circle(cells[place], outcome) for place, outcome in zip(fitting, outcomes, strict=True)}
    rows = tuple(
        tuple(
            cells[row, column] if (row, column) in cells else NotDrawn(value_x, value_y, str(settings[row, column]))
            for column, value_x in enumerate(x.values)
        )
        for row, value_y in enumerate(y.values)
    )
    return TradeOff(network, x, y, rows, with_circle)


class _Setting(NamedTuple):
    """One combination of values that a profile can have."""

    changes: Point
    """New values by key of the profile."""
    network: Network
    """The network with them."""

    @property
    def values(self) -> tuple[object, ...]:
        """The new values."""
        return tuple(self.changes.values())


def _setting(network: Network, *along: tuple[str, Value]) -> _Setting | str:
    """The network at a point of the map, or why there is none."""
    changes: Point = {}
    try:
        # Axes come last: the number of nodes that they need may depend on the other value.
        for key, value in sorted(along, key=lambda key_value: key_value[0] == AXES):
            own = profile_key(key, network.profile)
            changes[own] = nodes_with(value, changed(network, changes), nodes_key=own) if key == AXES else value
        return _Setting(changes, changed(network, changes))
    except BusplanError as error:
        return error.problems[0]


def _swept(network: Network, points: Sequence[Point]) -> Iterator[tuple[tuple[object, ...], dict[str, Any]]]:
    """Values of each point, with its figures from a sweep over a grid that has no other points."""
    for grid in _grids(points):
        table = figure_table(network, grid, timing_models=[network.bus.deciding_model], with_counts=False)
        rows = zip(*(table[name].tolist() for name in CELL_FIGURES), strict=True)
        for point, row in zip(grid.each_point(), rows, strict=True):
            yield tuple(point.values()), dict(zip(CELL_FIGURES, row, strict=True))


def _grids(points: Sequence[Point]) -> Iterator[Grid]:
    """Full grids that together have every point once: lines with equal values along them share a grid."""
    across_key, along_key = points[0]
    lines: dict[Any, list[Any]] = {}
    for point in points:
        lines.setdefault(point[across_key], []).append(point[along_key])
    alike: dict[tuple[Any, ...], list[Any]] = {}
    for across, along in lines.items():
        alike.setdefault(tuple(along), []).append(across)
    for along_values, across_values in alike.items():
        yield Grid({across_key: axis_of(across_values), along_key: axis_of(along_values)})
