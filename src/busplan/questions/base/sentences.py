"""Sentences and documents that several questions share."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from busplan.buses.figure import AVAILABLE, MARGIN, MARGIN_CORRECTED, REQUIRED, UNCERTAINTY, UTILISATION, Figure
from busplan.buses.network import Network
from busplan.buses.parts import Value as BusValue
from busplan.buses.published import Tested
from busplan.forms import blocks
from busplan.forms.numbers import known_decimals, known_text
from busplan.profile.changes import KeyChanges
from busplan.profile.edit import value_text
from busplan.questions.fit.certainty import TIME
from busplan.questions.fit.figures import CycleFigures, FitFigures
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.buses.bus import Bus


NewValues = Mapping[str, BusValue]
"""New values of a profile by dotted key."""


def settings_sentence(changes: NewValues, *, meanings: Mapping[str, str], quotes: bool = True) -> blocks.Sentence:
    """Sentence with each changed key, its new value and its meaning.

    `meanings` are those on the machine, for keys that do not say so. `quotes` puts text values in quotes, as in a
    profile.
    """

    def written(key: str, value: object) -> tuple[blocks.Part, ...]:
        if isinstance(value, list):
            return (value_text(value),)
        shown = blocks.ShownValue(value, key)
        return ('"', shown, '"') if quotes and isinstance(value, str) else (shown,)

    def note(key: str) -> str:
        section, _, rest = key.partition(".")
        # A key of a group of nodes means what that of alike nodes does.
        of_node = f"node.{rest.partition('.')[2]}" if section == "group" else key
        return f" ({meanings[of_node]})" if of_node in meanings else ""

    settings = (blocks.Sentence((f"{key} = ", *written(key, value), note(key))) for key, value in changes.items())
    return blocks.joined(*settings, by=", ")


def change_meanings(bus: "Bus") -> dict[str, str]:
    """Meanings of changes on the machine, by key, for keys that do not say so."""
    return {name: key.meaning for name, key in bus.keys.items() if key.meaning}


def warning_sentences(warnings: Iterable[str]) -> Iterator[blocks.Sentence]:
    """Warnings that hold whatever the verdict."""
    return (blocks.Sentence((f"Warning: {words}.",), "warns") for words in warnings)


def execution_sentence(network: Network, *, of_latency: bool = False) -> Iterator[blocks.Sentence]:
    """Sentence on the grade of the execution time in the figures; none without a grade, or without execution in them.

    If groups differ, each grade is named with its groups. `of_latency` tells latencies from figures of the cycle.
    """
    names: dict[str, list[str]] = {}
    for group in network.profile.node_groups:
        names.setdefault(group.node.execution.grade or "", []).append(group.name)
    grades = ", ".join(
        f"{grade or 'without a grade'} of {' and '.join(groups)}" if len(names) > 1 else grade
        for grade, groups in names.items()
    )
    if grades and network.bus.has_execution(network, of_latency=of_latency):
        text = f"The execution time behind these figures is {grades}."
        yield blocks.sentence(text, state="warns" if "assumed" in grades else "neutral")


def checked_against(tested: Tested, *, with_untested: bool = True) -> str:
    """Parts of a bus model that published figures test, and, unless they are left out, those never measured."""
    parts = ", ".join(f"{part} ({by})" for part, by in tested.parts.items())
    never = f"never measured: {', '.join(tested.untested)}" if tested.untested and with_untested else ""
    return "; ".join(filter(None, (parts, never))) or "no published figures"


def never_measured(tested: Tested) -> str:
    """Parts of a bus model that no published figure tests; without any figure, the whole cycle."""
    return ", ".join(tested.untested) or ("" if tested.parts else "a whole cycle (no published figures)")


def reset_sentence(after: FitFigures | None) -> Iterator[blocks.Sentence]:
    """Sentence on a cycle that stops fitting at a bus reset; none for another."""
    if after is not None:
        keys = ", ".join(f"{key} = {value}" for key, value in after.safety.after_reset.items())
        text = f"After a bus reset, with {keys} until it is set again, the verdict is: {after.verdict}."
        yield blocks.sentence(text, state="warns")


def margin_words(figures: CycleFigures, broken_limits: Iterable[str]) -> tuple[blocks.Part, ...]:
    """Margin of a cycle under one timing model, or its excess over limits, without a verdict."""
    available = blocks.attribute_value(AVAILABLE, figures)
    if figures.fits:
        used = blocks.attribute_value(UTILISATION, figures)._replace(decimals=1)
        return blocks.sentence(
            "{} to spare, {} of {} used", blocks.attribute_value(MARGIN, figures), used, available
        ).parts
    short = blocks.ShownValue(-figures.margin_us, MARGIN.key, "us", 3)
    reasons = [blocks.Sentence((words,)) for words in broken_limits]
    if TIME in figures.exceeded:
        reasons.append(
            blocks.sentence("short by {}: needs {} of {}", short, blocks.attribute_value(REQUIRED, figures), available)
        )
    return blocks.joined(*reasons, by=", and ").parts


def margin_parts(figures: CycleFigures, *, unit: bool = True) -> tuple[blocks.Part, ...]:
    """Corrected margin under the model that decides, with its uncertainty if known, in the digits that this allows."""
    margin_us, doubt_us = figures.margin_corrected_us, figures.uncertainty_us
    shown = (blocks.attribute_value(figure, figures) for figure in (MARGIN_CORRECTED, UNCERTAINTY))
    decimals = known_decimals(margin_us or 0.0, doubt_us)
    margin, doubt = (value._replace(decimals=decimals, unit=value.unit if unit else "") for value in shown)
    return (margin,) if doubt_us is None else (margin, " +/- ", doubt)


def time_lines(figures: CycleFigures, profile: Profile) -> Iterator[tuple[str, blocks.Sentence]]:
    """Labels and words on the used and the free time in the slice, under the model that decides."""
    given_us, uncertainty_us, margin_us = (
        figures.available_us,
        figures.uncertainty_us,
        figures.margin_corrected_us or 0.0,
    )
    used, whole = used_us(figures), known_text(given_us, None)
    whole = whole if profile.cycle.slice_ratio == 1 else f"the {whole} that the bus may use"
    words = f"{known_text(used, uncertainty_us)} us of {whole}, {100 * used / given_us:.0f} %"
    possible_us = figures.required_us - (figures.least_required_us or 0.0)
    if possible_us > 0:
        words = f"at least {known_text(used - possible_us, uncertainty_us)}, at most {words}"
    yield "used", blocks.Sentence((words,))
    doubt = "" if uncertainty_us is None else f", +/- {known_text(uncertainty_us, uncertainty_us)}"
    reserve_us = given_us * profile.limits.reserve
    reserve = known_text(reserve_us, uncertainty_us) if reserve_us else ""
    free = f"{known_text(abs(margin_us), uncertainty_us)} us{doubt}"
    if margin_us < 0:
        yield "short by", blocks.Sentence((f"{free}{reserve and f', and {reserve} of reserve'}",))
    else:
        yield "free", blocks.Sentence((f"{free}{reserve and f'; {reserve} must stay free'}",))


def used_us(figures: CycleFigures) -> float:
    """Time that a cycle takes, with the bias of the model [us]."""
    return figures.available_us - (figures.margin_corrected_us or 0.0)


def safety_record(figures: FitFigures) -> blocks.Record:
    """Whether the settings of the bus are safe, under the kind's own key; empty if it has none."""
    safety = figures.safety.figure
    return {} if safety is None else {safety.key: figures.safe}


JSON_SCHEMA: Final = 1


def document(command: str, **content: object) -> blocks.JsonDocument:
    """JSON document of a command: schema version, command name and content."""
    return {"schema": JSON_SCHEMA, "command": command, **content}


def fields(owner: object, *names: str) -> blocks.Record:
    """Attributes by name as plain data: a tuple becomes a list; all are None if the owner is None."""
    values = {name: getattr(owner, name) if owner is not None else None for name in names}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def with_profile(name: str, records: Sequence[blocks.Record]) -> list[blocks.Record]:
    """Rows for CSV with the profile's name in front, so that tables of several runs can be joined."""
    return [{"profile": name, **record} for record in records]


def parts_by(parts: Mapping[str, str]) -> list[blocks.Record]:
    """Parts of a bus model that published figures set or test, each with those figures."""
    return [{"part": part, "by": words} for part, words in parts.items()]


def changed_document(content: Mapping[str, Any], changes: KeyChanges) -> blocks.JsonDocument:
    """A document with the new values of --set as `changes`; in `diff`, which has others, as `changes_of_both`."""
    if not changes.by_set:
        return dict(content)
    name = "changes" if "changes" not in content else "changes_of_both"
    head = {key: content[key] for key in ("schema", "command")}
    return {**head, name: {change.key: change.value for change in changes.by_set}, **content}


def changed_report(report: blocks.Report, changes: KeyChanges) -> blocks.Report:
    """An answer with the --set options named in a sentence at its top, and in its JSON document."""
    return report._replace(
        blocks=(*changes_sentences(changes), *report.blocks),
        document=changed_document(report.document, changes),
        records=_changed_records(report.records, changes),
    )


def _changed_records(records: Sequence[blocks.Record] | None, changes: KeyChanges) -> Sequence[blocks.Record] | None:
    """Rows for CSV with the changed constants, where no key has them."""
    if not records or not changes.constants:
        return records
    constants = " ".join(f"{change.key}={change.value}" for change in changes.constants)
    return [{**record, "changed_constants": constants} for record in records]


def changes_sentences(changes: KeyChanges) -> list[blocks.Sentence]:
    """Sentence that names the --set options, because the figures are not those of the file; empty without them."""
    options = [blocks.Sentence((blocks.Code(change.typed),)) for change in changes.by_set]
    return (
        [
            blocks.joined(
                blocks.Sentence(("With ",)), blocks.joined(*options, by=" and "), blocks.Sentence((".",)), by=""
            )
        ]
        if options
        else []
    )


_DROPPED_FIRST: Final = 9
"""Rank of the column of sources: a narrow terminal drops it before the figures."""


class FigureColumn(NamedTuple):
    """A column of figures."""

    head: blocks.TableColumn
    figures: object
    """Figures by key, or an object with the figures as attributes."""


def figure_table(
    rows: Iterable[tuple[Figure, int]],
    columns: Sequence[FigureColumn],
    *,
    caption: blocks.Sentence,
    unit: bool = True,
    hides_equations: bool = False,
    is_detail: Callable[[Figure], bool] = lambda _figure: False,
    state: Callable[[Figure, Any], blocks.State] = lambda _figure, _figures: "neutral",
) -> blocks.Table:
    """Table with a row for each figure and a column for each period, model or transaction.

    `rows` are figures with their levels. Without `unit` there is no column of units: the caption has the unit. The
    column of equations and sources is shown only with `--all` if `hides_equations`, and so is the row of a figure for
    which `is_detail` is true. `state` gives the state of a figure in its column; "neutral" keeps that of the value.
    """
    equation = blocks.TableColumn("source", kind="words", rank=_DROPPED_FIRST, is_detail=hides_equations)
    head = [blocks.TableColumn("figure", kind="words"), equation]
    if unit:
        head.append(blocks.TableColumn("unit", kind="words"))
    shown = []
    for figure, level in rows:
        words = [figure.label, figure.reference]
        if unit:
            words.append(figure.column or figure.unit)
        values = (_value(figure, column, state) for column in columns)
        shown.append(blocks.TableRow((*words, *values), level, is_detail=is_detail(figure)))
    # A narrow terminal splits the table into panels, each with the first columns again.
    return blocks.Table((*head, *(column.head for column in columns)), tuple(shown), caption, heads=len(head))


def _value(figure: Figure, column: FigureColumn, state: Callable[[Figure, Any], blocks.State]) -> blocks.ShownValue:
    value, judged = blocks.attribute_value(figure, column.figures), state(figure, column.figures)
    return value if judged == "neutral" else value._replace(state=judged)
