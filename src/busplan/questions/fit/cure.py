"""Changes that a network may have, and those with which it holds every constraint of a plan."""

from bisect import bisect_left
from collections.abc import Collection, Iterator, Mapping, Sequence
from decimal import ROUND_CEILING, Context, Decimal
from functools import cached_property
from itertools import product
from math import ceil, inf
from typing import Final, NamedTuple, Self, TypeAlias

from busplan.buses.network import Network
from busplan.buses.parts import Cost, Value
from busplan.elementwise import FIT_ROUNDING
from busplan.errors import ArgumentError, BusplanError
from busplan.questions.fit.figures import FitFigures
from busplan.questions.fit.graded import HeavyAssumption, heavy_assumptions
from busplan.questions.fit.needs import (
    Need,
    SmallestPeriod,
    most_asking,
    needs_of,
    rooms,
    smallest_period,
    to_be_shown,
    unmet,
)
from busplan.questions.fit.network import PERIOD, at_period, changed
from busplan.sections.base import MAX_TIME_US, TRANSACTION_KINDS, TransactionKind
from busplan.sections.machine import ProfileGroup
from busplan.sections.profile import Profile

Changes: TypeAlias = Mapping[str, Value]
"""New values of a profile by dotted key."""
NODES: Final = "bus.nodes"
"""Key of the number of nodes, where all are alike."""
RATIO: Final = "cycle.slice_ratio"
MOST_RATIO: Final = 0.9
"""Largest slice ratio that is advised: the host computes in the rest of the period. Chosen."""
_RATIO_STEPS: Final = 100
_PERIOD_DIGITS: Final = 3
"""Significant digits of a period that is advised."""
_ASKED_FOR: Final = (Cost.PAYLOAD, Cost.NODES)
"""Costs of what changes what the machine does, and so is free only where a plan is asked to."""
_PAYLOADS: Final = tuple(f"{kind}_bytes{part}" for kind in TRANSACTION_KINDS for part in ("", "_per_axis"))


class SettingForPeriod(NamedTuple):
    """A setting that only a number in the nodes has to change for, and the smallest period with it."""

    changes: Changes
    """New value by dotted key."""
    period_us: float


_WORTHWHILE: Final = 0.99
"""Share of the smallest period from which on a shorter one is not worth a word."""


class Variants:
    """Needs of a network, as it is and after changes: found once for networks that differ in their period alone."""

    def __init__(self, network: Network) -> None:
        self.network = network
        """The network; its own period plays no part."""
        self._after: dict[frozenset[tuple[str, Value]], Variants | None] = {}
        self._assumptions: tuple[HeavyAssumption, ...] | None = None

    def after(self, changes: Changes) -> "Variants | None":
        """The variants of the network after changes; None where its schema refuses them."""
        new = {key: value for key, value in changes.items() if key != PERIOD}
        if not new:
            return self
        known = frozenset(new.items())
        if known not in self._after:
            try:
                self._after[known] = Variants(changed(self.network, new))
            except BusplanError:
                self._after[known] = None
        return self._after[known]

    def assumptions(self, figures: FitFigures) -> tuple[HeavyAssumption, ...]:
        """Assumptions with a large share of the required time or of its variance, from the figures at any period."""
        if self._assumptions is None:
            self._assumptions = heavy_assumptions(figures, self.network)
        return self._assumptions

    @cached_property
    def needs(self) -> tuple[Need, ...]:
        """All that a plan asks of the period."""
        return needs_of(self.network)

    @cached_property
    def smallest(self) -> SmallestPeriod:
        """The smallest period at which every constraint of a plan holds."""
        return smallest_period(self.network)

    @cached_property
    def fastest(self) -> SmallestPeriod:
        """The smallest period at which the network is shown to fit."""
        return smallest_period(self.network, is_safe=False, with_limits=False)

    @cached_property
    def best_register(self) -> SettingForPeriod | None:
        """The setting of a register that makes the smallest period the shortest; None if none is worthwhile."""
        return best_register(self.network, self.fastest)


class AtPeriod(NamedTuple):
    """A network at its period, and what it shares with itself at other periods."""

    network: Network
    variants: Variants

    @classmethod
    def of(cls, network: Network, variants: Variants | None = None) -> Self:
        """A network, with what is known of it at other periods."""
        return cls(network, variants or Variants(network))

    def after(self, changes: Changes) -> Self | None:
        """The network after changes; None where its schema refuses them."""
        after = self.variants.after(changes)
        if after is None:
            return None
        if after is self.variants and PERIOD not in changes:
            return self
        return type(self)(at_period(after.network, float(changes.get(PERIOD, self.network.period_us))), after)

    def unmet(self) -> list[Need]:
        """Needs that it does not meet at its period."""
        return unmet(self.network, self.variants.needs)

    def holds(self, changes: Changes | None) -> bool:
        """Whether every constraint of a plan holds after changes."""
        after = self.after(changes) if changes else None
        return after is not None and not after.unmet()


def best_register(network: Network, now: SmallestPeriod) -> SettingForPeriod | None:
    """Setting of a register with the shortest smallest period; None if none is worthwhile.

    `now` is the network's smallest period as it is set; its own period plays no part.
    """
    variants = Variants(network)
    settings = [setting for setting in network.bus.settings(network) if setting.cost == Cost.REGISTER]
    trials = [(values, variants.after(values)) for setting in settings for values in setting.values]
    found = [
        SettingForPeriod(values, least.us)
        for values, trial in trials
        if trial is not None and (least := smallest_period(trial.network, with_limits=False)).us is not None
    ]
    best = min(found, key=lambda trial: trial.period_us, default=None)
    return best if best and best.period_us < _WORTHWHILE * (now.us or inf) else None


class Freedom(NamedTuple):
    """One thing that a plan may change."""

    name: str
    label: str
    cost: Cost
    keys: tuple[str, ...]

    def is_meant(self, name: str) -> bool:
        """Whether a name is its own, or one of its keys as a profile writes them."""
        return name == self.name or name in self.keys


class PlanStep(NamedTuple):
    """A step of a plan: what was freed, and the changes that came nearest."""

    freedom: Freedom | None
    """The freedom that was used last; None for the network as it is."""
    changes: Changes
    """All changes so far by dotted key, the last freedom first."""
    unmet: tuple[Need, ...]
    """Constraints that do not hold with them."""


def freedoms(network: Network) -> tuple[Freedom, ...]:
    """Everything that may be changed in a network, the cheapest first."""
    all_freedoms = [
        Freedom(setting.name, setting.label, setting.cost, setting.keys) for setting in network.bus.settings(network)
    ]
    if network.groups:
        sections = [f"group.{group.name}" for group in network.profile.group] or ["payload"]
        payloads = tuple(f"{section}.{key}" for section in sections for key in _PAYLOADS)
        all_freedoms += (
            Freedom("slice_ratio", "slice ratio", Cost.HOST_TIME, (RATIO,)),
            Freedom("payload", "payload", Cost.PAYLOAD, payloads),
            Freedom("period", "period", Cost.PERIOD, (PERIOD,)),
        )
        if network.is_uniform:
            # Where nodes differ, nobody but the user knows which can go.
            all_freedoms.append(Freedom("nodes", "nodes", Cost.NODES, (NODES,)))
    return tuple(sorted(all_freedoms, key=lambda freedom: freedom.cost))


def freed(network: Network, names: Sequence[str] | None = None, *, kept: Collection[str] = ()) -> tuple[Freedom, ...]:
    """Freedoms of a plan, the cheapest first.

    `names` are freedoms, or keys that one of them changes; None for all but payload and nodes. `kept` are keys that
    were given a value, which stays. BusplanError: the network has no such freedom, or its value was given.
    """
    possible = freedoms(network)
    still = [freedom for freedom in possible if not set(freedom.keys) <= set(kept)]
    if names is None:
        return tuple(freedom for freedom in still if freedom.cost not in _ASKED_FOR)
    kind = f"{network.profile.bus.kind} with groups" if network.profile.group else network.profile.bus.kind
    problems = [
        f"free {name}: there is nothing of that name to free on a bus of kind {kind}; there are "
        f"{', '.join(freedom.name for freedom in possible)}, or their keys"
        for name in names
        if not any(freedom.is_meant(name) for freedom in possible)
    ]
    problems += [
        f"free {freedom.name}: {' and '.join(key for key in freedom.keys if key in kept)} was given a value, which is "
        "kept; give one of them"
        for freedom in possible
        if any(map(freedom.is_meant, names)) and freedom not in still
    ]
    if problems:
        raise ArgumentError(*problems)
    return tuple(freedom for freedom in still if any(map(freedom.is_meant, names)))


def search(
    network: Network, levels: Sequence[Freedom], *, kept: Collection[str] = (), variants: Variants | None = None
) -> list[PlanStep]:
    """Change one thing at a time, the cheapest first, until every constraint of a plan holds.

    Of each thing the least change that is enough is taken; where none is, the one that comes nearest, and the next
    thing is changed beside it. In the end, what is not needed beside the last change is left as it was. The last of the
    returned steps holds, or nothing of the `levels` is enough. `variants` are those of the same network at another
    period, if they are known.
    """
    now = start = AtPeriod.of(network, variants)
    steps = [PlanStep(None, {}, tuple(start.unmet()))]
    changes: list[Changes] = []
    for freedom in levels:
        needs = list(steps[-1].unmet)
        if not needs:
            break
        nearest, reached = None, now
        for change in _values(freedom, now, kept):
            if set(change) & set(kept) or (after := now.after(change)) is None:
                continue
            still = after.unmet()
            if not still or _lack(still, after.network) < _lack(needs, reached.network):
                nearest, needs, reached = change, still, after
            if not still:
                break
        if nearest:
            changes.append(nearest)
            now = _with(start, changes)
        steps.append(PlanStep(freedom, _together(changes), tuple(needs)))
    if not steps[-1].unmet and len(changes) > 1:
        steps[-1] = steps[-1]._replace(changes=_together(_needed(start, changes)))
    return steps


def _needed(start: AtPeriod, changes: list[Changes]) -> list[Changes]:
    """The changes without those that are not needed beside the last, the dearest first."""
    left = list(changes)
    for change in changes[-2::-1]:
        fewer = [kept for kept in left if kept is not change]
        if not _with(start, fewer).unmet():
            left = fewer
    return left


def _together(changes: Sequence[Changes]) -> Changes:
    return {key: value for change in reversed(changes) for key, value in change.items()}


def _with(start: AtPeriod, changes: Sequence[Changes]) -> AtPeriod:
    """The network after changes of which each was possible beside those before it."""
    after = start.after(_together(changes))
    if after is None:
        raise RuntimeError(f"{_together(changes)}: refused together, and not one by one")
    return after


def _lack(needs: Sequence[Need], network: Network) -> tuple[int, float]:
    """Distance of a network from all constraints: those that no period mends, and the period for the rest [us]."""
    periods_us = [need.period_us(float(network.slice_ratio)) for need in needs]
    return periods_us.count(inf), max((us for us in periods_us if us < inf), default=0.0)


def _values(freedom: Freedom, now: AtPeriod, kept: Collection[str]) -> Iterator[Changes]:
    """Values of a network, the least change first, beside keys that must stay.

    Where none is enough, what helps most is among them.
    """
    match freedom.name:
        case "slice_ratio":
            return _ratios(now)
        case "payload":
            return _payloads(now, kept)
        case "period":
            return _periods(now)
        case "nodes":
            return _fewer_nodes(now)
    # A setting of the bus is safe for all nodes that [limits] asks for.
    network = now.network
    largest = max((network, *(room.network for room in rooms(network))), key=lambda room: float(room.nodes))
    settings = (setting for setting in network.bus.settings(largest) if setting.name == freedom.name)
    return (values for setting in settings for values in setting.values)


def _ratios(now: AtPeriod) -> Iterator[Changes]:
    """The smallest slice ratio that gives the time that is needed, and no more than is advised."""
    own, period_us = float(now.network.slice_ratio), float(now.network.period_us)
    slice_us = max((need.slice_us for need in now.unmet() if need.slice_us < inf), default=0.0)
    ratio = min(ceil(_RATIO_STEPS * slice_us / period_us * (1 - FIT_ROUNDING)) / _RATIO_STEPS, MOST_RATIO)
    if ratio > own:
        yield {RATIO: ratio}


def _payloads(now: AtPeriod, kept: Collection[str]) -> Iterator[Changes]:
    """The largest payload with which all constraints hold, or the smallest one: the larger of read and write is cut."""
    network, profile = now.network, now.network.profile
    payloads = network.bus.payloads(network)
    cuts = [_cut(group, kind) for group, kind in product(profile.node_groups, TRANSACTION_KINDS)]
    step = max(payloads.step_bytes, min((size for key, size in cuts if key not in kept), default=1))
    most = min(int(network.largest_payload_bytes) - 1, payloads.most_bytes)
    sizes = range(step, most + 1, step)
    # Too small sizes cannot be cut to, large ones cut nothing.
    first = bisect_left(sizes, x=True, key=lambda size: _cut_to(profile, size, kept) is not None)
    sizes = sizes[first : bisect_left(sizes, x=True, key=lambda size: _cut_to(profile, size, kept) == {})]
    # No more bytes are needed where fewer are not enough, but where a table of execution times falls.
    fits = bisect_left(sizes, x=True, key=lambda size: not now.holds(_cut_to(profile, size, kept)))
    yield from (
        (change for size in (sizes[max(fits - 1, 0)], sizes[0]) if (change := _cut_to(profile, size, kept)))
        if sizes
        else ()
    )


def _cut_to(profile: Profile, most_bytes: int, kept: Collection[str]) -> Changes | None:
    """The change to payloads of so many bytes or less; empty where they are, None where that cannot be."""
    changes: dict[str, Value] = {}
    for group, kind in product(profile.node_groups, TRANSACTION_KINDS):
        over, (key, bytes_cut) = int(group.bytes_of(kind)) - most_bytes, _cut(group, kind)
        if over > 0 and key not in kept:
            now = getattr(group.payload, key.rpartition(".")[2])
            if now is None:  # it is given by the bytes of each PDO
                return None
            changes[key] = now - ceil(over / bytes_cut)
    return changes if all(int(value) > 0 for value in changes.values()) else None


def _cut(group: ProfileGroup, kind: TransactionKind) -> tuple[str, int]:
    """The key that a payload is cut by, and what a byte of it takes away [bytes]; without axes it is the fixed part."""
    key, axes = group.payload_key(kind), int(group.node.axes)
    return (key, axes) if axes and key.endswith("_per_axis") else (key.removesuffix("_per_axis"), 1)


def _periods(now: AtPeriod) -> Iterator[Changes]:
    """The period nearest to the own one at which all constraints hold: rounded up, or the next that the bus allows."""
    least_us = now.variants.smallest.us
    if least_us is None:
        return
    periods, own_us = now.network.bus.periods, float(now.network.period_us)
    if periods.us:
        allowed = (us for us in periods.us if us >= least_us)
        yield from ({PERIOD: us} for us in sorted(allowed, key=lambda us: abs(us - own_us)))
    else:
        yield {PERIOD: min(rounded_period_us(max(least_us, own_us)), MAX_TIME_US)}


def rounded_period_us(us: float) -> float:
    """A period rounded up to three significant digits, float rounding aside [us].

    Examples
    --------
    >>> rounded_period_us(1087.2), rounded_period_us(123.4), rounded_period_us(1100.0)
    (1090.0, 124.0, 1100.0)
    """
    context = Context(prec=_PERIOD_DIGITS, rounding=ROUND_CEILING)
    return float(context.create_decimal(Decimal(us * (1 - FIT_ROUNDING))))


def _fewer_nodes(now: AtPeriod) -> Iterator[Changes]:
    """The most nodes, fewer than now, with which all constraints hold; no constraint is eased by nodes."""
    counts = range(int(now.network.nodes) - 1, 0, -1)
    place = bisect_left(counts, x=True, key=lambda nodes: now.holds({NODES: nodes}))
    if counts:
        yield {NODES: counts[min(place, len(counts) - 1)]}


class Cure(NamedTuple):
    """The change after which a network holds every constraint of a plan."""

    changes: Changes | None
    """New value by dotted key, the dearest change first; empty if nothing is to change, None if no change is enough."""
    why: str = ""
    """Reason that no change is enough."""


def cure(network: Network, variants: Variants | None = None) -> Cure:
    """The change that mends a network, with the default freedoms of a plan.

    `variants` are those of the same network at another period, if they are known.
    """
    steps = search(network, freed(network), variants=variants)
    last = steps[-1]
    return Cure(None, stands_in_the_way(network, last).why) if last.unmet else Cure(last.changes)


def stands_in_the_way(network: Network, step: PlanStep) -> Need:
    """The constraint that a step does not hold, with its words."""
    ratio = float(step.changes.get(RATIO, network.slice_ratio))
    period_us = float(step.changes.get(PERIOD, network.period_us))
    need = most_asking(step.unmet, ratio=ratio)
    return need._replace(why=need.words(ratio=ratio, most_us=period_us))


def changeable(network: Network) -> tuple[str, ...]:
    """Settings that a plan may change unasked, in words, the cheapest first."""
    return tuple(freedom.label for freedom in freed(network))


def nodes_for_axes(profile: Profile, axes: int) -> int:
    """Nodes for a number of axes, with the axes of each node as in the profile [1].

    BusplanError: nodes differ, so that axes do not say how many of which.
    """
    if profile.group:
        now = {group: int(group.nodes) * int(group.node.axes) for group in profile.node_groups}
        needed = {group: axes - sum(now.values()) + now[group] for group in now if group.node.axes}
        ways = " or ".join(
            f"--set {group.nodes_key}={ceil(of_group / int(group.node.axes))}"
            for group, of_group in needed.items()
            if of_group > 0
        )
        instead = f"say {ways}" if ways else "set the nodes of a group instead"
        raise ArgumentError(f"axes {axes}: the nodes of {profile.name} differ; {instead}")
    (group,) = profile.node_groups
    return ceil(axes / int(group.node.axes))


def settings_to_be_carried(network: Network) -> Changes:
    """The cheapest setting of the bus with which some slice carries the network, where none does now; else empty."""
    variants = Variants(network)

    def is_carried(trial: Variants | None) -> bool:
        return trial is not None and all(need.period_us(1.0) < inf for need in to_be_shown(trial.network))

    if is_carried(variants):
        return {}
    settings = sorted(network.bus.settings(network), key=lambda setting: setting.cost)
    changes = (dict(values) for setting in settings for values in setting.values)
    return next((change for change in changes if is_carried(variants.after(change))), {})
