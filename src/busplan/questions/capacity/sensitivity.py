"""Sensitivity of the margin: the effect of each small change, and the next bottleneck after the first."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import Any, Final, NamedTuple

from busplan.buses.cycle import BusCycle, Term
from busplan.buses.figure import MARGIN_CORRECTED, SAFE_NODES, VERDICT, by_key, unit_of
from busplan.buses.limits import BROKEN, NOT_SHOWN_KEPT, Perturbation
from busplan.buses.network import Network
from busplan.elementwise import existing, plain
from busplan.english import listed, nouns
from busplan.errors import BusplanError
from busplan.forms.blocks import (
    Block,
    Cell,
    Chart,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    count_value,
    figure_value,
    joined,
    sentence,
)
from busplan.forms.charts import Drawing, Entry, Guide, Lane, Lanes, Panel, Span, numbers
from busplan.forms.numbers import decimals_of, period_value, sentence_text
from busplan.questions.base.sentences import fields, with_profile
from busplan.questions.capacity import CapacityAnswer
from busplan.questions.capacity.report import capacity_report
from busplan.questions.fit.certainty import (
    FITS,
    TIME,
    VERDICTS,
    VerdictWord,
    available_us,
    certainty,
    fits_in,
    limit_codes,
    limits_behind,
    time_code,
    verdict_code,
)
from busplan.questions.fit.figures import safe_nodes
from busplan.questions.fit.network import changed, network_of, with_execution, with_payloads, without_execution
from busplan.sections.base import value_at, with_unchecked
from busplan.sections.machine import ProfileGroup


class NextLimit(NamedTuple):
    """Limit of the nodes of one group now, and the next limit after it; the other groups stay as they are."""

    group: str
    """Empty where all nodes are group."""
    safe_nodes: int
    """Most nodes that are shown to fit."""
    limited_by: str
    """Key of the limit that keeps them from being more."""
    next_safe_nodes: int
    """Most nodes without that limit."""
    next_limited_by: str
    """Key of the limit that keeps those from being more."""


class NextBottleneck(NamedTuple):
    """The bottleneck now and the next one after it, by the timing model that decides."""

    limits: tuple[NextLimit, ...]
    """One for each group of nodes."""
    binding_term: Term
    """The largest term of the cycle."""
    is_gone: bool
    """Whether something would take that term out of the cycle. If so, the figures below are of the cycle without it;
    else they are of the cycle as it is."""
    next_binding_term: Term
    """The largest of the other terms."""
    next_margin_corrected_us: float | None
    """Corrected margin without the largest term; None where nothing takes it out."""


def next_bottleneck(network: Network) -> NextBottleneck:
    """Find what binds a network once its first bottleneck is gone.

    A term is taken out at its cause, and the cycle is computed anew: without execution, for
    example, the bus is idle for longer.

    Parameters
    ----------
    network
        The network.
    """
    bus = network.bus
    cycle = bus.cycle(network, model=bus.deciding_model)
    binding = _largest(cycle)
    cycles = (bus.cycle(relieved, model=bus.deciding_model) for relieved in _relieved(network))
    without = next(
        (cycle for cycle in cycles if not any(plain(term.us) for term in cycle.terms if term.key == binding.key)), None
    )
    limits = []
    for group in network.names:
        nodes, limit = safe_nodes(network, group=group)
        limits.append(NextLimit(group, nodes, limit, *safe_nodes(network, group=group, without=limit)))
    return NextBottleneck(
        limits=tuple(limits),
        binding_term=binding,
        is_gone=without is not None,
        next_binding_term=_largest(without or cycle, but=binding.key),
        next_margin_corrected_us=None if without is None else plain(certainty(without).margin_corrected_us),
    )


def _relieved(network: Network) -> Iterator[Network]:
    """The network without each cause of a term that can be taken away."""
    yield without_execution(network)
    yield network._replace(nonperiodic_us=0.0)
    for changes in network.bus.term_removals:
        yield changed(network, changes)


def _largest(cycle: BusCycle, *, but: str = "") -> Term:
    return max((term for term in cycle.terms if term.key != but), key=lambda term: plain(term.us))


_EXECUTION_SHARE: Final = 0.1
_PAYLOAD_STEP_BYTES: Final = 4
"""A quadlet: payloads are padded to it."""


class Perturbed(NamedTuple):
    """A network with one small change."""

    change: str
    key: str
    """Key of the profile, or figure of `latency`, that changes."""
    before: Any
    """Value of the key before; None where groups differ."""
    after: Any
    network: Network | None
    """None where the change cannot be made."""
    note: str
    """Why it cannot be made, or why the margin stays as it is, where it does."""


def perturbed(network: Network) -> Iterator[Perturbed]:
    """Make every small change of a network, one at a time.

    Every kind of bus has 10 % more execution time, one node and one axis more of each group, four bytes more of every
    payload, and a bus reset; changes of one kind alone come before the reset.
    """
    bus = network.bus
    yield _slower(network, if_nothing="" if bus.has_execution(network) else "no execution time is on the bus")
    yield from (_one_node_more(network, group) for group in network.profile.node_groups)
    yield from (_one_axis_more(network, group) for group in network.profile.node_groups)
    yield _more_bytes(network)
    yield from (_with_keys(network, change) for change in bus.perturbations(network))
    if bus.safety.after_reset:
        reset = Perturbation("a bus reset", bus.safety.after_reset, if_nothing="it is set so already")
        yield _with_keys(network, reset)


def _slower(network: Network, *, if_nothing: str) -> Perturbed:
    factor = 1 + _EXECUTION_SHARE
    groups = tuple(
        with_execution(group, read_us=factor * group.read_execution_us, write_us=factor * group.write_execution_us)
        for group in network.groups
    )
    before, after = (
        _common_value(us for group in state for us in (group.read_execution_us, group.write_execution_us))
        for state in (network.groups, groups)
    )
    label = f"execution time +{_EXECUTION_SHARE:.0%}"
    return Perturbed(label, "execution_us", before, after, network._replace(groups=groups), if_nothing)


def _one_node_more(network: Network, group: ProfileGroup) -> Perturbed:
    more = group.nodes + 1
    then = network.varying(group.name).with_nodes(more)
    return Perturbed(f"one node more{_in(group)}", group.nodes_key, group.nodes, more, then, "")


def _one_axis_more(network: Network, group: ProfileGroup) -> Perturbed:
    key, axes = group.node_key("axes"), group.node.axes + 1
    then, unknown = _if_known(lambda: network_of(with_unchecked(network.profile, key, axes)))
    note = unknown or ("" if group.payload.follows_axes else "no payload follows the axes")
    return Perturbed(f"one axis more per node{_in(group)}", key, axes - 1, axes, then, note)


def _more_bytes(network: Network) -> Perturbed:
    sizes = [
        (group.read_bytes + _PAYLOAD_STEP_BYTES, group.write_bytes + _PAYLOAD_STEP_BYTES) for group in network.groups
    ]

    def change() -> Network:
        pairs = zip(network.groups, sizes, strict=True)
        return network._replace(
            groups=tuple(with_payloads(group, read_bytes=read, write_bytes=write) for group, (read, write) in pairs)
        )

    before = _common_value(size for group in network.groups for size in (group.read_bytes, group.write_bytes))
    changed, unknown = _if_known(change)
    after = _common_value(size for pair in sizes for size in pair)
    return Perturbed(f"payload +{_PAYLOAD_STEP_BYTES} bytes", "payload_bytes", before, after, changed, unknown)


def _with_keys(network: Network, perturbation: Perturbation) -> Perturbed:
    """A change that a kind of bus names by keys of the profile."""
    key, before, after = ", ".join(perturbation.changes), None, None
    if len(perturbation.changes) == 1:
        ((_, after),) = perturbation.changes.items()
        before = value_at(network.profile, key)
    if perturbation.why_not:
        return Perturbed(perturbation.label, key, before, None, None, perturbation.why_not)
    try:
        then = changed(network, perturbation.changes)
    except BusplanError as error:
        return Perturbed(perturbation.label, key, before, after, None, "; ".join(error.problems))
    return Perturbed(perturbation.label, key, before, after, then, perturbation.if_nothing)


def _if_known(change: Callable[[], Network]) -> tuple[Network | None, str]:
    """The network after a change, or why its execution time is not known."""
    try:
        return change(), ""
    except ValueError as error:
        return None, f"not known: {error}"


def _in(group: ProfileGroup) -> str:
    return f" in {group.name}" if group.name else ""


def _common_value(values: Iterable[Any]) -> Any:
    """The value that all share; None where they differ."""
    first, *rest = values
    return first if all(value == first for value in rest) else None


class Standing(NamedTuple):
    """Where a network stands under the timing model that decides."""

    margin_corrected_us: float
    uncertainty_us: float | None
    """None where nothing is known of it."""
    verdict: VerdictWord
    safe: bool
    """Whether the bus is set so that it works reliably."""
    exceeded: tuple[str, ...]
    """Keys of the limits that are broken."""
    not_shown: tuple[str, ...]
    """Keys of the limits that are neither broken nor shown to be kept, time among them."""


class Effect(NamedTuple):
    """Effect of one small change on the margin."""

    change: str
    """The change, in words."""
    key: str
    """A key of the profile, or a figure of `latency`."""
    before: Any
    """Value of the key before, in the key's unit; None where groups differ."""
    after: Any
    margin_change_us: float | None
    """By how much the corrected margin grows; None where the change cannot be made."""
    then: Standing | None
    """Where the network stands with the change."""
    note: str
    """Why the change cannot be made, or why the margin stays as it is, and which limits come nearer then."""


class Sensitivity(NamedTuple):
    """Effects of small changes on the margin at one period, by the timing model that decides."""

    network: Network
    """At that period."""
    timing_model: str
    now: Standing
    effects: tuple[Effect, ...]
    """The largest first; changes that cannot be made are the last."""
    next_bottleneck: NextBottleneck


def sensitivity_of(network: Network) -> Sensitivity:
    """Make every small change of a network, and compute its cycle anew.

    Parameters
    ----------
    network
        The network.
    """
    now = standing(network)
    effects = [_effect(change, now, network) for change in perturbed(network)]
    effects.sort(key=lambda effect: (effect.margin_change_us is None, -abs(effect.margin_change_us or 0.0)))
    return Sensitivity(network, network.bus.deciding_model, now, tuple(effects), next_bottleneck(network))


def standing(network: Network) -> Standing:
    """Compute where a network stands: what `capacity` says of a profile, of any network."""
    bus = network.bus
    cycle = bus.cycle(network, model=bus.deciding_model)
    sure, codes = certainty(cycle), limit_codes(network)
    broken = tuple(key for key, code in codes.items() if code == BROKEN)
    codes[TIME] = time_code(sure, network)
    late = not fits_in(cycle.required_us, available_us=available_us(network))
    return Standing(
        margin_corrected_us=plain(sure.margin_corrected_us),
        uncertainty_us=existing(sure.known_uncertainty_us),
        verdict=VERDICTS[int(verdict_code(codes))],
        safe=bus.is_safe(network),
        exceeded=(*broken, *((TIME,) if late else ())),
        not_shown=tuple(key for key, code in codes.items() if code == NOT_SHOWN_KEPT),
    )


def _effect(cause: Perturbed, now: Standing, network: Network) -> Effect:
    change_us, then = None, None
    if cause.network is not None:
        then = standing(cause.network)
        change_us = then.margin_corrected_us - now.margin_corrected_us
    notes = [] if change_us else [cause.note]
    if cause.network is not None and not change_us:
        notes += _nearer(network, cause.network)
    note = "; ".join(filter(None, notes))
    return Effect(cause.change, cause.key, cause.before, cause.after, change_us, then, note)


def _nearer(network: Network, changed: Network) -> Iterator[str]:
    """Say how much nearer a change comes to limits that are times, each with its doubt as a shown verdict has it."""
    for limit in network.bus.limits:
        if limit.doubt is None:
            continue
        left_us, then_us = (plain(limit.most(of)) - plain(limit.shown.value(of)) for of in (network, changed))
        if then_us < left_us and left_us > 0:
            yield f"it takes {left_us - then_us:.1f} us of the {left_us:.1f} us before the limit of {limit.key}"
        elif then_us < left_us:
            yield f"it adds {left_us - then_us:.1f} us to the {-left_us:.1f} us beyond the limit of {limit.key}"


_DECIMALS: Final = 3


def sensitivity_drawing(sensitivity: Sensitivity) -> Drawing | None:
    """Draw a bar for each change that can be made, on one scale; None if nothing moves the margin.

    Parameters
    ----------
    sensitivity
        Effects of small changes.
    """
    moved = [(effect.change, effect.margin_change_us) for effect in sensitivity.effects]
    changes = [(change, us) for change, us in moved if us is not None]
    least, most = (choose((us for _, us in changes), default=0.0) for choose in (min, max))
    least, most, left_us = min(least, 0.0), max(most, 0.0), sensitivity.now.margin_corrected_us
    if least == most:
        return None
    lanes = tuple(
        Lane(change, tuple(_bar(us)), f"{decimals_of(us, _DECIMALS, signed=True)} us", is_thin=True)
        for change, us in changes
    )
    guides = [Guide(Entry("zero"), x=0.0)]
    if least <= -left_us < 0:
        guides.append(Guide(Entry("edge", "nothing is left of the margin", shape="line"), x=-left_us))
    title = "What each small change does to the corrected margin"
    return Drawing(title, (Panel(Lanes(numbers("us", least, most), lanes, tuple(guides))),))


def _bar(us: float) -> Iterator[Span]:
    if us < 0:
        yield Span(Entry("takes", "takes from the margin"), us, 0.0)
    elif us > 0:
        yield Span(Entry("hides", "adds to it"), 0.0, us)


def next_bottleneck_sentence(bottlenecks: NextBottleneck, network: Network) -> Sentence:
    """Say what binds once the largest term, or the limit of the nodes, is gone.

    Parameters
    ----------
    bottlenecks
        The bottleneck now, and the next one.
    network
        The network.
    """
    labels = by_key(network.bus.figures.terms)
    term, behind = (labels[term.key].label for term in (bottlenecks.binding_term, bottlenecks.next_binding_term))
    term_us, behind_us, margin_us = (
        ShownValue(us, key, "us", 3)
        for us, key in (
            (bottlenecks.binding_term.us, "binding_term_us"),
            (bottlenecks.next_binding_term.us, "next_binding_term_us"),
            (bottlenecks.next_margin_corrected_us, "next_margin_corrected_us"),
        )
    )
    if bottlenecks.is_gone:
        text = f"Next bottleneck: without {term}, now {{}}, the largest term is {behind}, {{}}, and the margin {{}}"
        of_term = sentence(text, term_us, behind_us, margin_us)
    else:
        text = f"Next bottleneck: after {term}, {{}}, which no key takes away, comes {behind}, {{}}"
        of_term = sentence(text, term_us, behind_us)
    limits = map(_limit, bottlenecks.limits)
    return joined(joined(of_term, *limits, by="; "), Sentence((".",)), by="")


def _limit(limit: NextLimit) -> Sentence:
    """Say what limits the nodes, or those of a group, now and next."""
    of = f" of {limit.group}" if limit.group else ""
    return sentence(
        f"without the limit of {limit.limited_by}, now at {{}} {nouns(limit.safe_nodes, 'node')}{of}, the next limit "
        f"is {limit.next_limited_by}, at {{}} {nouns(limit.next_safe_nodes, 'node')}",
        count_value(limit.safe_nodes, SAFE_NODES.key),
        count_value(limit.next_safe_nodes, "next_safe_nodes"),
    )


def next_bottleneck_record(bottleneck: NextBottleneck, network: Network) -> Record:
    """Of the document: what binds now and next, with the sentence that says it."""
    return {
        "binding_term": bottleneck.binding_term.name,
        "binding_term_us": bottleneck.binding_term.us,
        "next_binding_term": bottleneck.next_binding_term.name,
        "next_binding_term_us": bottleneck.next_binding_term.us,
        "next_margin_corrected_us": bottleneck.next_margin_corrected_us,
        **_limits(bottleneck.limits),
        "text": sentence_text(next_bottleneck_sentence(bottleneck, network)),
    }


def _limits(limits: Sequence[NextLimit]) -> Record:
    """Limit of the nodes; of groups a list, and nothing for the whole."""
    records = [
        {
            "safe_limited_by": limit.limited_by,
            "safe_nodes": limit.safe_nodes,
            "next_safe_limited_by": limit.next_limited_by,
            "next_safe_nodes": limit.next_safe_nodes,
        }
        for limit in limits
    ]
    if not limits[0].group:
        return records[0]
    named = [{"name": limit.group, **record} for limit, record in zip(limits, records, strict=True)]
    return {**dict.fromkeys(records[0]), "groups": named}


_DIGITS = 4
"""Digits of what changes: enough to see a tenth of it."""


def sensitivity_report(answer: CapacityAnswer) -> Report:
    """Report of `capacity --sensitivity`."""
    report, sensitivities = capacity_report(answer), answer.sensitivities
    verdicts = [
        {
            **verdict,
            "sensitivity": [_record(effect, sensitivity.network) for effect in sensitivity.effects],
            "next_bottleneck": next_bottleneck_record(sensitivity.next_bottleneck, sensitivity.network),
        }
        for verdict, sensitivity in zip(report.document["verdicts"], sensitivities, strict=True)
    ]
    rows = [
        {
            "period_us": sensitivity.network.profile.cycle.period_us,
            "timing_model": sensitivity.timing_model,
            **_record(effect, sensitivity.network),
        }
        for sensitivity in sensitivities
        for effect in sensitivity.effects
    ]
    return report._replace(
        blocks=(*report.blocks, *chain.from_iterable(map(sensitivity_blocks, sensitivities))),
        document={**report.document, "verdicts": verdicts},
        records=with_profile(answer.profile.name, rows),
        is_card_enough=False,
    )


def sensitivity_blocks(sensitivity: Sensitivity) -> Iterator[Block]:
    """Effects of small changes at one period.

    Parameters
    ----------
    sensitivity
        The effects of all changes.
    """
    yield sensitivity_table(sensitivity)
    drawn = sensitivity_drawing(sensitivity)
    if drawn is not None:
        change = _capital(sensitivity.effects[0].change)
        sides = "a bar to the left takes from it, one to the right adds to it"
        yield Chart(drawn, Sentence((f"{change} moves the margin most; {sides}, in us",)))
    yield _headline(sensitivity)
    yield from (
        Sentence((f"{_capital(effect.change)}: {effect.note}.",)) for effect in sensitivity.effects if effect.note
    )
    yield next_bottleneck_sentence(sensitivity.next_bottleneck, sensitivity.network)


def sensitivity_table(sensitivity: Sensitivity) -> Table:
    """Every change with what it does to the margin, the largest effect first.

    Parameters
    ----------
    sensitivity
        The effects of all changes.
    """
    caption = sentence(
        f"What moves the margin of {{}} at {{}}, by the {sensitivity.timing_model} model",
        figure_value(MARGIN_CORRECTED, sensitivity.now.margin_corrected_us),
        period_value(sensitivity.network.profile.cycle.period_us),
    )
    columns = (
        TableColumn("what changes", kind="words"),
        TableColumn("from -> to", kind="words", rank=1),
        TableColumn("change", "us", group="margin"),
        TableColumn("then", "us", group="margin"),
        TableColumn("verdict then", kind="words", wraps=True),
    )
    rows = (TableRow(tuple(_cells(effect, sensitivity))) for effect in sensitivity.effects)
    return Table(columns, tuple(rows), caption)


def _cells(effect: Effect, sensitivity: Sensitivity) -> Iterator[Cell]:
    yield effect.change
    yield _step(effect)
    yield ShownValue(effect.margin_change_us, "margin_change_us", "us", 3, signed=True)
    then = None if effect.then is None else effect.then.margin_corrected_us
    yield figure_value(MARGIN_CORRECTED, then)
    yield _verdict(effect.then, sensitivity.network)


def _step(effect: Effect) -> Cell:
    """From which value to which; nothing where the change has no single one."""
    if effect.before is None or effect.after is None:
        return ""
    before = ShownValue(effect.before, effect.key, digits=_DIGITS)
    after = ShownValue(effect.after, effect.key, unit_of(effect.key), digits=_DIGITS)
    return sentence("{} -> {}", before, after)


def _verdict(then: Standing | None, network: Network) -> Cell:
    """The verdict with the limits that are broken, or that the bus is unsafe."""
    shown = figure_value(VERDICT, None if then is None else then.verdict)
    if then is None:
        return shown
    why = list(limits_behind(then))
    if not why and then.verdict == FITS and not then.safe:
        why = [f"unsafe {network.bus.safety.setting}"]
    is_well = then.verdict == FITS and then.safe
    return Sentence((shown, *(f", {reason}" for reason in why)), "neutral" if is_well else "fails")


def _headline(sensitivity: Sensitivity) -> Sentence:
    """Say which change moves the margin most, and after which ones all is no longer well."""
    first = sensitivity.effects[0]
    if not first.margin_change_us:
        return Sentence(("None of these changes moves the margin.",))
    then = None if first.then is None else first.then.margin_corrected_us
    most = sentence(
        f"{_capital(first.change)} moves the margin most, by {{}} to {{}}.",
        ShownValue(first.margin_change_us, "margin_change_us", "us", 3, signed=True),
        figure_value(MARGIN_CORRECTED, then),
    )
    return joined(most, *_after_each(sensitivity))


def _after_each(sensitivity: Sensitivity) -> Iterator[Sentence]:
    """Say what becomes of a cycle that is shown to fit."""
    if sensitivity.now.verdict != FITS:
        return
    made = [(effect.change, effect.then) for effect in sensitivity.effects if effect.then is not None]
    lost = [change for change, then in made if then.verdict != FITS]
    unsafe = [change for change, then in made if then.verdict == FITS and sensitivity.now.safe and not then.safe]
    if lost:
        yield Sentence((f"The cycle is no longer shown to fit after {listed(lost, 'or')}.",))
    if unsafe:
        yield Sentence((f"Its {sensitivity.network.bus.safety.setting} is unsafe after {listed(unsafe, 'or')}.",))
    if not lost and not unsafe:
        yield Sentence(("The cycle is shown to fit after each of them alone.",))


def _capital(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"


def _record(effect: Effect, network: Network) -> Record:
    then = effect.then
    safety = network.bus.safety.figure
    safe: dict[str, Any] = {} if safety is None else {safety.key: None if then is None else then.safe}
    return {
        "change": effect.change,
        "key": effect.key,
        "from": effect.before,
        "to": effect.after,
        "margin_change_us": effect.margin_change_us,
        **fields(then, "margin_corrected_us", "uncertainty_us", "verdict", "exceeded", "not_shown"),
        **safe,
        "note": effect.note or None,
    }
