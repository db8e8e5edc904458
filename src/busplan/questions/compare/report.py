"""Answer of `busplan compare`: its blocks, and its document."""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.buses import kind_named
from busplan.buses.bus import Bus
from busplan.buses.figure import SAFE_AXES, VERDICT, Ink
from busplan.buses.network import Network
from busplan.buses.published import parts_tested
from busplan.elementwise import plain
from busplan.english import listed, nouns, plural
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
from busplan.forms.charts import Curve, Curves, Drawing, Entry, Guide, Panel, letters, logarithmic
from busplan.forms.numbers import period, period_value, sentence_text
from busplan.profile.conversion import AssumedKey
from busplan.profile.edit import short_text
from busplan.questions.base.sentences import (
    checked_against,
    document,
    execution_sentence,
    fields,
    parts_by,
    reset_sentence,
    with_profile,
)
from busplan.questions.compare import KindComparison, MachineOnKind, NotOnKind, SafeAxes, fitting
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS
from busplan.questions.fit.figures import limits_behind

_INKS: Final[tuple[Ink, ...]] = ("request", "contention", "work", "sync", "acknowledge", "response", "reserve")
"""Colours of the curves; each has a letter, too."""
_LEAST_TOP: Final = 10
CAPTION: Final = "Most axes that are shown to fit over the period, both logarithmic"


def compare_drawing(comparison: KindComparison, *, title: str) -> Drawing:
    """Draw the curves of a comparison in which some kind of bus can have the machine.

    Parameters
    ----------
    comparison
        The comparison.
    title
        Its message in a sentence.
    """
    compared, own_us = comparison.compared, comparison.profile.cycle.period_us
    own_axes = int(plain(comparison.network.axes))
    points = [point for machine in compared for point in machine.curve]
    periods_us, top = sorted({point.period_us for point in points}), max(point.axes or 1 for point in points)
    machine_now = Entry("own", f"this machine: {period(own_us)}, {plural(own_axes, 'axis')}", shape="line")
    marks = letters(machine.profile.bus.kind.upper() for machine in compared)
    plot = Curves(
        logarithmic("period, logarithmic", periods_us[0], periods_us[-1], period, at=periods_us, own=own_us),
        logarithmic("axes, logarithmic", 1, max(_LEAST_TOP, own_axes, top), lambda axes: f"{axes:.0f}"),
        tuple(
            _curve(machine, mark, _INKS[number % len(_INKS)])
            for number, (machine, mark) in enumerate(zip(compared, marks, strict=True))
        ),
        (Guide(machine_now, x=own_us), *([Guide(machine_now, y=own_axes)] if own_axes else [])),
    )
    return Drawing(title, (Panel(plot),), description=CAPTION)


def _curve(machine: MachineOnKind, mark: str, ink: Ink) -> Curve:
    """A point for each period that carries an axis; no axes have no place on a logarithmic scale."""
    points = [(point.period_us, point.axes) for point in machine.curve if point.axes]
    title = machine.network.bus.title
    label = f"{title}{' (this profile)' if machine.is_own else ''}{'' if points else ': none'}"
    return Curve(
        Entry(ink, label, mark, "line"),
        tuple(points),
        tuple(f"{title}: {plural(axes, 'axis')} at {period(us)}" for us, axes in points),
    )


_FIGURES = (
    *("timing_model", "verdict", "safe", "exceeded", "not_shown", "available_us", "required_us"),
    *("bias_us", "margin_corrected_us", "uncertainty_us", "binding_term"),
)
_SAFE = ("safe_nodes", "safe_axes", "safe_limited_by")


def compare_document(comparison: KindComparison) -> JsonDocument:
    """Document of `busplan compare --format json`."""
    network = comparison.network
    return document(
        "compare",
        profile=comparison.profile.name,
        kind=comparison.profile.bus.kind,
        period_us=comparison.profile.cycle.period_us,
        nodes=int(plain(network.nodes)),
        axes=int(plain(network.axes)),
        counted_group=comparison.counted or None,
        buses=[_bus_record(machine) for machine in comparison.kinds],
    )


def compare_records(comparison: KindComparison) -> list[Record]:
    """One row for each kind, for CSV, with the keys of its lists."""
    rows = []
    for record in map(_bus_record, comparison.kinds):
        lists = {key: [row["part"] for row in record[key]] for key in ("set_by", "tested")}
        assumed = [row["key"] for row in record.pop("assumed")]
        del record["curve"]
        rows.append({**record, **lists, "assumed": assumed})
    return with_profile(comparison.profile.name, rows)


def _bus_record(machine: MachineOnKind | NotOnKind) -> Record:
    """A kind of bus as plain data; what a kind that cannot have the machine lacks is null."""
    if isinstance(machine, NotOnKind):
        empty: Record = dict.fromkeys((*_FIGURES, "verdict_after_reset", *_SAFE, "smallest_period_us", "no_period"))
        lists: Record = {"assumed": [], "assumed_host": [], "left_out": [], "curve": []}
        return {**_head(machine.kind, is_own=False, why_not=list(machine.why)), **empty, **lists}
    bus = machine.network.bus
    return {
        **_head(bus.kind, is_own=machine.is_own, why_not=[]),
        **fields(machine.figures, *_FIGURES),
        "verdict_after_reset": None if machine.after_reset is None else machine.after_reset.verdict,
        **_safe_record(machine.safe),
        "smallest_period_us": machine.smallest.us,
        "no_period": None if machine.smallest.us else machine.smallest.need.why,
        "assumed": [fields(assumed, *assumed._fields) for assumed in machine.assumed],
        "assumed_host": [assumed.key for assumed in machine.assumed_host],
        "left_out": list(machine.left_out),
        "curve": [{"period_us": point.period_us, **_safe_record(point)} for point in machine.curve],
    }


def tested_record(bus: Bus) -> Record:
    """Parts of a kind's model that published figures set, that they test, and that they do not test."""
    tested_parts = parts_tested(bus.evidence_data)
    set_by, tested = map(parts_by, (tested_parts.set_by, tested_parts.parts))
    return {"set_by": set_by, "tested": tested, "not_tested": list(tested_parts.untested)}


def _head(kind: str, *, is_own: bool, why_not: list[str]) -> Record:
    bus = kind_named(kind)
    return {"kind": kind, "title": bus.title, "is_own": is_own, "why_not": why_not, **tested_record(bus)}


def _safe_record(safe: SafeAxes) -> Record:
    return dict(zip(_SAFE, (safe.nodes, safe.axes, safe.limited_by), strict=True))


def notes(comparison: KindComparison) -> Iterator[Sentence]:
    """Say of each kind what stands in the way and what nobody has tested, and what of the profile is left out.

    Parameters
    ----------
    comparison
        The comparison.
    """
    for machine in comparison.kinds:
        if isinstance(machine, NotOnKind):
            why = "; ".join(machine.why)
            yield Sentence((f"{kind_named(machine.kind).title} cannot have this machine: {why}.",), "warns")
        else:
            sentences = [
                *_obstacles(machine),
                *reset_sentence(machine.after_reset, machine.network),
                *_execution(machine, comparison.network),
                Sentence((f"Checked against {checked_against(machine.network.bus)}.",)),
            ]
            yield joined(Sentence((f"{machine.network.bus.title}:",)), *sentences)
    yield from _left_out(comparison)


def _left_out(comparison: KindComparison) -> Iterator[Sentence]:
    """Keys of the profile that are left out, once for the kinds that leave out the same."""
    titles: dict[tuple[str, ...], list[str]] = {}
    for machine in comparison.compared:
        if machine.left_out:
            titles.setdefault(machine.left_out, []).append(machine.network.bus.title)
    for left_out, names in titles.items():
        keys = joined(*(Sentence((Code(key),)) for key in left_out), by=", ")
        has_rate = any(key.startswith(("group.", "payload.")) and key.endswith(".every") for key in left_out)
        rates = " Data at a slower rate go in every cycle there." if has_rate else ""
        yield Sentence((f"Left out on {listed(names, 'and')}: ", *keys.parts, f".{rates}"))


def _obstacles(machine: MachineOnKind) -> Iterator[Sentence]:
    """The limits that are broken, and why no period is shown to fit."""
    broken = [limit.words(machine.network) for limit in limits_behind(machine.figures, machine.network)]
    if broken:
        yield Sentence((f"At {period(machine.figures.period_us)} {'; '.join(broken)}.",))
    if machine.smallest.us is None:
        yield Sentence((f"No period is shown to fit: {machine.smallest.need.why}.",))


def _execution(machine: MachineOnKind, network: Network) -> Iterator[Sentence]:
    """Meaning of the profile's execution times on other kinds."""
    if machine.is_own:
        return
    bus, title, is_in_profile = machine.network.bus, network.bus.title, network.bus.has_execution(network)
    if not bus.has_execution(machine.network):
        if is_in_profile:
            yield Sentence(("No execution time is in its cycle.",))
        return
    assumed = f"Execution times are assumed to be as long as on {title}; here they are: {bus.starter.base}"
    none = "" if is_in_profile else f"; no execution time is in the cycle of {title} as this profile sets it"
    yield Sentence((f"{assumed}{none}.",))


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
_ASSUMED: Final = (
    TableColumn("bus", kind="words"),
    TableColumn("key", kind="words", wraps=True),
    TableColumn("value", wraps=True),
    TableColumn("from", kind="words"),
)


def compare_report(comparison: KindComparison) -> Report:
    """Report of `compare`."""
    return Report(
        Sentence((Code(comparison.profile.name), " on each kind of bus")),
        tuple(_blocks(comparison)),
        compare_document(comparison),
        compare_records(comparison),
    )


def _blocks(comparison: KindComparison) -> Iterator[Block]:
    """How many kinds carry the machine, their figures, the picture, and what each rests on."""
    yield headline(comparison)
    yield from _best(comparison)
    yield from _remarks(comparison)
    yield kinds_table(comparison)
    if comparison.compared:
        yield compare_chart(comparison)
    yield from notes(comparison)
    yield from execution_sentence(comparison.network)
    if any(machine.assumed for machine in comparison.compared):
        yield assumed_table(comparison)


def headline(comparison: KindComparison) -> Sentence:
    """Say on how many kinds of bus the machine is shown to fit its period, and on which."""
    carrying = [machine.network.bus.title for machine in fitting(comparison)]
    of = len(comparison.kinds)
    where = f": {', '.join(carrying)}" if carrying else ""
    return sentence(
        f"{{}} at {{}}: shown to fit on {{}} of {{}} {nouns(of, 'kind')} of bus{where}.",
        Code(comparison.profile.name),
        period_value(comparison.profile.cycle.period_us),
        count_value(len(carrying)),
        count_value(of),
        state=state_of(carrying),
    )


def _best(comparison: KindComparison) -> Iterator[Sentence]:
    """Say which kind has the smallest period, and which the most axes, of those whose host's time is known."""
    ranked = [machine for machine in comparison.compared if not machine.assumed_host]
    shortest = [(machine.smallest.us, machine) for machine in ranked if machine.smallest.us is not None]
    if shortest:
        us, machine = min(shortest, key=lambda pair: pair[0])
        value = ShownValue(us, "smallest_period_us", "us", 3)
        yield sentence(f"The smallest period is {{}} on {machine.network.bus.title}.", value)
    most = [(machine.safe.axes, machine) for machine in ranked if machine.safe.axes]
    if most:
        axes, machine = max(most, key=lambda pair: pair[0])
        yield sentence(
            f"The most axes at {{}} are {{}} on {machine.network.bus.title}.",
            period_value(comparison.profile.cycle.period_us),
            count_value(axes, SAFE_AXES.key),
        )
    unranked = [
        f"{machine.network.bus.title} ({_words(machine.assumed_host)})"
        for machine in comparison.compared
        if machine.assumed_host
    ]
    if unranked:
        words = f"Not ranked, for the host's own time is assumed there: {listed(unranked, 'and')}."
        yield Sentence((words,), "warns")


def _words(assumed: Sequence[AssumedKey]) -> str:
    return ", ".join(f"{assumption.key} = {short_text(assumption.value)}" for assumption in assumed)


def _assumed(machine: MachineOnKind) -> str:
    """Values that a kind takes from a new profile or its own, with the number of its defaults."""
    new = [assumed for assumed in machine.assumed if assumed.source in ("new profile", "profile")]
    defaults = len(machine.assumed) - len(new)
    return ", ".join(filter(None, (_words(new), f"{defaults} {nouns(defaults, 'default')}" if defaults else ""))) or "-"


def _remarks(comparison: KindComparison) -> Iterator[Sentence]:
    """Say how axes are counted, and what the figures of other kinds rest on."""
    if comparison.counted:
        yield sentence(
            "Axes are counted with more nodes of {}, the other groups as they are.", Code(comparison.counted)
        )
    if any(not machine.is_own for machine in comparison.kinds if isinstance(machine, MachineOnKind)):
        words = "On another kind than its own the machine has the bus of a new profile, which is assumed."
        yield Sentence((words,), "warns")


def kinds_table(comparison: KindComparison) -> Table:
    """A row for each kind of bus.

    Parameters
    ----------
    comparison
        The comparison.
    """
    return Table(_COLUMNS, tuple(map(_row, comparison.kinds)), Sentence(("The machine on each kind of bus",)))


def _row(machine: MachineOnKind | NotOnKind) -> TableRow:
    if isinstance(machine, NotOnKind):
        empty = (ShownValue(None),) * (len(_COLUMNS) - 2)
        return TableRow((kind_named(machine.kind).title, Words("not compared", "warns"), *empty))
    figures = machine.figures
    cells: tuple[Cell, ...] = (
        f"{machine.network.bus.title}{', as it is' if machine.is_own else ''}",
        _verdict(machine),
        *(ShownValue(getattr(figures, key), key, "us", 3) for key in ("margin_corrected_us", "uncertainty_us")),
        machine.network.bus.figures.term_label(figures.binding_term),
        ShownValue(machine.smallest.us, "smallest_period_us", "us", 3),
        ShownValue(machine.safe.axes, SAFE_AXES.key),
        machine.safe.limited_by,
        _assumed(machine),
    )
    return TableRow(cells)


def _verdict(machine: MachineOnKind) -> Words:
    figures = machine.figures
    is_unsafe = not figures.safe and figures.verdict != DOES_NOT_FIT
    unsafe = f", unsafe {machine.network.bus.safety.setting}" if is_unsafe else ""
    is_well = figures.verdict == FITS and figures.safe
    return Words(f"{figures.verdict}{unsafe}", state_of(is_well))


def compare_chart(comparison: KindComparison) -> Chart:
    """The most axes over the period, a line for each kind of bus."""
    return Chart(compare_drawing(comparison, title=sentence_text(headline(comparison))), Sentence((CAPTION,)))


def assumed_table(comparison: KindComparison) -> Table:
    """Values that each kind needs and nobody knows; defaults are details.

    Parameters
    ----------
    comparison
        The comparison.
    """
    rows = [
        TableRow(
            (machine.network.bus.title, Code(assumed.key), short_text(assumed.value), assumed.source),
            is_detail=assumed.source == "default",
        )
        for machine in comparison.compared
        for assumed in machine.assumed
    ]
    words = "Assumed, by the profile, as a new profile of the kind has it or by default, until somebody knows better"
    return Table(_ASSUMED, tuple(rows), Sentence((words,)))
