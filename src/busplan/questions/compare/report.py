"""Answer of `busplan compare`: its blocks, and its document."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from busplan.buses import kind_named
from busplan.buses.bus import Bus
from busplan.buses.figure import SAFE_AXES, VERDICT
from busplan.buses.published import parts_tested
from busplan.elementwise import plain
from busplan.forms.blocks import (
    Block,
    Cell,
    Chart,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    Words,
    count_value,
    joined,
    sentence,
    state_of,
)
from busplan.forms.numbers import listed, nouns, period, period_value, sentence_text
from busplan.profile.conversion import AssumedKey
from busplan.profile.write import short_text
from busplan.questions.compare.drawing import STYLE, compare_lines, compare_svg
from busplan.questions.compare.kinds import (
    CircleAtSmallest,
    KindComparison,
    MachineOnKind,
    NotOnKind,
    SafeAxes,
    fitting,
)
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS, limits_behind
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.words.documents import document, fields, parts_by, with_profile
from busplan.questions.words.own_picture import OwnPicture
from busplan.questions.words.sentences import evidence_sentence, execution_sentence, refused_circle, reset_sentence
from busplan.sections.profile import Profile

_FIGURES = (
    *("timing_model", "verdict", "safe", "exceeded", "not_shown", "circle_refused_by", "available_us", "required_us"),
    *("bias_us", "margin_corrected_us", "uncertainty_us", "binding_term"),
)
_SAFE = ("safe_nodes", "safe_axes", "safe_limited_by")
_MEASURES = ("mean_contour_error_mm", "max_contour_error_mm", "circular_deviation_mm")


def compare_document(found: KindComparison) -> JsonDocument:
    """Document of `busplan compare --format json`."""
    network = network_of(found.profile)
    return document(
        "compare",
        profile=found.profile.name,
        kind=found.profile.bus.kind,
        period_us=found.profile.cycle.period_us,
        nodes=int(plain(network.nodes)),
        axes=int(plain(network.axes)),
        counted_group=found.counted or None,
        with_circle=found.with_circle,
        buses=[_bus_record(machine) for machine in found.kinds],
    )


def compare_records(found: KindComparison) -> list[Record]:
    """One row for each kind, for CSV: of the lists the keys, of the circle what was decided."""
    return with_profile(found.profile.name, [_flat(record) for record in map(_bus_record, found.kinds)])


def _flat(record: Record) -> Record:
    circle = record["circle"] or {"passed": None, "step_us": None}
    flat = {key: value for key, value in record.items() if key not in {"circle", "curve", "assumed"}}
    return {
        **flat,
        **{key: [one["part"] for one in record[key]] for key in ("set_by", "tested")},
        "assumed": [one["key"] for one in record["assumed"]],
        "circle_passed": circle["passed"],
        "circle_step_us": circle["step_us"],
    }


def _bus_record(one: MachineOnKind | NotOnKind) -> Record:
    """A kind of bus as plain data; what a kind that cannot have the machine lacks is null."""
    if isinstance(one, NotOnKind):
        empty: Record = dict.fromkeys(
            (*_FIGURES, "verdict_after_reset", *_SAFE, "smallest_period_us", "no_period", "circle")
        )
        lists: Record = {"assumed": [], "assumed_host": [], "left_out": [], "curve": []}
        return {**_head(one.kind, is_own=False, why_not=list(one.why)), **empty, **lists}
    bus = bus_of(one.profile)
    return {
        **_head(bus.kind, is_own=one.is_own, why_not=[]),
        **fields(one.figures, *_FIGURES),
        "verdict_after_reset": None if one.after_reset is None else one.after_reset.verdict,
        **_safe_record(one.safe),
        "smallest_period_us": one.smallest.us,
        "no_period": one.smallest.why or None,
        "circle": None if one.circle is None else _circle_record(one.circle),
        "assumed": [fields(assumed, *assumed._fields) for assumed in one.assumed],
        "assumed_host": [each.key for each in one.assumed_host],
        "left_out": list(one.left_out),
        "curve": [{"period_us": each.period_us, **_safe_record(each)} for each in one.curve],
    }


def tested_record(bus: Bus) -> Record:
    """Which parts of a kind figures of others set, which they test, and which they do not test."""
    found = parts_tested(bus.evidence_data)
    set_by, tested = map(parts_by, (found.set_by, found.parts))
    return {"set_by": set_by, "tested": tested, "not_tested": list(found.untested)}


def _head(kind: str, *, is_own: bool, why_not: list[str]) -> Record:
    bus = kind_named(kind)
    return {"kind": kind, "title": bus.title, "is_own": is_own, "why_not": why_not, **tested_record(bus)}


def _safe_record(safe: SafeAxes) -> Record:
    return dict(zip(_SAFE, (safe.nodes, safe.axes, safe.limited_by), strict=True))


def _circle_record(circle: CircleAtSmallest) -> Record:
    figures = circle.figures
    return {
        "step_us": circle.step_us,
        "passed": False if figures is None else figures.passed,
        **fields(figures, *_MEASURES),
        "problems": list(circle.problems),
    }


def notes(found: KindComparison) -> Iterator[Sentence]:
    """Say of each kind what stands in the way and what nobody has tested, and what of the profile is left out.

    Parameters
    ----------
    found
        The comparison.
    """
    for one in found.kinds:
        if isinstance(one, NotOnKind):
            why = "; ".join(one.why)
            yield Sentence((f"{kind_named(one.kind).title} cannot have this machine: {why}.",), "warns")
        else:
            said = [*_obstacles(one), *reset_sentence(one.after_reset, one.profile), *_circle_problems(one)]
            said += _execution(one, found.profile)
            said += evidence_sentence(bus_of(one.profile))
            if said:
                yield joined(Sentence((f"{bus_of(one.profile).title}:",)), *said)
    yield from _left_out(found)


def _left_out(found: KindComparison) -> Iterator[Sentence]:
    """What of the profile is left out, once for the kinds that leave out the same."""
    titles: dict[tuple[str, ...], list[str]] = {}
    for machine in found.compared:
        if machine.left_out:
            titles.setdefault(machine.left_out, []).append(bus_of(machine.profile).title)
    for left_out, names in titles.items():
        keys = joined(*(Sentence((Code(key),)) for key in left_out), by=", ")
        yield Sentence((f"Left out on {listed(names, 'and')}: ", *keys.parts, "."))


def _obstacles(one: MachineOnKind) -> Iterator[Sentence]:
    """The limits that are broken, and why no period is shown to fit."""
    bus, network = bus_of(one.profile), network_of(one.profile)
    broken = [limit.words(network) for limit in map(bus.limit, limits_behind(one.figures)) if limit]
    if broken:
        yield Sentence((f"At {period(one.figures.period_us)} {'; '.join(broken)}.",))
    if one.smallest.us is None:
        yield Sentence((f"No period is shown to fit: {one.smallest.why}.",))


def _circle_problems(one: MachineOnKind) -> Iterator[Sentence]:
    """Why the circle fails or cannot be run."""
    if one.circle is not None and one.circle.problems:
        at = f"{one.smallest.us:.3f} us"
        yield Sentence((f"The circle at {at}: {', and '.join(one.circle.problems)}.",))


def _execution(one: MachineOnKind, profile: Profile) -> Iterator[Sentence]:
    """What the execution times of the profile stand for."""
    bus, own = bus_of(one.profile), bus_of(profile)
    owns_any = own.has_execution(network_of(profile))
    if one.is_own:
        return
    if not bus.has_execution(network_of(one.profile)):
        if owns_any:
            yield Sentence(("No execution time is in its cycle.",))
        return
    said = f"Execution times are assumed to be as long as on {own.title}; here they are: {bus.starter.base}"
    none = "" if owns_any else f"; no execution time is in the cycle of {own.title} as this profile sets it"
    yield Sentence((f"{said}{none}.",))


_COLUMNS: Final = (
    TableColumn("bus", kind="words", wraps=True),
    TableColumn(VERDICT.label, kind="words", wraps=True),
    TableColumn("margin", "us"),
    TableColumn("U", "us"),
    TableColumn("largest term", kind="words", rank=1, leaves="below", wraps=True),
    TableColumn("smallest period", "us"),
    TableColumn("most", group="safe axes"),
    TableColumn("limited by", kind="words", group="safe axes", rank=3, leaves="below", wraps=True),
    TableColumn("assumed", kind="words", rank=2, leaves="below", wraps=True),
)
_CIRCLE: Final = (
    TableColumn("", kind="words", group="circle"),
    TableColumn("step", "us", group="circle"),
)
_CIRCLE_WORDS: Final = {
    True: Words("PASSED", "passes"),
    False: Words("FAILED", "fails"),
    None: Words("NOT JUDGED", "warns"),
}
_ASSUMED: Final = (
    TableColumn("bus", kind="words"),
    TableColumn("key", kind="words", wraps=True),
    TableColumn("value", wraps=True),
    TableColumn("from", kind="words"),
)


def compare_report(found: KindComparison) -> Report:
    """Report of `compare`."""
    return Report(
        Sentence((Code(found.profile.name), " on each kind of bus")),
        lambda: tuple(_blocks(found)),
        partial(compare_document, found),
        lambda: compare_records(found),
    )


def _blocks(found: KindComparison) -> Iterator[Block]:
    """How many kinds carry the machine, their figures, the picture, and what each rests on."""
    yield from refused_circle(found.profile)
    yield headline(found)
    yield from _best(found)
    yield from _remarks(found)
    yield kinds_table(found)
    if found.compared:
        yield compare_chart(found)
    yield from notes(found)
    yield from execution_sentence(found.profile)
    if any(machine.assumed for machine in found.compared):
        yield assumed_table(found)


def headline(found: KindComparison) -> Sentence:
    """Say on how many kinds of bus the machine is shown to fit its period, and on which."""
    carrying = [bus_of(one.profile).title for one in fitting(found)]
    of = len(found.kinds)
    where = f": {', '.join(carrying)}" if carrying else ""
    return sentence(
        f"{{}} at {{}}: shown to fit on {{}} of {{}} {nouns(of, 'kind')} of bus{where}.",
        Code(found.profile.name),
        period_value(found.profile.cycle.period_us),
        count_value(len(carrying)),
        count_value(of),
        state=state_of(carrying),
    )


def _best(found: KindComparison) -> Iterator[Sentence]:
    """Say which kind has the smallest period, and which the most axes, of those whose host's time is known."""
    ranked = [machine for machine in found.compared if not machine.assumed_host]
    shortest = [(one.smallest.us, one) for one in ranked if one.smallest.us is not None]
    if shortest:
        us, one = min(shortest, key=lambda each: each[0])
        value = ShownValue(us, "smallest_period_us", "us", 3)
        yield sentence(f"The smallest period is {{}} on {bus_of(one.profile).title}.", value)
    most = [(one.safe.axes, one) for one in ranked if one.safe.axes]
    if most:
        axes, one = max(most, key=lambda each: each[0])
        yield sentence(
            f"The most axes at {{}} are {{}} on {bus_of(one.profile).title}.",
            period_value(found.profile.cycle.period_us),
            count_value(axes, SAFE_AXES.key),
        )
    unranked = [
        f"{bus_of(machine.profile).title} ({_words(machine.assumed_host)})"
        for machine in found.compared
        if machine.assumed_host
    ]
    if unranked:
        words = f"Not ranked, for the host's own time is assumed there: {listed(unranked, 'and')}."
        yield Sentence((words,), "warns")


def _words(assumed: Sequence[AssumedKey]) -> str:
    return ", ".join(f"{one.key} = {short_text(one.value)}" for one in assumed)


def _assumed(one: MachineOnKind) -> str:
    """What a kind has of a new profile, with the number of its defaults."""
    new = [each for each in one.assumed if each.source == "new profile"]
    defaults = len(one.assumed) - len(new)
    return ", ".join(filter(None, (_words(new), f"{defaults} {nouns(defaults, 'default')}" if defaults else ""))) or "-"


def _remarks(found: KindComparison) -> Iterator[Sentence]:
    """Say how axes are counted, and what the figures of other kinds rest on."""
    if found.counted:
        yield sentence("Axes are counted with more nodes of {}, the other groups as they are.", Code(found.counted))
    if any(not machine.is_own for machine in found.kinds if isinstance(machine, MachineOnKind)):
        words = "On another kind than its own the machine has the bus of a new profile, which is assumed."
        yield Sentence((words,), "warns")


def kinds_table(found: KindComparison) -> Table:
    """A row for each kind of bus.

    Parameters
    ----------
    found
        The comparison.
    """
    columns = (*_COLUMNS, *(_CIRCLE if found.with_circle else ()))
    rows = (_row(machine, columns=len(columns), with_circle=found.with_circle) for machine in found.kinds)
    circle = " and its circle at the smallest period" if found.with_circle else ""
    return Table(columns, tuple(rows), Sentence((f"The machine on each kind of bus{circle}",)))


def _row(one: MachineOnKind | NotOnKind, *, columns: int, with_circle: bool) -> TableRow:
    if isinstance(one, NotOnKind):
        empty = (ShownValue(None),) * (columns - 2)
        return TableRow((kind_named(one.kind).title, Words("not compared", "warns"), *empty))
    figures = one.figures
    cells: tuple[Cell, ...] = (
        f"{bus_of(one.profile).title}{', as it is' if one.is_own else ''}",
        _verdict(one),
        *(ShownValue(getattr(figures, key), key, "us", 3) for key in ("margin_corrected_us", "uncertainty_us")),
        bus_of(one.profile).term_label(figures.binding_term),
        ShownValue(one.smallest.us, "smallest_period_us", "us", 3),
        ShownValue(one.safe.axes, SAFE_AXES.key),
        one.safe.limited_by,
        _assumed(one),
    )
    return TableRow((*cells, *(_circle(one) if with_circle else ())))


def _verdict(one: MachineOnKind) -> Words:
    figures = one.figures
    is_unsafe = not figures.safe and figures.verdict != DOES_NOT_FIT
    unsafe = f", unsafe {bus_of(one.profile).safety}" if is_unsafe else ""
    refused = ", circle cannot be run" if figures.circle_refused_by else ""
    is_well = figures.verdict == FITS and figures.safe and not refused
    return Words(f"{figures.verdict}{unsafe}{refused}", state_of(is_well))


def _circle(one: MachineOnKind) -> tuple[Cell, ...]:
    if one.circle is None:
        return Words("NOT RUN", "warns"), ShownValue(None, "step_us", "us")
    step = ShownValue(one.circle.step_us, "step_us", "us", 3)
    if one.circle.figures is None:
        return Words("NOT RUN", "warns"), step
    return _CIRCLE_WORDS[one.circle.figures.passed], step


def compare_chart(found: KindComparison) -> Chart:
    """The most axes over the period, a line for each kind of bus."""
    caption = "Most axes that are shown to fit over the period, both logarithmic"
    svg = partial(compare_svg, found, title=sentence_text(headline(found)), inline=True)
    return Chart(OwnPicture(svg, partial(compare_lines, found), stylesheet=STYLE), Sentence((caption,)))


def assumed_table(found: KindComparison) -> Table:
    """What each kind needs and the machine does not say; defaults are details.

    Parameters
    ----------
    found
        The comparison.
    """
    rows = [
        TableRow(
            (bus_of(one.profile).title, Code(assumed.key), short_text(assumed.value), assumed.source),
            is_detail=assumed.source == "default",
        )
        for one in found.compared
        for assumed in one.assumed
    ]
    words = "Assumed, as a new profile of the kind has it or by default, until somebody knows better"
    return Table(_ASSUMED, tuple(rows), Sentence((words,)))
