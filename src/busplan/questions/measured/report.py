"""Answer of `busplan measured`."""

from collections import Counter
from collections.abc import Iterator
from pathlib import PurePath
from typing import Final

from busplan.buses.rule import RecordedFigure, RecordedVerdict
from busplan.english import plural
from busplan.forms.blocks import (
    Block,
    Cell,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Snippet,
    State,
    Table,
    TableColumn,
    TableRow,
    Words,
)
from busplan.profile.edit import value_text
from busplan.questions.base.sentences import document, with_profile
from busplan.questions.measured import MeasuredAnswer

_COLUMNS: Final = (
    TableColumn("figure", kind="words", wraps=True),
    TableColumn("unit", kind="words"),
    TableColumn("planned"),
    TableColumn("recorded"),
    TableColumn("residual", rank=1),
    TableColumn("U"),
    TableColumn("within", kind="words"),
    TableColumn("n", rank=2),
    TableColumn("note", kind="words", rank=3, leaves="below", wraps=True),
)
_DECIMALS: Final = {"us": 3, "1": 0, "bytes": 0, "share": 2, "kbit/s": 1}
_UNITS: Final = {"1": "", "share": "%"}
"""How a unit is shown, where not as it is."""
_WITHIN: Final[dict[RecordedVerdict | None, Cell]] = {
    None: "",
    "within": Words("yes", "passes"),
    "not shown": Words("not shown", "warns"),
    "outside": Words("no", "fails"),
}
_SMALL_US: Final = 1.0
"""A time below it has more decimals."""


def provenance(answer: MeasuredAnswer, section: str) -> str:
    """Origin of the measured values of a section, as a one-line comment for the profile."""
    own = [figure for figure in answer.figures if figure.key.startswith(f"{section}.")] or answer.figures
    if all(figure.is_mean for figure in own):
        share = "the mean"
    else:
        share = "the worst" if answer.quantile == 1 else f"{100 * answer.quantile:g} %"
    count = max(figure.events for figure in own)
    day = f" of {answer.day}" if answer.day else ""
    return f"busplan measured: {share} of {plural(count, 'event')} in {PurePath(answer.source).name}{day}"


def measured_report(answer: MeasuredAnswer, *, applied_to: str | None) -> Report:
    """Report of `measured`.

    Parameters
    ----------
    answer
        The answer.
    applied_to
        The profile that measured values were written into; None if none were.
    """
    return Report(
        Sentence((Code(answer.profile.name), " beside the recording ", Code(answer.source))),
        tuple(_blocks(answer)),
        _document(answer, applied_to=applied_to),
        with_profile(answer.profile.name, list(map(_record, answer.figures))),
    )


def _blocks(answer: MeasuredAnswer) -> Iterator[Block]:
    counts = Counter(figure.verdict for figure in answer.figures if figure.verdict)
    state: State = "fails" if counts["outside"] else "warns" if answer.shows_nothing else "passes"
    inside = f"{counts['within']} of {plural(counts.total(), 'figure')} within the plan"
    share = "the worst recorded" if answer.quantile == 1 else f"those of {100 * answer.quantile:g} % of the events"
    yield Sentence(
        (
            Code(answer.profile.name),
            " beside ",
            Code(answer.source),
            ": ",
            Words(inside, state),
            f"{_named(answer, 'outside')}{_named(answer, 'not shown')}. Jitter and times are {share}.",
        )
    )
    yield from (Sentence((Words("Shows nothing", "warns"), f": {reason}.")) for reason in answer.shows_nothing)
    yield Table(_COLUMNS, tuple(map(_row, answer.figures)), stacks=True)
    yield from (Sentence((remark,)) for remark in answer.remarks)
    values = [f"{key} = {value_text(value)}" for key, value in answer.edits.items() if value is not None]
    if values:
        yield Sentence(("Measured (--apply writes it into the profile):",))
        yield Snippet(tuple(values))


def _named(answer: MeasuredAnswer, verdict: RecordedVerdict) -> str:
    names = [figure.quantity for figure in answer.figures if figure.verdict == verdict]
    return f"; {verdict}: {', '.join(names)}" if names else ""


def _row(figure: RecordedFigure) -> TableRow:
    shown = (_value(figure, name) for name in ("planned", "recorded", "residual", "uncertainty"))
    unit = _UNITS.get(figure.unit, figure.unit)
    note = ", ".join(filter(None, (figure.hidden, figure.note)))
    return TableRow((figure.quantity, unit, *shown, _WITHIN[figure.verdict], ShownValue(figure.events, "events"), note))


def _value(figure: RecordedFigure, name: str) -> ShownValue:
    value = getattr(figure, name)
    decimals = _DECIMALS[figure.unit]
    if figure.unit == "us" and max(map(abs, filter(None, (figure.planned, figure.recorded))), default=1) < _SMALL_US:
        decimals = 5
    return ShownValue(
        value, name, _UNITS.get(figure.unit, figure.unit), decimals, signed=name == "residual", fixed=True
    )


def _record(figure: RecordedFigure) -> Record:
    fields = figure._asdict()
    del fields["is_mean"]
    texts = {name: fields.pop(name) or None for name in ("key", "note", "hidden")}
    return {**fields, "residual": figure.residual, "verdict": figure.verdict, **texts}


def _document(answer: MeasuredAnswer, *, applied_to: str | None) -> JsonDocument:
    return document(
        "measured",
        profile=answer.profile.name,
        source=answer.source,
        day=answer.day or None,
        quantile=answer.quantile,
        figures=list(map(_record, answer.figures)),
        outside=[figure.quantity for figure in answer.outside],
        shows_nothing=list(answer.shows_nothing),
        remarks=list(answer.remarks),
        measured=dict(answer.edits),
        applied_to=applied_to,
    )
