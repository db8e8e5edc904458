"""Freedoms of a plan, in the order of their cost; each gives its values again after each change."""

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Sequence
from decimal import ROUND_CEILING, Decimal
from functools import partial
from itertools import count
from math import ceil, inf
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from busplan.buses.parts import Cost
from busplan.elementwise import FIT_ROUNDING, plain, within
from busplan.errors import BusplanError
from busplan.questions.fit.certainty import fits_in
from busplan.questions.fit.circle_refusal import STEP
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.constraints import (
    NODES_KEY,
    Changes,
    goes_with_step,
    least_cut_bytes,
    payload_keys,
    rooms,
    with_nodes,
    with_payload_within,
)
from busplan.sections.base import MAX_TIME_US
from busplan.servo.checks import dividing_step_us

if TYPE_CHECKING:
    from busplan.questions.plan.search import Search
    from busplan.sections.profile import Profile


class NumberGrid(Protocol):
    """Numbers at places from 1 on, ascending."""

    def number(self, place: int) -> float:
        """The number at a place; infinite beyond the last."""

    def place(self, least: float) -> int:
        """The place of the smallest number that is no less than another one, but for float rounding."""


class ListedNumbers(NamedTuple):
    """Numbers of a list.

    Parameters
    ----------
    numbers
        The numbers, ascending.

    Examples
    --------
    >>> known = ListedNumbers((250.0, 500.0))
    >>> known.place(300.0), known.number(2), known.number(3)
    (2, 500.0, inf)
    """

    numbers: tuple[float, ...]

    def number(self, place: int) -> float:
        """The number at a place; infinite beyond the last."""
        return self.numbers[place - 1] if place <= len(self.numbers) else inf

    def place(self, least: float) -> int:
        """The place of the smallest number that is no less than another one, but for float rounding."""
        return bisect_left(self.numbers, least * (1 - FIT_ROUNDING)) + 1


class ShortNumbers(NamedTuple):
    """The multiples of a step that have a few significant digits, in decimal arithmetic: 3 * 0.1 is 0.3.

    Parameters
    ----------
    step
        The smallest number, in its own unit.
    digits
        Most significant digits of the multiple: with two, 98, 99, 100, 110, 120 steps.
    """

    step: float
    digits: int

    def number(self, place: int) -> float:
        """The number at a place from 1 on, ascending.

        Examples
        --------
        >>> [ShortNumbers(0.1, 1).number(place) for place in (1, 9, 10, 11)]
        [0.1, 0.9, 1.0, 2.0]
        """
        return float(self._multiple(place) * Decimal(str(self.step)))

    def place(self, least: float) -> int:
        """The place of the smallest number that is no less than another one, but for float rounding.

        Examples
        --------
        >>> [ShortNumbers(100, 3).number(ShortNumbers(100, 3).place(least)) for least in (0, 1087.2, 1100, 123_456)]
        [100.0, 1100.0, 1100.0, 124000.0]
        """
        steps = ceil(Decimal(least * (1 - FIT_ROUNDING)) / Decimal(str(self.step)))
        blocks = max(0, len(str(steps)) - self.digits)
        rounded = int((Decimal(steps) / 10**blocks).to_integral_value(ROUND_CEILING))
        first: int = 10 ** (self.digits - 1)
        return max(1, rounded + blocks * 9 * first)

    def _multiple(self, place: int) -> int:
        first: int = 10 ** (self.digits - 1)
        blocks = max(0, (place - first) // (9 * first))
        scale: int = 10**blocks
        return (place - blocks * 9 * first) * scale


RATIOS: Final = ShortNumbers(0.01, 2)
"""Slice ratios that are advised."""
MOST_RATIO: Final = 0.9
"""Largest slice ratio that is advised: the host computes in the rest of the period. Chosen."""
PERIOD_DIGITS: Final = 3
"""Significant digits of a period that is advised, in its step."""
PERIOD_STEP_US: Final = 1.0
"""Step of periods where no circle asks for another [us]."""

RATIO: Final = "cycle.slice_ratio"
PERIOD: Final = "cycle.period_us"
DEFAULT_COSTS: Final = (Cost.SIMULATION, Cost.REGISTER, Cost.HOST_TIME, Cost.PERIOD)
"""Freedoms of a plan by default."""


class Freedom(NamedTuple):
    """One thing that a plan may change."""

    name: str
    label: str
    cost: Cost
    keys: tuple[str, ...]
    values: "Callable[[Search, Changes, Sequence[Freedom]], Iterator[Changes]]"
    """Possible values after some changes, with cheaper freedoms: the least change first, nothing that cannot help."""

    @property
    def gives_time(self) -> bool:
        """Whether it lengthens the slice, and leaves the cycle as it is."""
        return self.cost in (Cost.HOST_TIME, Cost.PERIOD)


def freedoms(profile: "Profile") -> tuple[Freedom, ...]:
    """Everything that may be changed in a network, the cheapest first; the step of a circle where it must change."""
    network = network_of(profile)
    own = (
        Freedom(setting.name, setting.label, setting.cost, setting.keys, partial(_of_bus, setting.name))
        for setting in bus_of(profile).settings(network)
    )
    if not profile.has_cycle:
        return tuple(sorted(own, key=lambda freedom: freedom.cost))
    freedoms_known = (
        *own,
        *(() if goes_with_step(profile, profile.cycle.period_us) else (_STEP_OF_CIRCLE,)),
        Freedom("slice_ratio", "slice ratio", Cost.HOST_TIME, (RATIO,), _ratios),
        Freedom("payload", "payload", Cost.PAYLOAD, payload_keys(profile), _payloads),
        Freedom("period", "period", Cost.PERIOD, (PERIOD,), _periods),
        # Where nodes differ, nobody but the user knows which can go.
        *((Freedom("nodes", "nodes", Cost.NODES, (NODES_KEY,), _fewer_nodes),) if network.is_uniform else ()),
    )
    return tuple(sorted(freedoms_known, key=lambda freedom: freedom.cost))


def freed(
    profile: "Profile", names: Sequence[str] | None, *, asked: Collection[str] = (), option: str = "free"
) -> tuple[Freedom, ...]:
    """Freedoms of a plan, the cheapest first.

    Parameters
    ----------
    profile
        The network.
    names
        Names of freedoms; None for those of the bus's registers, the slice ratio and the period; of a network without a
        cycle all.
    asked
        Keys with a value that was asked for, which stays.
    option
        Option or parameter that gives the names, for messages.

    Raises
    ------
    BusplanError
        The network has no freedom of that name, or its value was asked for.
    """
    known = freedoms(profile)
    still = [freedom for freedom in known if not set(freedom.keys) <= set(asked)]
    if names is None:
        return tuple(freedom for freedom in still if freedom.cost in DEFAULT_COSTS or not profile.has_cycle)
    said = ", ".join(freedom.name for freedom in known)
    kind = f"{profile.bus.kind} with groups" if profile.group else profile.bus.kind
    unknown = [
        f"{option} {name}: there is nothing of that name to free on a bus of kind {kind}; there are {said}"
        for name in names
        if name not in {freedom.name for freedom in known}
    ]
    fixed = [
        f"{option} {freedom.name}: {' and '.join(key for key in freedom.keys if key in asked)} was given a value, "
        "which is kept; give one of them"
        for freedom in known
        if freedom.name in names and freedom not in still
    ]
    if unknown or fixed:
        raise BusplanError(*unknown, *fixed)
    return tuple(freedom for freedom in still if freedom.name in names)


def _of_bus(name: str, search: "Search", changes: Changes, _cheaper: Sequence[Freedom]) -> Iterator[Changes]:
    """Values of a setting of the bus, safe for all nodes that [limits] asks for."""
    profile = search.profile(changes)
    networks = (network_of(profile), *(room.network for room in rooms(profile)))
    network = max(networks, key=lambda network: float(plain(network.nodes)))
    for setting in bus_of(profile).settings(network):
        if setting.name == name:
            yield from setting.values


def _dividing_steps(search: "Search", changes: Changes, _cheaper: Sequence[Freedom]) -> Iterator[Changes]:
    """The longest step, up to the own one, that divides the period, where that one does not."""
    profile = search.profile(changes)
    if not goes_with_step(profile, search.period_us(changes)):
        step = {STEP: dividing_step_us(search.period_us(changes), most_us=profile.servo.step_us)}
        if search.allows({**changes, **step}):
            yield step


_STEP_OF_CIRCLE: Final = Freedom("step", "step of the circle", Cost.SIMULATION, (STEP,), _dividing_steps)


def _ratios(search: "Search", changes: Changes, cheaper: Sequence[Freedom]) -> Iterator[Changes]:
    """The smallest ratio for each combination of what is cheaper: between two of them nothing new fits."""
    period_us, own = search.period_us(changes), search.ratio(changes)
    ratios = set()
    for combination in search.combinations(changes, cheaper):
        if within(search.needed_us(combination, ratio=MOST_RATIO), period_us):
            needed_us = max(need.slice_us for need in search.needs(combination))
            ratios.add(RATIOS.number(place_of(RATIOS, needed_us, each_us=period_us)))
    yield from ({RATIO: ratio} for ratio in sorted(ratios) if own < ratio <= MOST_RATIO)


def _payloads(search: "Search", changes: Changes, cheaper: Sequence[Freedom]) -> Iterator[Changes]:
    """Smaller payloads, in the steps of the bus: the larger one of read and write is cut first.

    They begin with the largest that is in time; where none is, there is the smallest alone.
    """
    profile = search.profile(changes)
    network = network_of(profile)
    payloads = bus_of(profile).payloads(network)
    step = max(payloads.step_bytes, least_cut_bytes(profile, kept=search.kept))
    sizes = range(min(int(network.largest_payload_bytes) - 1, payloads.most_bytes) // step * step, 0, -step)

    def cut(size: int) -> Changes | None:
        change = with_payload_within(profile, size, kept=search.kept)
        return change if change is not None and search.allows({**changes, **change}) else None

    sizes = sizes[: bisect_left(sizes, x=True, key=lambda size: cut(size) is None)]
    # Below a point after which a table of execution times falls, a smaller payload may take longer.
    from_bytes = max(alike.node.execution.ascends_from_bytes for alike in profile.alike_nodes)
    rising = bisect_left(sizes, x=True, key=lambda size: size < from_bytes)
    first = bisect_left(
        sizes, x=True, hi=rising, key=lambda size: search.reaches({**changes, **(cut(size) or {})}, cheaper)
    )
    before: Changes | None = None
    for size in search.in_strides(sizes[min(first, len(sizes) - 1) :] if sizes else sizes):
        change = cut(size)
        if change is not None and change != before:
            yield change
        before = change


def _periods(search: "Search", changes: Changes, cheaper: Sequence[Freedom]) -> Iterator[Changes]:
    """Periods that the bus fits, the nearest first: the circle does not grow evenly with the period.

    After some of them the strides double, and what is found then is not proven to be the nearest.
    """
    needed_us = search.least_needed_us(changes, cheaper)
    if needed_us == inf:
        return
    grid, own_us = period_grid(search.profile(changes)), search.period_us(changes)
    least = place_of(grid, needed_us, each_us=1)
    at = grid.place(own_us)
    below, above = at - 1, max(at + (grid.number(at) <= own_us), least)
    stride = 1
    for tried in count():
        if tried >= search.max_circles:
            stride *= 2
            search.proven = False
        is_above = grid.number(above) <= MAX_TIME_US
        if below >= least and (not is_above or own_us - grid.number(below) <= grid.number(above) - own_us):
            yield {PERIOD: grid.number(below)}
            below -= stride
        elif is_above:
            yield {PERIOD: grid.number(above)}
            above += stride
        else:
            return


def _fewer_nodes(search: "Search", changes: Changes, cheaper: Sequence[Freedom]) -> Iterator[Changes]:
    """Fewer nodes, from the most that the bus carries."""
    own = int(network_of(search.profile(changes)).nodes)
    for nodes in search.in_strides(range(most_nodes(search, changes, cheaper, below=own), 0, -1)):
        yield with_nodes(nodes)


def most_nodes(search: "Search", changes: Changes, cheaper: Sequence[Freedom], *, below: int) -> int:
    """The most nodes below a number that are within reach of some freedoms; no constraint is eased by nodes [1]."""
    low, high = 0, below - 1
    while low < high:
        middle = (low + high + 1) // 2
        if search.reaches({**changes, **with_nodes(middle)}, cheaper):
            low = middle
        else:
            high = middle - 1
    return low


def period_grid(profile: "Profile") -> NumberGrid:
    """Periods that are advised: those that the bus allows, or short numbers; the circle's step divides each."""
    known = bus_of(profile).periods.us
    if known:
        return ListedNumbers(tuple(us for us in known if goes_with_step(profile, us)))
    return ShortNumbers(profile.servo.step_us if profile.asks_for_circle else PERIOD_STEP_US, PERIOD_DIGITS)


def longest_period_us(profile: "Profile") -> float:
    """The longest period that a profile may have and its bus allows [us]."""
    return min(bus_of(profile).periods.longest_us, MAX_TIME_US)


def place_of(grid: NumberGrid, needed_us: float, *, each_us: float) -> int:
    """The place of the smallest number of a grid with which the slice gives some time.

    Parameters
    ----------
    grid
        Periods [us], or slice ratios [1].
    needed_us
        Length that the slice must have [us].
    each_us
        Length of the slice for each unit of the grid: the slice ratio, or the period.
    """
    place = grid.place(needed_us / each_us)
    while not fits_in(needed_us, available_us=each_us * grid.number(place)):
        place += 1
    return place
