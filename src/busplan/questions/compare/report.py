"""Answer of `busplan compare`."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from busplan.buses import kind_named
from busplan.buses.figure import SAFE_AXES, VERDICT
from busplan.forms.blocks import (
    Block,
    Cell,
    Chart,
    Code,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    Words,
    count_value,
    sentence,
    state_of,
)
from busplan.forms.columns import sentence_text
from busplan.forms.numbers import listed, nouns, period_value
from busplan.profile.conversion import AssumedKey
from busplan.profile.write import short_text
from busplan.questions.compare.characters import compare_lines
from busplan.questions.compare.document import compare_document, compare_records
from busplan.questions.compare.kinds import KindComparison, MachineOnKind, NotOnKind, fitting
from busplan.questions.compare.notes import notes
from busplan.questions.compare.svg import STYLE, compare_svg
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS
from busplan.questions.fit.network import bus_of
from busplan.questions.words.own_picture import OwnPicture
from busplan.questions.words.sentences import execution_sentence, refused_circle

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
    if any(one.assumed for one in found.compared):
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
    ranked = [one for one in found.compared if not one.assumed_host]
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
        f"{bus_of(one.profile).title} ({_words(one.assumed_host)})" for one in found.compared if one.assumed_host
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
    if any(not one.is_own for one in found.kinds if isinstance(one, MachineOnKind)):
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
    rows = (_row(one, columns=len(columns), with_circle=found.with_circle) for one in found.kinds)
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
        bus_of(one.profile).figures.term_label(figures.binding_term),
        ShownValue(one.smallest.us, "smallest_period_us", "us", 3),
        ShownValue(one.safe.axes, SAFE_AXES.key),
        one.safe.limited_by,
        _assumed(one),
    )
    return TableRow((*cells, *(_circle(one) if with_circle else ())))


def _verdict(one: MachineOnKind) -> Words:
    figures = one.figures
    is_unsafe = not figures.safe and figures.verdict != DOES_NOT_FIT
    unsafe = f", unsafe {bus_of(one.profile).safety.setting}" if is_unsafe else ""
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
