"""The machine of a profile on several kinds of bus: verdict, smallest period, most axes, and its circle."""

from collections.abc import Iterator, Sequence
from math import ceil, floor, log2
from typing import TYPE_CHECKING, Final, NamedTuple

from busplan.buses import kind_named, kind_names
from busplan.errors import BusplanError
from busplan.nearest import did_you_mean
from busplan.profile.conversion import AssumedKey, converted
from busplan.profile.toml import override
from busplan.progress import Progress
from busplan.questions.circle.check import ComputeCircleFigures, circle_tests
from busplan.questions.fit.assumed import assumed_rates
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.circle_refusal import STEP
from busplan.questions.fit.figures import CapacityFigures, after_reset, figures
from busplan.questions.fit.inputs import given
from busplan.questions.fit.network import varied_nodes
from busplan.questions.fit.node_limit import safe_nodes
from busplan.questions.plan.freedoms import PERIOD
from busplan.questions.plan.smallest_period import SmallestPeriod, needed_settings, smallest_period
from busplan.sections.base import MAX_TIME_US, MIN_STEP_US, value_at
from busplan.sections.profile import Profile
from busplan.servo.checks import dividing_step_us

if TYPE_CHECKING:
    from busplan.questions.circle.figures import CircleFigures

_ROUND_US: Final = 1000.0
"""Periods of a curve are halves and doubles of it, which buses with some periods alone know, too [us]."""
_MOST_POINTS: Final = 12


class SafeAxes(NamedTuple):
    """The most axes that are shown to fit a period."""

    period_us: float
    axes: int | None
    """Of all nodes; where nodes are in groups, with more nodes of one group, the others as they are. None where the
    machine has no axes."""
    nodes: int
    """Of the nodes that are counted [1]."""
    limited_by: str
    """Key of the limit that keeps them from being more."""


class CircleAtSmallest(NamedTuple):
    """The circle test at the smallest period."""

    step_us: float
    """The longest round step, up to the profile's own, that divides the period [us]."""
    figures: "CircleFigures | None"
    """None if it could not be run."""
    problems: tuple[str, ...]
    """Its failures, or why it could not be run."""


class MachineOnKind(NamedTuple):
    """The machine on one kind of bus."""

    profile: Profile
    is_own: bool
    """Whether this is the kind of the profile, which stays as it is."""
    assumed: tuple[AssumedKey, ...]
    left_out: tuple[str, ...]
    """Keys and sections that the profile sets and this kind does not have."""
    figures: CapacityFigures
    """Under the timing model that decides, at the profile's period."""
    after_reset: CapacityFigures | None
    """After a bus reset, where it is shown to fit as it is set and not then."""
    safe: SafeAxes
    """At the profile's period."""
    smallest: SmallestPeriod
    circle: CircleAtSmallest | None
    """None if no circle was to be run, or no period is shown to fit."""
    curve: tuple[SafeAxes, ...]
    """The most axes over the period."""

    @property
    def assumed_host(self) -> tuple[AssumedKey, ...]:
        """Assumptions about the host's own time, of its own profile, too; with any it has no rank."""
        key = kind_named(self.profile.bus.kind).key_of("host")
        inputs = [given(self.profile, key)] if self.is_own and key else []
        own = (
            AssumedKey(known.name, known.value, "profile")
            for known in inputs
            if known.grade == "assumed" and known.value
        )
        return (*own, *(assumed for assumed in self.assumed if assumed.key == key))


class NotOnKind(NamedTuple):
    """A kind of bus that cannot have the machine."""

    kind: str
    why: tuple[str, ...]


class KindComparison(NamedTuple):
    """Answer of `compare`."""

    profile: Profile
    kinds: tuple[MachineOnKind | NotOnKind, ...]
    """In the order asked for; of all, the profile's own first."""
    with_circle: bool

    @property
    def compared(self) -> tuple[MachineOnKind, ...]:
        """The kinds that can have the machine."""
        return tuple(machine for machine in self.kinds if isinstance(machine, MachineOnKind))

    @property
    def counted(self) -> str:
        """Name of the group whose nodes are counted for the most axes; empty where all nodes are alike."""
        return varied_nodes(self.profile).name


def checked_kinds(names: Sequence[str], *, option: str) -> tuple[str, ...]:
    """Check names of kinds of bus; each is taken once.

    Parameters
    ----------
    names
        The names.
    option
        Option or key that gives them, for messages.

    Raises
    ------
    BusplanError
        No kind of bus has the name, or there is no name.
    """
    known = kind_names()
    for name in names or [""]:
        if name not in known:
            near = did_you_mean(name, known)
            raise BusplanError(f"{option} {name}: no kind of bus; there are {', '.join(known)}{near and f'; {near}'}")
    return tuple(dict.fromkeys(names))


def compare(
    profile: Profile,
    *,
    kinds: Sequence[str] | None = None,
    with_circle: bool = False,
    progress: Progress | None = None,
) -> KindComparison:
    """Put the machine of a profile on several kinds of bus.

    Parameters
    ----------
    profile
        The profile; on its own kind it stays as it is.
    kinds
        Names of kinds, from `checked_kinds`; all without it, the profile's own first.
    with_circle
        Run the circle test of each kind at its smallest period.
    progress
        Called now and then with the parts of all circle tests that are done, and all of them.
    """
    own = profile.bus.kind
    names = tuple(kinds) if kinds is not None else (own, *(kind for kind in kind_names() if kind != own))
    machines = [_on_kind(profile, name) for name in names]
    periods_us = _curve_periods(
        profile, [machine.smallest.us for machine in machines if isinstance(machine, MachineOnKind)]
    )
    machines = [
        machine if isinstance(machine, NotOnKind) else machine._replace(curve=_curve(machine, periods_us))
        for machine in machines
    ]
    if with_circle:
        run = circle_tests(progress, of=len(machines))
        machines = [
            machine if isinstance(machine, NotOnKind) else machine._replace(circle=_circle(machine, run))
            for machine in machines
        ]
    return KindComparison(profile, tuple(machines), with_circle)


def _on_kind(profile: Profile, kind: str) -> MachineOnKind | NotOnKind:
    try:
        conversion = converted(profile, kind)
    except BusplanError as error:
        return NotOnKind(kind, error.problems)
    is_own = kind == profile.bus.kind
    needed = {} if is_own else needed_settings(conversion.profile)
    if needed:
        assumed = (assumed for assumed in conversion.assumed if assumed.key not in needed)
        tried = (AssumedKey(key, value, "setting") for key, value in needed.items())
        conversion = conversion._replace(profile=override(conversion.profile, dict(needed)), assumed=(*tried, *assumed))
    rates = (AssumedKey(key, value_at(profile, key), "profile") for key in assumed_rates(profile))
    capacity = figures(conversion.profile, model=kind_named(kind).deciding_model)
    return MachineOnKind(
        profile=conversion.profile,
        is_own=is_own,
        assumed=tuple(rates) if is_own else conversion.assumed,
        left_out=conversion.left_out,
        figures=capacity,
        after_reset=after_reset(conversion.profile, capacity),
        safe=most_safe_axes(conversion.profile),
        smallest=smallest_period(conversion.profile),
        circle=None,
        curve=(),
    )


def most_safe_axes(profile: Profile) -> SafeAxes:
    """Count the most axes that are shown to fit a profile's period, on a bus that is set safely for them.

    Where nodes are in groups, the one with the most axes gets more nodes and the others stay.

    Parameters
    ----------
    profile
        The network.
    """
    varied = varied_nodes(profile)
    nodes, limit = safe_nodes(profile, group=varied.name)
    node_axes = int(varied.node.axes)
    axes_beside = sum(
        int(alike.nodes) * int(alike.node.axes) for alike in profile.alike_nodes if alike.name != varied.name
    )
    axes = None if not node_axes else axes_beside + nodes * node_axes if nodes else 0
    return SafeAxes(profile.cycle.period_us, axes, nodes, limit)


def _curve_periods(profile: Profile, smallest_us: Sequence[float | None]) -> tuple[float, ...]:
    """Periods about the smallest ones and the profile's own, which is among them [us]."""
    own_us = profile.cycle.period_us
    marks_us = [own_us, *(us for us in smallest_us if us is not None)]
    first, last = floor(log2(min(marks_us) / _ROUND_US)) - 1, ceil(log2(max(marks_us) / _ROUND_US)) + 1
    every = ceil((last - first + 1) / _MOST_POINTS)
    round_us = (_ROUND_US * 2.0**power for power in range(first, last + 1) if power % every == 0)
    return tuple(sorted({own_us, *(us for us in round_us if MIN_STEP_US <= us <= MAX_TIME_US)}))


def _curve(machine: MachineOnKind, periods_us: Sequence[float]) -> tuple[SafeAxes, ...]:
    return tuple(most_safe_axes(override(machine.profile, {PERIOD: period_us})) for period_us in periods_us)


def _circle(machine: MachineOnKind, run: ComputeCircleFigures) -> CircleAtSmallest | None:
    """The circle at the smallest period, in steps that divide it."""
    if machine.smallest.us is None:
        return None
    step_us = dividing_step_us(machine.smallest.us, most_us=machine.profile.servo.step_us)
    try:
        result = run(override(machine.profile, {PERIOD: machine.smallest.us, STEP: step_us}))
    except BusplanError as error:
        return CircleAtSmallest(step_us, None, error.problems)
    return CircleAtSmallest(step_us, result, tuple(failure.text for failure in result.failures))


def fitting(comparison: KindComparison) -> Iterator[MachineOnKind]:
    """The kinds on which the machine is shown to fit its period, on a bus that is set safely."""
    return (machine for machine in comparison.compared if machine.figures.verdict == FITS and machine.figures.safe)
