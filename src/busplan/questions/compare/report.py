"""Answer of `busplan compare`: its blocks, and its document."""

from collections.abc import Iterator, Sequence
from itertools import cycle
from typing import Final

from busplan.buses.figure import SAFE_AXES, VERDICT, Ink
from busplan.english import listed, nouns, plural
from busplan.forms import blocks, charts
from busplan.forms.numbers import period, period_value, sentence_text
from busplan.profile.conversion import AssumedKey
from busplan.profile.edit import short_text
from busplan.questions.base.sentences import (
    checked_against,
    document,
    fields,
    margin_parts,
    parts_by,
    reset_sentence,
    with_profile,
)
from busplan.questions.compare import CompareAnswer, MachineOnKind, NotOnKind, SafeAxes
from busplan.questions.fit.certainty import DOES_NOT_FIT

_INKS: Final[tuple[Ink, ...]] = ("request", "contention", "work", "sync", "acknowledge", "response", "reserve")
"""Colours of the curves; each has a letter, too."""
_LEAST_TOP: Final = 10
_CAPTION: Final = "Most axes that are shown to fit over the period, both logarithmic"
_COLUMNS: Final = (
    blocks.TableColumn("bus", kind="words", wraps=True),
    blocks.TableColumn("smallest period", "us"),
    blocks.TableColumn("most", group="safe axes"),
    blocks.TableColumn("limited by", kind="words", group="safe axes", rank=3, wraps=True),
    blocks.TableColumn(VERDICT.label, kind="words", wraps=True),
    blocks.TableColumn("margin", "us"),
    blocks.TableColumn("largest term", kind="words", rank=1, leaves="below", wraps=True, is_detail=True),
    blocks.TableColumn("assumed", kind="words", rank=2, leaves="below", wraps=True, is_detail=True),
)
_ASSUMED: Final = (
    blocks.TableColumn("bus", kind="words"),
    blocks.TableColumn("key", kind="words", wraps=True),
    blocks.TableColumn("value", wraps=True),
    blocks.TableColumn("from", kind="words"),
)
_FIGURES: Final = (
    *("timing_model", "verdict", "safe", "exceeded", "not_shown", "available_us", "required_us"),
    *("bias_us", "margin_corrected_us", "uncertainty_us", "binding_term"),
)
_SAFE: Final = ("safe_nodes", "safe_axes", "safe_limited_by")


def compare_report(answer: CompareAnswer) -> blocks.Report:
    """Report of `compare`: how many kinds carry the machine, their figures, the picture, and what each rests on."""
    records = [_record(machine) for machine in answer.kinds]
    return blocks.Report(
        blocks.Sentence((blocks.Code(answer.profile.name), " on each kind of bus")),
        tuple(_blocks(answer)),
        document(
            "compare",
            profile=answer.profile.name,
            kind=answer.profile.bus.kind,
            period_us=answer.profile.cycle.period_us,
            **fields(answer, "nodes", "axes"),
            group=answer.counted or None,
            buses=records,
        ),
        with_profile(answer.profile.name, [_row_of_lists(record) for record in records]),
    )


def _blocks(answer: CompareAnswer) -> Iterator[blocks.Block]:
    summary = _headline(answer)
    yield summary
    yield from _best(answer)
    if answer.counted:
        yield blocks.sentence(
            "Axes are counted with more nodes of {}, with the other groups unchanged.", blocks.Code(answer.counted)
        )
    if any(not machine.is_own for machine in answer.compared):
        words = "On other kinds of bus the machine has the bus of a new profile, with assumed values."
        yield blocks.Sentence((words,), "warns")
    yield blocks.Table(_COLUMNS, tuple(map(_row, answer.kinds)), blocks.Sentence(("The machine on each kind of bus",)))
    if answer.compared:
        yield blocks.Chart(_drawing(answer, title=sentence_text(summary)), blocks.Sentence((_CAPTION,)))
    yield from filter(None, (_hindrance(machine) for machine in answer.kinds))
    notes = (*map(_note, answer.compared), *_left_out(answer))
    yield blocks.Detail(notes, "what each kind leaves out, assumes and was checked against")
    yield from answer.execution
    assumed = [(machine, assumption) for machine in answer.compared for assumption in machine.assumed]
    if assumed:
        rows = (
            blocks.TableRow(
                (machine.title, blocks.Code(assumption.key), short_text(assumption.value), assumption.source),
            )
            for machine, assumption in assumed
        )
        caption = (
            "Assumed, by the profile, as a new profile of the kind has it or by default, until somebody knows better"
        )
        yield blocks.Detail((blocks.Table(_ASSUMED, tuple(rows), blocks.Sentence((caption,))),))


def _headline(answer: CompareAnswer) -> blocks.Sentence:
    """Say what the profile's own bus does, and on which others the machine is shown to fit, with what is assumed."""
    own = next((machine for machine in answer.compared if machine.is_own), None)
    others = [machine.title for machine in answer.compared if machine.fits and not machine.is_own]
    words = [] if own is None else [f"{own.figures.verdict} on {own.title}, its own bus"]
    if len(answer.kinds) > (own is not None):
        words.append(
            f"with assumed values of other buses, shown to fit on {listed(others, 'and') if others else 'none'}"
        )
    return blocks.sentence(
        f"{{}} at {{}}: {'; '.join(words)}.",
        blocks.Code(answer.profile.name),
        period_value(answer.profile.cycle.period_us),
        state=blocks.state_of(others or (own and own.fits)),
    )


def _best(answer: CompareAnswer) -> Iterator[blocks.Sentence]:
    """Say which kind has the smallest period, and which the most axes, of those whose host's time is known."""
    ranked = [machine for machine in answer.compared if not machine.assumed_host]
    shortest = [(machine.smallest.us, machine) for machine in ranked if machine.smallest.us is not None]
    if shortest:
        us, machine = min(shortest, key=lambda pair: pair[0])
        value = blocks.ShownValue(us, "smallest_period_us", "us", 3)
        yield blocks.sentence(f"The smallest period is {{}} on {machine.title}.", value)
    most = [(machine.safe.axes, machine) for machine in ranked if machine.safe.axes]
    if most:
        axes, machine = max(most, key=lambda pair: pair[0])
        yield blocks.sentence(
            f"The most axes at {{}} are {{}} on {machine.title}.",
            period_value(answer.profile.cycle.period_us),
            blocks.count_value(axes, SAFE_AXES.key),
        )
    unranked = [
        f"{machine.title} ({_values(machine.assumed_host)})" for machine in answer.compared if machine.assumed_host
    ]
    if unranked:
        words = f"Not ranked, because the host's time is assumed: {listed(unranked, 'and')}."
        yield blocks.Sentence((words,), "warns")
    if without := [machine.title for machine in answer.compared if answer.wake_up in machine.left_out]:
        words = f"Without the host's wake-up, {answer.wake_up}: {listed(without, 'and')}."
        yield blocks.Sentence((words,), "warns")


def _values(assumed: Sequence[AssumedKey]) -> str:
    return ", ".join(f"{assumption.key} = {short_text(assumption.value)}" for assumption in assumed)


def _row(machine: MachineOnKind | NotOnKind) -> blocks.TableRow:
    """A row of the table of the kinds."""
    if isinstance(machine, NotOnKind):
        before, after = ((blocks.ShownValue(None),) * number for number in (3, len(_COLUMNS) - 5))
        return blocks.TableRow((machine.title, *before, blocks.Words("not compared", "warns"), *after))
    figures = machine.figures
    is_unsafe = not figures.safe and figures.verdict != DOES_NOT_FIT
    unsafe = f", unsafe {figures.safety.setting}" if is_unsafe else ""
    new = [assumed for assumed in machine.assumed if assumed.source in ("new profile", "profile")]
    defaults = len(machine.assumed) - len(new)
    count = f"{defaults} {nouns(defaults, 'default')}" if defaults else ""
    best = {} if machine.best is None else machine.best.changes
    with_best = f" (smallest period: {', '.join(f'{key} = {short_text(best[key])}' for key in best)})"
    cells: tuple[blocks.Cell, ...] = (
        f"{machine.title}{', as it is' if machine.is_own else with_best if best else ''}",
        blocks.ShownValue(machine.smallest.us, "smallest_period_us", "us", 3),
        blocks.ShownValue(machine.safe.axes, SAFE_AXES.key),
        machine.safe.limited_by,
        blocks.Words(f"{figures.verdict}{unsafe}", blocks.state_of(machine.fits)),
        blocks.Sentence(margin_parts(figures, unit=False)),
        figures.bus_figures.term_label(figures.binding_term),
        ", ".join(filter(None, (_values(new), count))) or "-",
    )
    return blocks.TableRow(cells)


def _hindrance(machine: MachineOnKind | NotOnKind) -> blocks.Sentence | None:
    """Say of a kind what stands in the way; None where nothing does."""
    if isinstance(machine, NotOnKind):
        return blocks.Sentence((f"{machine.title} cannot have this machine: {'; '.join(machine.why)}.",), "warns")
    figures, sentences = machine.figures, list[blocks.Sentence]()
    if machine.broken_limits:
        sentences.append(blocks.Sentence((f"At {period(figures.period_us)} {'; '.join(machine.broken_limits)}.",)))
    if not machine.safe.nodes:
        at = period(figures.period_us)
        sentences.append(blocks.Sentence((f"No node is shown to fit {at}, limited by {machine.safe.limited_by}.",)))
    if machine.smallest.us is None:
        sentences.append(blocks.Sentence((f"No period is shown to fit: {machine.smallest.need.why}.",)))
    sentences += reset_sentence(machine.after_reset)
    return blocks.joined(blocks.Sentence((f"{machine.title}:",)), *sentences) if sentences else None


def _note(machine: MachineOnKind) -> blocks.Sentence:
    """Say of a kind what execution times mean on it, and what it is checked against."""
    sentences = []
    if machine.execution:
        sentences.append(blocks.Sentence((machine.execution,)))
    if machine.of_host:
        keys = listed([f"{name} from {key}" for name, key in machine.of_host.items()], "and")
        sentences.append(blocks.Sentence((f"The host is the machine's own: {keys}.",)))
    if machine.best is not None:
        values = " and ".join(f"{key} = {short_text(value)}" for key, value in machine.best.changes.items())
        sentences.append(blocks.Sentence((f"The smallest period is with {values}, which is free to change.",)))
    sentences.append(blocks.Sentence((f"Checked against {checked_against(machine.tested)}.",)))
    return blocks.joined(blocks.Sentence((f"{machine.title}:",)), *sentences)


def _left_out(answer: CompareAnswer) -> Iterator[blocks.Sentence]:
    """Keys of the profile that are left out, once for the kinds that leave out the same."""
    titles: dict[tuple[str, ...], list[str]] = {}
    for machine in answer.compared:
        if machine.left_out:
            titles.setdefault(machine.left_out, []).append(machine.title)
    for left_out, names in titles.items():
        keys = blocks.joined(*(blocks.Sentence((blocks.Code(key),)) for key in left_out), by=", ")
        has_rate = any(key.startswith(("group.", "payload.")) and key.endswith(".every") for key in left_out)
        rates = " Data at a slower rate go in every cycle there." if has_rate else ""
        yield blocks.Sentence((f"Left out on {listed(names, 'and')}: ", *keys.parts, f".{rates}"))


def _drawing(answer: CompareAnswer, *, title: str) -> charts.Drawing:
    """The most axes over the period: a curve for each kind of bus, and this machine as a line across and one up."""
    compared, own_us, own_axes = answer.compared, answer.profile.cycle.period_us, answer.axes
    points = [point for machine in compared for point in machine.curve]
    periods_us, top = sorted({point.period_us for point in points}), max(point.axes or 1 for point in points)
    machine_now = charts.Entry("own", f"this machine: {period(own_us)}, {plural(own_axes, 'axis')}", shape="line")
    marks = charts.letters(machine.kind.upper() for machine in compared)
    plot = charts.Curves(
        charts.logarithmic("period, logarithmic", periods_us[0], periods_us[-1], period, at=periods_us, own=own_us),
        charts.logarithmic("axes, logarithmic", 1, max(_LEAST_TOP, own_axes, top), lambda axes: f"{axes:.0f}"),
        tuple(_curve(*each) for each in zip(compared, marks, cycle(_INKS), strict=False)),
        (charts.Guide(machine_now, x=own_us), *([charts.Guide(machine_now, y=own_axes)] if own_axes else [])),
    )
    return charts.Drawing(title, (charts.Panel(plot),), description=_CAPTION)


def _curve(machine: MachineOnKind, mark: str, ink: Ink) -> charts.Curve:
    """A point for each period that carries an axis; no axes have no place on a logarithmic scale."""
    points = [(point.period_us, point.axes) for point in machine.curve if point.axes]
    title = machine.title
    label = f"{title}{' (this profile)' if machine.is_own else ''}{'' if points else ': none'}"
    return charts.Curve(
        charts.Entry(ink, label, mark, "line"),
        tuple(points),
        tuple(f"{title}: {plural(axes, 'axis')} at {period(us)}" for us, axes in points),
    )


def _record(machine: MachineOnKind | NotOnKind) -> blocks.Record:
    """A kind of bus as plain data; what a kind that cannot have the machine lacks is null."""
    tested = machine.tested
    head = {
        "kind": machine.kind,
        "title": machine.title,
        "is_own": False,
        "why_not": [],
        "set_by": parts_by(tested.set_by),
        "tested": parts_by(tested.parts),
        "not_tested": list(tested.untested),
    }
    if isinstance(machine, NotOnKind):
        empty: blocks.Record = dict.fromkeys(
            (
                *(*_FIGURES, "verdict_after_reset", *_SAFE),
                *("smallest_period_us", "smallest_period_with", "no_period"),
            )
        )
        lists: blocks.Record = {"assumed": [], "assumed_host": [], "of_host": {}, "left_out": [], "curve": []}
        return {**head, "why_not": list(machine.why), **empty, **lists}
    return {
        **head,
        "is_own": machine.is_own,
        **fields(machine.figures, *_FIGURES),
        "verdict_after_reset": None if machine.after_reset is None else machine.after_reset.verdict,
        **_safe_record(machine.safe),
        "smallest_period_us": machine.smallest.us,
        "smallest_period_with": {} if machine.best is None else dict(machine.best.changes),
        "no_period": None if machine.smallest.us else machine.smallest.need.why,
        "assumed": [assumed._asdict() for assumed in machine.assumed],
        "assumed_host": [assumed.key for assumed in machine.assumed_host],
        "of_host": dict(machine.of_host),
        "left_out": list(machine.left_out),
        "curve": [{"period_us": point.period_us, **_safe_record(point)} for point in machine.curve],
    }


def _safe_record(safe: SafeAxes) -> blocks.Record:
    return dict(zip(_SAFE, (safe.nodes, safe.axes, safe.limited_by), strict=True))


def _row_of_lists(record: blocks.Record) -> blocks.Record:
    """A record without its curve, each list of records as the keys of its rows."""
    row = {name: value for name, value in record.items() if name not in ("curve", "assumed")}
    parts = {name: [part["part"] for part in record[name]] for name in ("set_by", "tested")}
    return {**row, **parts, "assumed": [assumed["key"] for assumed in record["assumed"]]}
