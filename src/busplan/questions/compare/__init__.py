"""`busplan.compare`."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, log2
from typing import Final, NamedTuple

from busplan.buses import kind_called, kind_named, kind_names, variant_called
from busplan.buses.network import Network
from busplan.buses.published import Tested, parts_tested
from busplan.english import did_you_mean
from busplan.errors import ArgumentError, BusplanError
from busplan.forms.blocks import Report, Sentence
from busplan.forms.charts import Drawing
from busplan.profile.conversion import AssumedKey, converted
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    ProfileLike,
    load_profile,
    one_or_several,
    require_cycle,
    with_its_constants,
)
from busplan.questions.base.sentences import execution_sentence
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.cure import SettingForPeriod, best_register, settings_to_be_carried
from busplan.questions.fit.figures import (
    CycleFigures,
    FitFigures,
    after_reset,
    axes_in_all,
    cycle_figures,
    words_behind,
)
from busplan.questions.fit.graded import assumed_rates, given
from busplan.questions.fit.most_nodes import safe_nodes
from busplan.questions.fit.needs import SmallestPeriod, smallest_period
from busplan.questions.fit.network import at_period, changed, network_of
from busplan.sections.base import MAX_TIME_US, MIN_STEP_US, value_at
from busplan.sections.profile import Profile, varied_nodes

_ROUND_US: Final = 1000.0
"""Periods of a curve are halves and doubles of it, which buses with some periods alone know, too [us]."""
_MOST_POINTS: Final = 12


class SafeAxes(NamedTuple):
    """The most axes that are shown to fit a period."""

    period_us: float
    axes: int | None
    """Axes of all nodes; where nodes are in groups, one group gets more nodes. None where the machine has no axes."""
    nodes: int
    """Nodes that are counted [1]."""
    limited_by: str
    """Key of the limit that keeps them from being more."""


class NotOnKind(NamedTuple):
    """A kind of bus that cannot have the machine."""

    name: str
    """Name of the kind, or of a variant of it."""
    kind: str
    title: str
    """Name of the bus, for people."""
    tested: Tested
    """Parts of its model that published figures test."""
    why: tuple[str, ...]


class MachineOnKind(NamedTuple):
    """The machine on one kind of bus."""

    name: str
    """Name of the kind, or of a variant of it."""
    profile: Profile
    title: str
    """Name of the bus, for people."""
    tested: Tested
    """Parts of its model that published figures test."""
    is_own: bool
    """Whether this is the kind of the profile, where the machine stays as it is."""
    assumed: tuple[AssumedKey, ...]
    assumed_host: tuple[AssumedKey, ...]
    """Assumptions about the host's own time, those of the profile included; a machine with any has no rank."""
    left_out: tuple[str, ...]
    """Keys and sections that the profile sets and this kind does not have."""
    of_host: Mapping[str, str]
    """Keys of the profile's host by their names on this kind; empty on its own."""
    execution: str
    """Meaning of the profile's execution times on another kind; empty where there is nothing to say."""
    figures: CycleFigures
    """Under the timing model that decides, at the profile's period."""
    broken_limits: tuple[str, ...]
    """By how much each limit of the bus is broken, or why it is not shown to be kept."""
    after_reset: FitFigures | None
    """Figures after a bus reset; None unless it is shown to fit now and not after the reset."""
    safe: SafeAxes
    """At the profile's period."""
    smallest: SmallestPeriod
    curve: tuple[SafeAxes, ...]
    """The most axes over the period."""
    best: SettingForPeriod | None = None
    """The setting, free to change, that makes `smallest` the smallest; the most axes are those with it or without.
    None on the profile's own kind."""

    @property
    def kind(self) -> str:
        """The kind of bus."""
        return self.profile.bus.kind

    @property
    def fits(self) -> bool:
        """Whether it is shown to fit its period, on a bus that is set safely."""
        return self.figures.verdict == FITS and self.figures.safe


@dataclass(frozen=True, slots=True, repr=False)
class CompareAnswer(Answer):
    """Answer of `compare`: a machine on several kinds of bus, whose most axes a notebook draws.

    Parameters
    ----------
    profile
        The profile.
    nodes, axes
        Size of its network.
    counted
        Name of the group whose nodes are counted for the most axes; empty where all nodes are alike.
    execution
        The grade of the execution times, in words.
    wake_up
        Key of the host's latest wake-up on the profile's kind of bus; empty where it has none.
    kinds
        The kinds in the order of the argument; of all, the profile's own first. Each has `figures` at the profile's
        period, its `smallest` period and its most `safe` axes, or the reason why it has none.
    """

    profile: Profile
    nodes: int
    axes: int
    counted: str
    execution: tuple[Sentence, ...]
    wake_up: str
    kinds: tuple[MachineOnKind | NotOnKind, ...]

    @property
    def compared(self) -> tuple[MachineOnKind, ...]:
        """The kinds that can have the machine."""
        return tuple(machine for machine in self.kinds if isinstance(machine, MachineOnKind))

    def on(self, kind: str) -> MachineOnKind | NotOnKind:
        """The machine on one kind of bus.

        Raises
        ------
        KeyError
            The kind is not among those compared.
        """
        return {machine.name: machine for machine in self.kinds}[kind]

    def drawing(self) -> Drawing:
        """The most axes over the period, a curve for each kind of bus.

        Raises
        ------
        BusplanError
            No kind of bus can have the machine.
        """
        if not self.compared:
            raise BusplanError("there is nothing to draw: no kind of bus that was asked for can have this machine")
        # The slots of a dataclass make a new class, of which super() without arguments knows nothing.
        return Answer.drawing(self)

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.compare.report import compare_report

        return compare_report(self)


@with_its_constants
def compare(
    profile: ProfileLike,
    *,
    buses: str | Iterable[str] | None = None,
) -> CompareAnswer:
    """Put the machine of a profile on each kind of bus: `busplan compare`.

    Parameters
    ----------
    profile
        The profile: a `Profile`, a path or a shipped name. On its own kind it stays as it is.
    buses
        Name of a kind of bus or of a variant, as can-fd, or several; by default all, the profile's own first.

    Returns
    -------
    CompareAnswer
        Periods are in us. In a notebook it is a picture.

    Raises
    ------
    BusplanError
        Not a profile, or an unknown kind of bus.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.compare("paper-4ms", buses=["ieee1394", "can"])
    >>> [(kind.figures.verdict, kind.safe.axes, round(kind.smallest.us)) for kind in answer.kinds]
    [('fits', 52, 552), ('fits', 12, 2267)]
    >>> [term.key for term in answer.on("can").assumed if term.source == "new profile"]
    ['bus.bit_rate_kbit_s', 'bus.pipeline_cycles']
    """
    network = network_of(require_cycle(load_profile(profile), question="compare"))
    variants = {name: lines for kind in kind_names() for name, lines in kind_named(kind).starter.variants.items()}
    kinds = (*kind_names(), *variants)
    # A variant with a section of its own is another choice of a bus that stands here already.
    usual = (*kind_names(), *(name for name, lines in variants.items() if not lines.startswith("[bus]")))
    names = (network.bus.kind, *usual) if buses is None else [str(kind) for kind in one_or_several(buses, name="buses")]
    for name in names:
        if name not in kinds:
            near = did_you_mean(name, kinds)
            raise ArgumentError(f"buses {name}: no kind of bus; there are {', '.join(kinds)}{near and f'; {near}'}")
    # A variant that the profile has anyway is its own kind.
    title = variant_called(network.bus.title_of(network))
    is_own = {name for name in network.bus.starter.variants if name == title}
    machines = [_on_kind(network, name) for name in dict.fromkeys(names) if name not in is_own]
    smallest_us = [machine.smallest.us for machine in machines if isinstance(machine, MachineOnKind)]
    periods_us = _curve_periods(network.profile.cycle.period_us, smallest_us)
    with_curves = (
        machine if isinstance(machine, NotOnKind) else machine._replace(curve=tuple(_curve(machine, periods_us)))
        for machine in machines
    )
    return CompareAnswer(
        network.profile,
        int(network.nodes),
        int(network.axes),
        varied_nodes(network.profile).name,
        tuple(execution_sentence(network)),
        network.bus.key_of("wake-up"),
        tuple(with_curves),
    )


def _curve(machine: MachineOnKind, periods_us: Iterable[float]) -> Iterator[SafeAxes]:
    network = network_of(machine.profile)
    return (_most_axes(at_period(network, us), machine.best) for us in periods_us)


def _on_kind(network: Network, name: str) -> MachineOnKind | NotOnKind:
    kind, variant = kind_called(name), variant_called(name)
    try:
        conversion = converted(network.profile, kind, variant=variant)
    except BusplanError as error:
        bus = kind_named(kind)
        title = variant.replace("-", " ").upper() or bus.title
        return NotOnKind(name, kind, title, parts_tested(bus.evidence_data, of_kind=True), error.problems)
    on_kind, assumed = network_of(conversion.profile), conversion.assumed
    is_own = kind == network.bus.kind and not variant
    needed = {} if is_own else settings_to_be_carried(on_kind)
    if needed:
        tried = (AssumedKey(key, value, "setting") for key, value in needed.items())
        assumed = (*tried, *(assumption for assumption in assumed if assumption.key not in needed))
        on_kind = changed(on_kind, needed)
    smallest = smallest_period(on_kind, with_limits=False)
    # The profile's own kind is shown as it is set.
    best = None if is_own else best_register(on_kind, smallest)
    if best is not None:
        smallest = smallest_period(changed(on_kind, best.changes), with_limits=False)
    if is_own:
        assumed = tuple(AssumedKey(key, value_at(network.profile, key), "profile") for key in assumed_rates(network))
    bus = on_kind.bus
    capacity = cycle_figures(on_kind, model=bus.deciding_model)
    return MachineOnKind(
        name=name,
        profile=on_kind.profile,
        title=bus.title_of(on_kind),
        tested=parts_tested(bus.evidence_for(on_kind)),
        is_own=is_own,
        assumed=assumed,
        assumed_host=tuple(_assumed_host(on_kind, assumed, capacity)),
        left_out=conversion.left_out,
        of_host=conversion.of_host,
        execution="" if is_own else _execution(on_kind, network),
        figures=capacity,
        broken_limits=words_behind(capacity, on_kind),
        after_reset=after_reset(on_kind, capacity),
        safe=_most_axes(on_kind, best),
        smallest=smallest,
        curve=(),
        best=best,
    )


def _assumed_host(network: Network, assumed: Sequence[AssumedKey], figures: CycleFigures) -> Iterator[AssumedKey]:
    """Assumption about the host's own time, that of the profile included, where its cycle counts it."""
    key = network.bus.key_of("host")
    is_counted = any(doubt.us for doubt in figures.doubts if doubt.key == key)
    if is_counted and (host := given(network.profile, key)).grade == "assumed":
        of_kind = (assumption for assumption in assumed if assumption.key == key)
        yield next(of_kind, AssumedKey(key, host.value, "profile"))


def _execution(on_kind: Network, network: Network) -> str:
    """Meaning of the profile's execution times on another kind; empty where there is nothing to say."""
    is_in_profile = network.bus.has_execution(network)
    if not on_kind.bus.has_execution(on_kind):
        return "No execution time is in its cycle." if is_in_profile else ""
    title = network.bus.title_of(network)
    none = "" if is_in_profile else f"; no execution time is in the cycle of {title} as this profile sets it"
    assumed = f"Execution times are assumed to be as long as on {title}; here they are: {on_kind.bus.starter.base}"
    return f"{assumed}{none}."


def _most_axes(network: Network, best: SettingForPeriod | None) -> SafeAxes:
    """The most axes, as the network is set or with a setting that is free to change."""
    as_set = _safe_axes(network)
    if best is None:
        return as_set
    period_us = float(network.period_us)
    with_best = _safe_axes(at_period(changed(network, best.changes), period_us))
    return max(as_set, with_best, key=lambda safe: safe.nodes)


def _safe_axes(network: Network) -> SafeAxes:
    """Count the most axes that are shown to fit a network's period, on a bus that is set safely for them.

    Where nodes are in groups, the one with the most axes gets more nodes and the others stay.
    """
    profile = network.profile
    varied = varied_nodes(profile)
    nodes, limit = safe_nodes(network, group=varied.name)
    counted, safe = (int(number * varied.node.axes) for number in (varied.nodes, nodes))
    axes = axes_in_all(int(network.axes), counted=counted, safe=safe)
    return SafeAxes(profile.cycle.period_us, axes, nodes, limit)


def _curve_periods(own_us: float, smallest_us: Sequence[float | None]) -> tuple[float, ...]:
    """Periods about the smallest ones and the machine's own, which is among them [us]."""
    marks_us = [own_us, *(us for us in smallest_us if us is not None)]
    first, last = floor(log2(min(marks_us) / _ROUND_US)) - 1, ceil(log2(max(marks_us) / _ROUND_US)) + 1
    every = ceil((last - first + 1) / _MOST_POINTS)
    round_us = (_ROUND_US * 2.0**power for power in range(first, last + 1) if power % every == 0)
    return tuple(sorted({own_us, *(us for us in round_us if MIN_STEP_US <= us <= MAX_TIME_US)}))
