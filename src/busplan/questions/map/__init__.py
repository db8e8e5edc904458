"""`busplan.map_`: where does a design fit as two keys vary, and what limits it elsewhere?"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import product
from math import ceil, prod
from typing import Any, Final, Literal, NamedTuple, TypeVar, get_args

import numpy as np

from busplan.buses.figure import BusFigures
from busplan.buses.network import Network
from busplan.buses.parts import Safety, Value
from busplan.elementwise import FIT_ROUNDING
from busplan.errors import ArgumentError, BusplanError
from busplan.forms.blocks import Report
from busplan.forms.scale import round_numbers
from busplan.profile.edit import whole
from busplan.progress import Progress, ignored
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import ProfileLike, load_network, require_cycle, with_its_constants
from busplan.questions.circle import CircleFigures
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS, TIME, VerdictWord, certainty
from busplan.questions.fit.circle_setup import refusals
from busplan.questions.fit.figures import CycleFigures, FitFigures, shortest_period_us
from busplan.questions.fit.grid import AXES, Grid, GridPoint, GridPoints, fits_at, points_of, require_few_tables
from busplan.questions.fit.most_nodes import safe_nodes
from busplan.questions.fit.network import PERIOD, at_period
from busplan.questions.sweep import axis_values
from busplan.questions.sweep.circles import (
    MOST_CIRCLES_UNASKED,
    require_executor,
    run_points,
)
from busplan.questions.sweep.values import require_keys
from busplan.sections.base import MAX_COUNT, MAX_TIME_US, MIN_STEP_US, value_at
from busplan.sections.profile import Profile, varied_nodes

_Item = TypeVar("_Item")
MOST_VALUES: Final = 64
"""Most values of a direction, enough for every gap count of IEEE 1394: more do not fit into 80 columns."""

Along = Mapping[str, str | Iterable[object]]
"""One key, and its values as `sweep` takes them."""


class Direction(NamedTuple):
    """One direction of a map."""

    key: str
    """Dotted key of the profile, or `AXES`."""
    values: tuple[Value, ...]
    """Values in the unit of the key; numbers ascend."""


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
"""States in the order of reports."""


class Cell(NamedTuple):
    """The verdict at one setting."""

    x: Value
    y: Value | None
    """None where one key alone varies."""
    nodes: int
    axes: int
    state: State
    reasons: tuple[str, ...]
    """Limits that are broken, or not shown to be kept; of a circle, its failures or the keys that prevent its run;
    empty if the cell fits."""
    verdict: VerdictWord
    is_safe: bool
    binding_term: str | None = None
    """The largest term of the cycle. This and the three figures below are None for messages alone."""
    available_us: float | None = None
    margin_corrected_us: float | None = None
    uncertainty_us: float | None = None
    """None also where it is unknown."""
    circle_passed: bool | None = None
    """None if no circle was run, or the circle is not judged."""
    max_contour_error_mm: float | None = None
    """None if no circle was run."""


class NotDrawn(NamedTuple):
    """A combination of values that no profile can have."""

    x: Value
    y: Value | None
    reason: str


class Region(NamedTuple):
    """All cells of one state with one limit."""

    state: State
    reasons: tuple[str, ...]
    binding_term: str | None
    """The largest term of the cycle, where time is the limit."""
    cells: int


@dataclass(frozen=True, slots=True, repr=False)
class MapAnswer(Answer):
    """Answer of `map_`: where a design fits as two keys vary. A notebook shows it as a picture.

    Parameters
    ----------
    profile
        The profile itself: this design.
    bus_figures
        Figures of the kind of bus.
    safety
        Setting of the bus that is safe or not.
    timing_model
        The timing model of the verdicts: the one that decides.
    x, y
        The directions; y is None where one key alone varies.
    rows
        A row for each value of `y`, a cell for each value of `x`; one row without y.
    with_circle
        Whether the circle test of every cell that fits was run.
    """

    profile: Profile
    bus_figures: BusFigures
    safety: Safety
    timing_model: str
    x: Direction
    y: Direction | None
    rows: tuple[tuple[Cell | NotDrawn, ...], ...]
    with_circle: bool

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The directions: y before x, as a title names them."""
        return (self.x,) if self.y is None else (self.y, self.x)

    def values_at(self, cell: "Cell | NotDrawn") -> dict[str, Value]:
        """Values of a cell by the keys of the directions, x first."""
        return {self.x.key: cell.x} if self.y is None or cell.y is None else {self.x.key: cell.x, self.y.key: cell.y}

    @property
    def cells(self) -> tuple[Cell, ...]:
        """Cells that are drawn, row by row."""
        return tuple(cell for row in self.rows for cell in row if isinstance(cell, Cell))

    @property
    def not_drawn(self) -> tuple[NotDrawn, ...]:
        """Combinations of values that no profile can have, row by row."""
        return tuple(cell for row in self.rows for cell in row if isinstance(cell, NotDrawn))

    @property
    def design_place(self) -> tuple[int, int] | None:
        """Row and column of the profile's own values; None if they are not on the map."""
        x = design_value(self.x.key, self.profile)
        y = None if self.y is None else design_value(self.y.key, self.profile)
        up = (None,) if self.y is None else self.y.values
        return (up.index(y), self.x.values.index(x)) if x in self.x.values and y in up else None

    @property
    def design(self) -> Cell | None:
        """Cell of the profile's own values; None if they are not on the map."""
        if self.design_place is None:
            return None
        row, column = self.design_place
        cell = self.rows[row][column]
        return cell if isinstance(cell, Cell) else None

    @property
    def regions(self) -> tuple[Region, ...]:
        """Cells by state and limit: states in the order of `STATES`, the largest region of each first."""
        counts = Counter(
            (cell.state, cell.reasons, cell.binding_term if cell.reasons == (TIME,) else None) for cell in self.cells
        )
        regions = [Region(*region, cells=number) for region, number in counts.items()]
        return tuple(sorted(regions, key=lambda region: (STATES.index(region.state), -region.cells)))

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.map.report import map_report

        return map_report(self)


@with_its_constants
def map_(
    profile: ProfileLike,
    *,
    x: Along | None = None,
    y: Along | None = None,
    circle: bool = False,
    progress: Progress = ignored,
    executor: Executor | None = None,
) -> MapAnswer:
    """Tell where a design fits as two keys vary, and what limits it elsewhere: `busplan map`.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    x, y
        Quantities on the x and the y axis: one dotted key, or "axes" for the axes of all nodes, with up to 64 values in
        its unit, as `sweep` takes them: {"bus.gap_count": [7, 63, "optimal"]}. By default the axes, and the period
        [us]; with x alone, one key varies, and the picture is the curve of the free time.
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
    require_executor(executor, circle=circle)
    network = load_network(profile)
    if x is None:
        require_cycle(network.profile, question="a map of period and axes", instead="give x, a key with values")
    if x is not None and y is None:
        across, up = direction(network.profile, x, name="x", with_circle=circle), None
    else:
        across, up = directions(network, x, y, with_circle=circle)
    points = possible_points(network, across, up)
    fits = fits_at([*points.possible.values()], model=network.bus.deciding_model)
    return map_of(network, across, up, points, fits, circle=circle, executor=executor, progress=progress)


def possible_points(network: Network, x: Direction, y: Direction | None) -> GridPoints:
    """The points of two directions, column by column.

    BusplanError: a profile can have none of them, or they are too many for its groups and messages.
    """
    along = (x,) if y is None else (x, y)
    require_few_tables(network, settings=prod(len(one.values) for one in along))
    points = points_of(network, Grid({one.key: np.array(one.values, dtype=object) for one in along}))
    if not points.possible:
        raise BusplanError(f"no setting of this map can exist: {next(iter(points.refused.values()))}")
    return points


def map_of(
    network: Network,
    x: Direction,
    y: Direction | None,
    points: GridPoints,
    fits: Sequence[FitFigures],
    *,
    circle: bool,
    executor: Executor | None,
    progress: Progress,
) -> MapAnswer:
    """The map of some points from the figures of each under the model that decides, with circle tests if asked for."""
    values = [*product(x.values, (None,) if y is None else y.values)]
    cells = {
        number: _cell(point.network, fit, *values[number])
        for (number, point), fit in zip(points.possible.items(), fits, strict=True)
    }
    if circle:
        fitting = {number: points.possible[number] for number, cell in cells.items() if cell.state == FITS}
        cells |= _with_circles(network.profile, fitting, cells, executor=executor, progress=progress)
    drawn = [cells.get(number) or NotDrawn(*at, points.refused[number]) for number, at in enumerate(values)]
    bus, rows = network.bus, in_rows(drawn, columns=len(x.values))
    return MapAnswer(network.profile, bus.figures, bus.safety, bus.deciding_model, x, y, rows, circle)


def in_rows(items: Sequence[_Item], *, columns: int) -> tuple[tuple[_Item, ...], ...]:
    """Items that stand column by column, row by row."""
    height = len(items) // columns
    return tuple(tuple(items[row::height]) for row in range(height))


def directions(network: Network, x: Along | None, y: Along | None, *, with_circle: bool) -> tuple[Direction, Direction]:
    """The directions along x and y; by default the axes of all nodes, and the period.

    BusplanError: a direction is not one key and its values, or both vary the same key.
    """
    profile = network.profile
    # Messages alone have no nodes whose number could vary.
    nodes_key = varied_nodes(profile).nodes_key if network.groups else AXES
    across, up = (
        None if along is None else direction(profile, along, name=name, with_circle=with_circle)
        for name, along in (("x", x), ("y", y))
    )
    if across is None:
        across = _default_direction(PERIOD if up is not None and up.key in (AXES, nodes_key) else AXES, network)
    if up is None:
        up = _default_direction(AXES if across.key == PERIOD else PERIOD, network)
    key_x, key_y = (nodes_key if direction.key == AXES else direction.key for direction in (across, up))
    if key_x == key_y:
        raise BusplanError(f"x = {across.key} and y = {up.key} both vary {key_x}; give two keys")
    return across, up


def direction(profile: Profile, along: Along, *, name: str, with_circle: bool) -> Direction:
    """Check the key of a direction and the number of its values; values that the schema refuses are not drawn later."""
    if not isinstance(along, Mapping) or len(along) != 1 or not all(isinstance(key, str) for key in along):
        raise ArgumentError(f'{name} {along!r}: expected one key and its values, as {{"bus.nodes": range(1, 17)}}')
    ((key, given),) = along.items()
    values = axis_values(profile, key, given, name=name)
    if key != AXES:
        require_keys(profile, [key], option=name, circle_option=None if with_circle else "circle")
    if values.size > MOST_VALUES:
        raise ArgumentError(
            f"{name} {key}: {values.size:,} values; a map shows up to {MOST_VALUES} of a key. A sweep takes more"
        )
    numbers = [whole(value) for value in values.tolist()]
    return Direction(key, tuple(numbers if values.dtype == object else sorted(numbers)))


_FACTORS: Final = ((1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8), (1, 2, 5), (1,))
"""Round numbers of a decade, the finest choice first."""
_MOST_BY_DEFAULT: Final = 20
"""Most values of a default direction, not counting the design's own."""
_BEYOND: Final = 2
"""Nodes drawn beyond the most that fit."""


def _default_direction(key: str, network: Network) -> Direction:
    """A direction along `AXES` or `PERIOD` that shows where the design stops fitting."""
    varied = varied_nodes(network.profile)
    design_us, design_nodes = network.profile.cycle.period_us, int(varied.nodes)
    most, fit_us = _periods_of_nodes(network, varied.name)
    if not most:  # not even one node fits at any period: the range follows from the design's period alone
        most, fit_us = 1, lambda _: design_us
    # Chosen: the largest of twice the design's period; what its nodes need, and a quarter more; and what the most nodes
    # need, and a quarter more, but four times the design's period at most.
    to_us = max(2 * design_us, 1.25 * fit_us(min(design_nodes, most)), min(4 * design_us, 1.25 * fit_us(most)))
    from_us = min(design_us, fit_us(1), to_us / 4) / 1.25
    if key == AXES:
        most = bisect_right(range(1, most + 1), to_us * (1 + FIT_ROUNDING), key=fit_us)
        counts, node_axes = _counts(design_nodes, most), int(varied.node.axes)
        if not node_axes:  # nodes without axes are counted themselves
            return Direction(varied.nodes_key, counts)
        other_axes = design_value(AXES, network.profile) - design_nodes * node_axes
        return Direction(AXES, tuple(other_axes + count * node_axes for count in counts))
    least_us, most_us = max(from_us, MIN_STEP_US), min(to_us, MAX_TIME_US)
    allowed = [us for us in network.bus.periods.us if least_us <= us <= most_us]
    periods_us = (
        allowed[:: ceil(len(allowed) / _MOST_BY_DEFAULT)]
        if allowed
        else round_numbers(least_us, most_us, most=_MOST_BY_DEFAULT, decades=_FACTORS)
    )
    return Direction(PERIOD, tuple(sorted({*periods_us, design_us})))


def _periods_of_nodes(network: Network, group: str) -> tuple[int, Callable[[int], float]]:
    """The most nodes of a group that are shown to fit at any period, and the shortest period by their number [us]."""
    bus = network.bus
    most, _ = safe_nodes(at_period(network, min(MAX_TIME_US, bus.periods.longest_us)), group=group)

    def fit_us(nodes: int) -> float:
        cycle = bus.cycle(network.with_nodes(nodes, group=group), model=bus.deciding_model)
        return float(shortest_period_us(cycle.network, certainty(cycle).safe_required_us, is_shown=True))

    return most, fit_us


def _counts(design: int, most: int) -> tuple[int, ...]:
    """Numbers of nodes, from one to some beyond the most that fit the longest period drawn.

    Steps are equal up to twice the nodes of this design, and grow beyond.
    """
    last = min(max(design + 1, most + _BEYOND), MAX_COUNT)
    near = last if last <= _MOST_BY_DEFAULT else min(2 * design, last)
    values = _MOST_BY_DEFAULT if near == last else _MOST_BY_DEFAULT // 2
    step = next(size for size in (f * 10**p for p in range(7) for f in (1, 2, 5)) if near <= values * size)
    even = range(design % step or step, near + 1, step)
    growing = round_numbers(near, last, most=_MOST_BY_DEFAULT - len(even), decades=_FACTORS) if near < last else []
    return tuple(sorted({1, *even, *(ceil(nodes) for nodes in growing), last}))


def design_value(key: str, profile: Profile) -> Any:
    """The profile's own value along a direction; None if it has none."""
    if key != AXES:
        return value_at(profile, key)
    return sum(int(group.nodes * group.node.axes) for group in profile.node_groups)


def _cell(network: Network, fit: FitFigures, x: Value, y: Value | None) -> Cell:
    """The verdict of `capacity` at a setting, before any circle test."""
    safety = () if fit.safe else (limit for limit in network.bus.limits if limit.role == "safety")
    unsafe = tuple(limit.key for limit in safety if limit.is_surely_broken(network))
    verdict: Any = fit.verdict  # there is one under the timing model that decides
    state: State = verdict
    limits: tuple[str, ...] = () if verdict == FITS else fit.behind or (TIME,)
    # "does not fit" outranks "unsafe", which outranks "not shown to fit".
    if unsafe and verdict != DOES_NOT_FIT:
        state, limits = "unsafe", unsafe
    cell = Cell(
        x=x,
        y=y,
        nodes=fit.nodes,
        axes=fit.axes,
        state=state,
        reasons=limits,
        verdict=verdict,
        is_safe=fit.safe,
    )
    if isinstance(fit, CycleFigures):
        names = ("binding_term", "available_us", "margin_corrected_us", "uncertainty_us")
        cell = cell._replace(**{name: getattr(fit, name) for name in names})
    return cell


def _with_circles(
    profile: Profile,
    points: Mapping[int, GridPoint],
    cells: Mapping[int, Cell],
    *,
    executor: Executor | None,
    progress: Progress,
) -> dict[int, Cell]:
    """Cells of points that fit, with the results of their circle tests."""
    if len(points) > MOST_CIRCLES_UNASKED:
        raise BusplanError(
            f"{len(points):,} settings fit, and a map runs up to {MOST_CIRCLES_UNASKED:,} circle tests; "
            "give fewer values"
        )
    refused = {
        place: tuple(cause.name for cause in causes)
        for place, point in points.items()
        if (causes := refusals(point.network))
    }
    run = [place for place in points if place not in refused]
    results = run_points(profile, [points[place].changes for place in run], executor=executor, progress=progress)
    return {
        **{place: cells[place]._replace(state="circle cannot be run", reasons=refused[place]) for place in refused},
        **{place: _judged(cells[place], result) for place, result in zip(run, results, strict=True)},
    }


def _judged(cell: Cell, result: CircleFigures) -> Cell:
    cell = cell._replace(circle_passed=result.passed, max_contour_error_mm=result.max_contour_error_mm)
    if result.passed is False:
        return cell._replace(state="circle fails", reasons=tuple(failure.name for failure in result.failures))
    return cell if result.passed else cell._replace(state="circle not judged")
