"""The map of a profile: a sweep over two keys, with the verdict and its limit in each cell."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from math import isnan
from typing import Any, Final, Literal, NamedTuple, Protocol, TypeVar, get_args

from busplan.buses.parts import Value
from busplan.errors import BusplanError
from busplan.profile.toml import override
from busplan.progress import Progress
from busplan.questions.circle.roundness import circle_test
from busplan.questions.circle.setup import NOTHING, announce, estimate, setup
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS, NOT_SHOWN, TIME, VerdictWord
from busplan.questions.fit.circle_refusal import refusals
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.map.direction import (
    AXES,
    PERIOD,
    Direction,
    default_direction,
    nodes_with,
    own_value,
    profile_key,
)
from busplan.questions.sweep.blocks import sweep
from busplan.questions.sweep.grid import Grid, Listed
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
    """Limits that are broken; for a circle that fails, its failures; for a circle that cannot be run, the keys that
    prevent it; empty where the cell fits."""
    binding_term: str
    """The largest term of the cycle."""
    verdict: VerdictWord
    margin_corrected_us: float
    uncertainty_us: float | None
    """None where it is unknown."""
    is_safe: bool
    circle_refused_by: tuple[str, ...] = ()
    """Keys that prevent its circle test from running, whatever the state."""
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
    """Make a cell from its capacity alone, before any circle test.

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
    unsafe = tuple(
        limit.key for limit in bus_of(setting.profile).limits if limit.is_safety and limit.is_broken(network)
    )
    verdict = figures["verdict"]
    keys = figures["not_shown" if verdict == NOT_SHOWN else "exceeded"]
    broken = tuple(key for key in keys if key != TIME) or (TIME,)
    refused = tuple(figures["circle_refused_by"])
    state, limits = _state_and_limits(verdict, broken=broken, unsafe=unsafe, refused=refused)
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


def _state_and_limits(
    verdict: VerdictWord, *, broken: tuple[str, ...], unsafe: tuple[str, ...], refused: tuple[str, ...]
) -> tuple[State, tuple[str, ...]]:
    """State of a cell and what limits it; "does not fit" goes before "unsafe", and both before "fits"."""
    if verdict == DOES_NOT_FIT:
        return verdict, broken
    if unsafe:
        return "unsafe", unsafe
    if verdict != FITS:
        return verdict, broken
    return ("circle cannot be run", refused) if refused else (verdict, ())


_AT_ONCE: Final = 16
"""Circle tests between two reports of the progress."""

Place = tuple[int, int]
"""Row and column of a cell."""
Task = TypeVar("Task")
Result = TypeVar("Result")


class Mapper(Protocol):
    """The built-in `map`, here or in other processes."""

    def __call__(self, function: Callable[[Task], Result], tasks: Iterable[Task], /) -> Iterable[Result]:
        """Return the results in the order of the tasks."""


class _Task(NamedTuple):
    """The circle test of one setting; a process can be handed it."""

    profile: Profile
    changes: dict[str, object]


class _Judgement(NamedTuple):
    passed: bool | None
    failures: tuple[str, ...]


def _run_circle(task: _Task) -> _Judgement:
    (result,) = circle_test(override(task.profile, task.changes), explain=False).results
    return _Judgement(result.passed, tuple(failure.name for failure in result.failures))


def with_circles(
    profile: Profile,
    fitting: Mapping[Place, tuple[Cell, MapPoint]],
    *,
    mapper: Mapper,
    progress: Progress | None,
) -> dict[Place, Cell]:
    """Run the circle tests of cells that fit; a long run is announced first.

    Parameters
    ----------
    profile
        The network.
    fitting
        Cells and their settings.
    mapper
        How the tests are run.
    progress
        Called now and then with the tests that are done, and all of them.

    Returns
    -------
    dict
        The same cells, with what their circle says.
    """
    cost, runs = NOTHING, dict[Place, _Task]()
    cells = {place: cell for place, (cell, _) in fitting.items()}
    for place, (cell, setting) in fitting.items():
        # For a profile that asks for no circle, `cell_of` did not look for refusals.
        refused = tuple(cause.name for cause in refusals(setting.profile))
        if refused:
            cells[place] = cell._replace(state="circle cannot be run", limited_by=refused, circle_refused_by=refused)
        else:
            cost = cost.then(estimate((), [setup(setting.profile)]))
            runs[place] = _Task(profile, dict(setting.changes))
    announce(cost)
    places = list(runs)
    for start in range(0, len(places), _AT_ONCE):
        part = places[start : start + _AT_ONCE]
        for place, judgement in zip(part, mapper(_run_circle, [runs[place] for place in part]), strict=True):
            cells[place] = _with_circle(cells[place], judgement)
        if progress is not None:
            progress(start + len(part), len(places))
    return cells


def _with_circle(cell: Cell, judgement: _Judgement) -> Cell:
    cell = cell._replace(circle_passed=judgement.passed)
    if judgement.passed is False:
        return cell._replace(state="circle fails", limited_by=judgement.failures)
    return cell if judgement.passed else cell._replace(state="circle not judged")


MOST_CIRCLES: Final = 1000
"""Most circle tests of a map."""


class TradeOff(NamedTuple):
    """Answer of `map`: the verdict over two keys of a profile."""

    profile: Profile
    x: Direction
    y: Direction
    rows: tuple[tuple[Cell | NotDrawn, ...], ...]
    """A row for each value of `y`, a cell for each value of `x`."""
    with_circle: bool

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
        own_x, own_y = (own_value(direction.key, self.profile) for direction in (self.x, self.y))
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
    profile: Profile,
    *,
    x: Direction | None = None,
    y: Direction | None = None,
    with_circle: bool = False,
    mapper: Mapper = map,
    progress: Progress | None = None,
) -> TradeOff:
    """Tell where over two keys the cycle of a profile fits, and what limits it elsewhere.

    Each cell is what `capacity` says of the setting under the timing model that decides.

    Parameters
    ----------
    profile
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
    >>> result = trade_off(load("paper-4ms").profile, y=Direction("cycle.period_us", (500, 4000)))
    >>> [[cell.state for cell in row[:3]] for row in result.rows]
    [['fits', 'does not fit', 'does not fit'], ['fits', 'fits', 'fits']]
    """
    if x is None:
        is_free = y is None or profile_key(y.key, profile) != profile_key(AXES, profile)
        x = default_direction(AXES if is_free else PERIOD, profile, with_circle=with_circle)
    if y is None:
        y = default_direction(AXES if x.key == PERIOD else PERIOD, profile, with_circle=with_circle)
    key_x, key_y = (profile_key(direction.key, profile) for direction in (x, y))
    if key_x == key_y:
        raise BusplanError(f"x = {x.key} and y = {y.key} both vary {key_x}; give two keys")
    settings = {
        (row, column): _setting(profile, (x.key, value_x), (y.key, value_y))
        for row, value_y in enumerate(y.values)
        for column, value_x in enumerate(x.values)
    }
    points = {place: point for place, point in settings.items() if isinstance(point, MapPoint)}
    if not points:
        reason = next(value for value in settings.values() if not isinstance(value, MapPoint))
        raise BusplanError(f"no setting of this map can exist: {reason}")
    cells = {
        (row, column): cell_of(points[row, column], figures, x=x.values[column], y=y.values[row])
        for (row, column), figures in _swept(profile, points)
    }
    if with_circle:
        fitting = {place: (cell, points[place]) for place, cell in cells.items() if cell.state == "fits"}
        if len(fitting) > MOST_CIRCLES:
            raise BusplanError(
                f"{len(fitting):,} settings fit, and a map runs up to {MOST_CIRCLES:,} circle tests; give fewer values"
            )
        cells |= with_circles(profile, fitting, mapper=mapper, progress=progress)
    rows = tuple(
        tuple(
            cells[row, column] if (row, column) in cells else NotDrawn(value_x, value_y, str(settings[row, column]))
            for column, value_x in enumerate(x.values)
        )
        for row, value_y in enumerate(y.values)
    )
    return TradeOff(profile, x, y, rows, with_circle)


def _setting(profile: Profile, *along: tuple[str, Value]) -> MapPoint | str:
    """The profile at a point of the map, or why there is none."""
    changes: dict[str, Value] = {}
    try:
        # Axes come last: the number of nodes that they need may depend on the other value.
        for key, value in sorted(along, key=lambda key_value: key_value[0] == AXES):
            own = profile_key(key, profile)
            is_axes = key == AXES
            changes[own] = nodes_with(value, override(profile, dict(changes)), nodes_key=own) if is_axes else value
        return MapPoint(changes, override(profile, dict(changes)))
    except BusplanError as error:
        return error.problems[0]


def _swept(profile: Profile, settings: Mapping[Place, MapPoint]) -> Iterator[tuple[Place, Mapping[str, Any]]]:
    """Figures of each setting, from sweeps over grids of these settings alone."""
    places: dict[tuple[object, ...], Place] = {
        tuple(setting.changes.values()): place for place, setting in settings.items()
    }
    model = bus_of(profile).deciding_model
    for grid in _grids(settings.values()):
        for block in sweep(profile, grid, timing_models=[model], with_counts=False):
            for index in range(block.chunk.points):
                point = tuple(block.chunk.point(index).values())
                yield places[point], block.row(index, CELL_FIGURES)


def _grids(settings: Collection[MapPoint]) -> Iterator[Grid]:
    """Full grids that together have every setting once: lines with equal values along them share a grid."""
    across_key, along_key = next(iter(settings)).changes
    lines: dict[Value, list[Value]] = {}
    for point in settings:
        lines.setdefault(point.changes[across_key], []).append(point.changes[along_key])
    alike: dict[tuple[Value, ...], list[Value]] = {}
    for across, along in lines.items():
        alike.setdefault(tuple(along), []).append(across)
    for along_values, across_values in alike.items():
        yield Grid({across_key: Listed(tuple(across_values)), along_key: Listed(along_values)})
