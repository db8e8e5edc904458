"""The verdict on one period, complete: figures, what it rests on, the change that mends or extends, and its lines."""

from dataclasses import dataclass
from typing import Final

from busplan.buses.cycle import LeftOut
from busplan.buses.network import Network
from busplan.buses.rule import contradicts
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.questions.fit.assumed import HeavyAssumption, heavy_assumptions
from busplan.questions.fit.certainty import FITS, limits_behind
from busplan.questions.fit.figures import CapacityFigures, FitFigures, after_reset, capacity_figures, figures
from busplan.questions.fit.network import changed
from busplan.questions.fit.node_limit import safe_nodes
from busplan.questions.plan.changes import NODES, Changes, cure
from busplan.questions.plan.needs import SmallestPeriod, missed_limits, smallest_period
from busplan.sections.base import MAX_COUNT


@dataclass(frozen=True)
class Change:
    """A change of a network, and its effect."""

    changes: Changes
    """New value by dotted key, the dearest change first."""
    nodes: int
    """Nodes that the change is made for."""
    figures: FitFigures
    """Whether it fits after it, under the model that decides."""
    safe_nodes: int | None
    """Most nodes that are shown to fit after it; None where groups differ."""
    safe_axes: int | None


@dataclass(frozen=True)
class Verdict:
    """Verdict on one period, by the timing model that decides."""

    network: Network
    """The network at its period."""
    period_us: float
    """None of a network without a cycle."""
    deciding: CapacityFigures
    """Figures of the timing model that decides, whatever was asked for."""
    others: tuple[CapacityFigures, ...]
    """Figures of the other models that were asked for."""
    broken_limits: tuple[str, ...]
    """By how much each limit of the bus is broken, or why it is not shown to be kept."""
    missed_limits: tuple[tuple[str, str], ...]
    """Keys of [limits] that the slice does not hold, each with why."""
    fastest: SmallestPeriod | None
    """The shortest period at which the verdict is that it fits; None of a network without a cycle."""
    after_reset: FitFigures | None
    """Figures after a bus reset; None unless the cycle is shown to fit now and not after the reset."""
    assumptions: tuple[HeavyAssumption, ...]
    """What carries much of the cycle or of its uncertainty, and is assumed."""
    left_out: tuple[LeftOut, ...]
    """What could add time to the cycle, and is not set."""
    premises: tuple[str, ...]
    """What the verdict rests on that no key says."""
    bus_lines: tuple[tuple[str, str], ...]
    """Lines of a card that only this kind of bus has."""
    warnings: tuple[str, ...]
    """What holds whatever the verdict."""
    change: Change | None
    """The change that mends what is wrong, or that carries one more node where the bus is full; None where there is
    room, or no change is enough."""
    no_change: str
    """Reason that no change is given where one was looked for."""

    @property
    def models_agree(self) -> bool | None:
        """Whether `fits` is the same under every model that was asked for; None where there is no other."""
        return all(figures.fits == self.deciding.fits for figures in self.others) if self.others else None

    @property
    def contradicting(self) -> tuple[CapacityFigures, ...]:
        """Figures of the models that say otherwise, and do not decide."""
        return tuple(figures for figures in self.others if contradicts(figures.fits, self.deciding))

    @property
    def all_well(self) -> bool:
        """Whether the cycle is shown to fit, on a safe bus, within [limits]."""
        return self.deciding.verdict == FITS and self.deciding.safe and not self.missed_limits

    @property
    def has_room(self) -> bool:
        """Whether more nodes of some group are shown to fit."""
        return any((count.safe_nodes or 0) > count.nodes for count in self.deciding.counts)


def verdict_of(network: Network, results: tuple[CapacityFigures, ...]) -> Verdict:
    """Judge a network at its period.

    Parameters
    ----------
    network
        The network.
    results
        Its figures under the timing models that were asked for.
    """
    bus = network.bus
    model = bus.deciding_model
    deciding = next((result for result in results if result.timing_model == model), None) or capacity_figures(
        network, model=model
    )
    cycle, period_us = bus.cycle(network, model=model), deciding.period_us
    ratio = float(plain(network.slice_ratio))
    missed = {need.key: need.words(ratio=ratio, most_us=period_us) for need in missed_limits(network)}
    change, no_change = _change(network, deciding, is_missed=bool(missed))
    return Verdict(
        network=network,
        period_us=period_us,
        deciding=deciding,
        others=tuple(result for result in results if result is not deciding),
        broken_limits=tuple(
            limit.words(network) for key in limits_behind(deciding) if (limit := bus.limit(key)) is not None
        ),
        missed_limits=tuple(missed.items()),
        fastest=smallest_period(network, is_safe=False, with_limits=False) if network.groups else None,
        after_reset=after_reset(network, deciding),
        assumptions=heavy_assumptions(deciding, network),
        left_out=cycle.left_out(),
        premises=cycle.premises(),
        bus_lines=cycle.card_lines(),
        warnings=tuple(bus.warnings(network, nodes=[n for n in (deciding.nodes, deciding.safe_nodes or 0) if n])),
        change=change,
        no_change=no_change,
    )


_FULL: Final = f"{MAX_COUNT} nodes are the most of a profile"


def _change(network: Network, now: CapacityFigures, *, is_missed: bool) -> tuple[Change | None, str]:
    """The change that mends what is wrong or, where a bus is full, carries another node; and why there is none."""
    if now.verdict != FITS or not now.safe or is_missed:
        target = network
    elif now.safe_nodes is None or now.safe_nodes > now.nodes:
        return None, ""  # there is room, or nobody said which of the groups is to grow
    elif now.safe_nodes == MAX_COUNT:
        return None, _FULL
    else:
        try:
            target = changed(network, {NODES: now.safe_nodes + 1})
        except BusplanError as error:
            return None, str(error)
    found = cure(target)
    if found.changes is None:
        return None, found.why
    after = changed(target, found.changes)
    model = network.bus.deciding_model
    most = safe_nodes(after)[0] if after.is_uniform else None
    axes = None if most is None else most * int(after.profile.node.axes)
    return Change(found.changes, int(plain(target.nodes)), figures(after, model=model), most, axes), ""
