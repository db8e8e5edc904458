"""`busplan.map_`."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from math import ceil, isnan
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np

from busplan.buses.limits import Value
from busplan.buses.network import Network
from busplan.elementwise import FIT_ROUNDING, plain
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.scale import round_numbers
from busplan.profile.edit import whole
from busplan.progress import Progress, ignored
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import ProfileLike, load_network, with_cycle
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS, NOT_SHOWN, TIME, VerdictWord, certainty
from busplan.questions.fit.circle_refusal import refusals
from busplan.questions.fit.figures import safe_nodes, shortest_period_us
from busplan.questions.fit.network import PERIOD, at_period, changed, varied_nodes
from busplan.questions.sweep import axis_values
from busplan.questions.sweep.circles import (
    MOST_CIRCLES_UNASKED,
    CircleOutcome,
    Mapper,
    Point,
    circle_outcomes,
    mapper_of,
)
from busplan.questions.sweep.grid import Array, Grid, axis_of, require_keys
from busplan.questions.sweep.table import figure_table
from busplan.sections.base import MAX_COUNT, MAX_TIME_US, MIN_STEP_US, value_at
from busplan.sections.profile import Profile

AXES: Final = "axes"
"""Key of the direction along the axes of all nodes. No key of a profile: it sets the number of nodes."""
MOST_VALUES: Final = 64
"""Most values of a direction, as many as gap counts: more do not fit into 80 columns."""


class Direction(NamedTuple):
    """One direction of a map."""

    key: str
    """Dotted key of the profile, or `AXES`."""
    values: tuple[Value, ...]
    """In the unit of the key; numbers ascend."""


def profile_key(key: str, profile: Profile) -> str:
    """Key of the profile that a direction sets."""
    return varied_nodes(profile).nodes_key if key == AXES else key


def nodes_with(axes: Value, network: Network, *, nodes_key: str) -> int:
    """Number of nodes with which all nodes have so many axes [1].

    Parameters
    ----------
    axes
        Axes of all nodes [1].
    network
        The network, with the other direction's value.
    nodes_key
        Dotted key of the number.

    Raises
    ------
    BusplanError
        No whole number of nodes has so many axes.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> from busplan.questions.fit.network import network_of
    >>> nodes_with(12, network_of(load("paper-4ms").profile), nodes_key="bus.nodes")
    3
    """
    alike = next(alike for alike in network.profile.node_groups if alike.nodes_key == nodes_key)
    node_axes = int(alike.node.axes)
    axes_beside = int(plain(network.axes)) - int(alike.nodes) * node_axes
    own = axes - axes_beside if isinstance(axes, int) else 0
    if own < max(node_axes, 1) or not node_axes or own % node_axes:
        beside = f" beside {axes_beside} others" if axes_beside else ""
        raise BusplanError(f"axes = {axes}: no whole number of nodes, with {node_axes} axes each{beside}")
    return own // node_axes


def own_value(key: str, network: Network) -> Any:
    """The profile's own value along a direction; None if it has none."""
    return int(plain(network.axes)) if key == AXES else value_at(network.profile, key)


def checked_direction(
    profile: Profile, key: str, values: Array, *, option: str, circle_option: str | None = None
) -> Direction:
    """Make a direction after checking its key and how many values it has.

    The values are not checked: a setting that the profile's schema refuses is not drawn.

    Parameters
    ----------
    profile
        The network.
    key
        Dotted key of the profile, or `AXES`.
    values
        Its values.
    option
        Option or key that gives them, for messages.
    circle_option
        Option or key that asks for circle tests, for messages; None where they are run.

    Raises
    ------
    BusplanError
        A key that is unknown, not a number, or without effect here; too many values.
    """
    if key != AXES:
        require_keys(profile, [key], option=option, circle_option=circle_option)
    if values.size > MOST_VALUES:
        raise BusplanError(
            f"{option} {key}: {values.size:,} values; a map shows up to {MOST_VALUES} of a key. A sweep takes more"
        )
    numbers = [whole(value) for value in values.tolist()]
    return Direction(key, tuple(numbers if values.dtype == object else sorted(numbers)))


_FACTORS: Final = ((1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8), (1, 2, 5), (1,))
"""Round numbers of a decade, the finest choice first."""
_MOST: Final = 20
"""Most values of a direction, but for the profile's own."""
_BEYOND: Final = 2
"""Nodes drawn beyond the most that fit."""


def default_direction(key: str, network: Network) -> Direction:
    """Choose the values of `AXES` or of `PERIOD` about what fits.

    Parameters
    ----------
    key
        `AXES` or `PERIOD`.
    network
        The network.
    """
    varied = varied_nodes(network.profile)
    own_us, own_nodes = network.profile.cycle.period_us, int(varied.nodes)
    # A cycle of no node that fits shows the own period alone.
    fit_us = _periods_of_nodes(network, varied.name) or [own_us]
    to_us = max(2 * own_us, 1.25 * fit_us[min(own_nodes, len(fit_us)) - 1], min(4 * own_us, 1.25 * fit_us[-1]))
    from_us = min(own_us, fit_us[0], to_us / 4) / 1.25
    if key == AXES:
        most = bisect_right(fit_us, to_us * (1 + FIT_ROUNDING))
        counts, node_axes = _counts(own_nodes, most), int(varied.node.axes)
        if not node_axes:  # nodes without axes are counted themselves
            return Direction(varied.nodes_key, counts)
        axes_beside = own_value(AXES, network) - own_nodes * node_axes
        return Direction(AXES, tuple(axes_beside + count * node_axes for count in counts))
    least_us, most_us = max(from_us, MIN_STEP_US), min(to_us, MAX_TIME_US)
    known = [known_us for known_us in network.bus.periods.us if least_us <= known_us <= most_us]
    periods_us = (
        known[:: ceil(len(known) / _MOST)] if known else round_numbers(least_us, most_us, most=_MOST, decades=_FACTORS)
    )
    return Direction(PERIOD, tuple(sorted({*periods_us, own_us})))


def _periods_of_nodes(network: Network, group: str) -> list[float]:
    """Shortest periods at which 1, 2, ... nodes of a group are shown to fit; of no more than fit any period [us]."""
    bus = network.bus
    most, _ = safe_nodes(at_period(network, min(MAX_TIME_US, bus.periods.longest_us)), group=group)
    counts = np.arange(1, most + 1)
    cycle = bus.cycle(network.varying(group).with_nodes(counts), model=bus.deciding_model)
    needed_us = np.asarray(certainty(cycle).safe_required_us)
    periods_us = shortest_period_us(cycle.network, needed_us, is_shown=True)
    return [float(us) for us in np.broadcast_to(np.asarray(periods_us), counts.shape)]


def _counts(own: int, most: int) -> tuple[int, ...]:
    """Numbers of nodes, from one to some beyond the most that fit the longest period drawn.

    Steps of one size about this design, to twice its nodes; beyond, steps that grow.
    """
    last = min(max(own + 1, most + _BEYOND), MAX_COUNT)
    near = last if last <= _MOST else min(2 * own, last)
    most = _MOST if near == last else _MOST // 2
    step = next(size for size in (f * 10**p for p in range(7) for f in (1, 2, 5)) if near <= most * size)
    about = range(own % step or step, near + 1, step)
    beyond = round_numbers(near, last, most=_MOST - len(about), decades=_FACTORS) if near < last else []
    return tuple(sorted({1, *about, *(ceil(nodes) for nodes in beyond), last}))


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
    >>> from busplan.profile.sources import load
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


Along = Mapping[str, str | Iterable[object]]


class MapAnswer(Answer, TradeOff):
    """Answer of `map_`: where a design fits, which a notebook draws. Its `rows` have cells, or reasons for none."""

    __slots__ = ()

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.map.report import map_report

        return map_report(self)


def map_(
    profile: ProfileLike,
    *,
    x: Along | None = None,
    y: Along | None = None,
    circle: bool = False,
    progress: Progress = ignored,
    executor: Executor | None = None,
) -> MapAnswer:
    """Tell where over two keys a design fits, and what limits it elsewhere: `busplan map`.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    x, y
        Quantities on the x and the y axis: one dotted key, or "axes" for the axes of all nodes, with up to 64 values in
        its unit, as `sweep` takes them: {"bus.gap_count": [7, 63, "optimal"]}. By default the axes, and the period
        [us].
    circle
        Also run the circle test of every setting that fits, up to 1,000.
    progress
        With `circle`: called now and then with the circle tests that are done, and all of them [1].
    executor
        With `circle`: where the tests run; by default in this thread. Any `concurrent.futures.Executor` gives the same
        answer, and is not shut down. Worker processes must have this version of busplan.

    Returns
    -------
    MapAnswer
        Its `rows` have the shape (values of y, values of x). In a notebook it is a picture.

    Raises
    ------
    BusplanError
        Not a profile, an invalid key or values, no setting that can exist, or too many circle tests.
    Exception
        Anything that `executor` raises.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.map_("paper-4ms", x={"axes": range(4, 13, 4)}, y={"cycle.period_us": [500, 1000]})
    >>> [[cell.state for cell in row] for row in answer.rows]
    [['fits', 'does not fit', 'does not fit'], ['fits', 'fits', 'fits']]
    """
    mapper = mapper_of(executor, circle=circle)
    network = load_network(profile)
    if x is None or y is None:
        with_cycle(network.profile, question="a map of period and axes", instead="give x and y, each a key with values")
    return MapAnswer(
        *trade_off(
            network,
            x=_direction(network.profile, x, name="x", with_circle=circle),
            y=_direction(network.profile, y, name="y", with_circle=circle),
            with_circle=circle,
            mapper=mapper,
            progress=progress,
        )
    )


def _direction(profile: Profile, along: Along | None, *, name: str, with_circle: bool) -> Direction | None:
    if along is None:
        return None
    if not isinstance(along, Mapping) or len(along) != 1 or not all(isinstance(key, str) for key in along):
        raise BusplanError(f'{name} {along!r}: expected one key and its values, as {{"bus.nodes": range(1, 17)}}')
    ((key, values),) = along.items()
    return checked_direction(
        profile,
        key,
        axis_values(profile, key, values, name=name),
        option=name,
        circle_option=None if with_circle else "circle",
    )
