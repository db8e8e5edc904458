"""Answer of `busplan report`: all answers for one or several profiles on one page."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from busplan.buses.figure import (
    AVAILABLE,
    AXES,
    MARGIN_CORRECTED,
    NODES,
    PERIOD,
    SAFE_AXES,
    TIMING_MODEL,
    UNCERTAINTY,
    UTILISATION,
    VERDICT,
    Figure,
)
from busplan.forms.blocks import (
    Block,
    Cell,
    Chapter,
    Code,
    Facts,
    JsonDocument,
    Report,
    SectionLink,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    Words,
    attribute_value,
)
from busplan.forms.numbers import MISSING, nouns, plural
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.questions.base.shell import shell_word
from busplan.questions.capacity.card import card
from busplan.questions.circle.figures import CIRCLE_BY_KEY
from busplan.questions.circle.report import verdict_words
from busplan.questions.explain.report import assumptions_table
from busplan.questions.fit.assumed import heavy_assumptions
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.report.all_answers import AllAnswers
from busplan.questions.report.commands import Sources, sources
from busplan.questions.report.parts import (
    circle_question,
    part,
    parts,
)
from busplan.questions.words.documents import document

_MEASURES: Final = ("mean_contour_error_mm", "max_contour_error_mm", "circular_deviation_mm")


class ReportedProfile(NamedTuple):
    """One profile of a page."""

    argument: str
    """The PROFILE argument."""
    answer: AllAnswers
    changes: KeyChanges = NO_CHANGES
    """KeyChanges of its file."""


class _Subject(NamedTuple):
    """A profile and the commands behind its figures."""

    key: str
    origin: str
    answer: AllAnswers
    sources: Sources

    @property
    def name(self) -> str:
        return self.answer.profile.name


def page_report(profiles: Sequence[ReportedProfile], *, title: str | None = None) -> Report:
    """Make the page: a chapter for each profile, after a comparison if there are several.

    Parameters
    ----------
    profiles
        One or more.
    title
        Title of the page; by default the profile's name, or the number of profiles.
    """
    subjects = [
        _Subject(
            f"p{number}",
            shell_word(profile.argument),
            profile.answer,
            sources(profile.answer, argument=profile.argument, changes=profile.changes),
        )
        for number, profile in enumerate(profiles, start=1)
    ]
    own = Code(subjects[0].name) if len(subjects) == 1 else plural(len(subjects), "profile")
    return Report(
        Sentence((own if title is None else title,)),
        tuple(_blocks(subjects)),
        _document(subjects),
        is_page=True,
        is_whole=True,
    )


def _document(subjects: Sequence[_Subject]) -> JsonDocument:
    """Document of `busplan report --format json`: for each profile, the documents of its commands."""
    return document(
        "report",
        profiles=[
            {"profile": subject.name, "answers": {name: source.document() for name, source in subject.sources.items()}}
            for subject in subjects
        ],
    )


def _blocks(subjects: Sequence[_Subject]) -> Iterator[Block]:
    if len(subjects) == 1:
        yield from _chapter(subjects[0])
        return
    yield Chapter(Sentence(("Comparison",)), (_comparison(subjects),), "comparison", "comparison")
    for subject in subjects:
        yield Chapter(Sentence((Code(subject.name),)), tuple(_chapter(subject)), key=subject.key)


def _chapter(subject: _Subject) -> Iterator[Block]:
    """All blocks of one profile."""
    answer, sources_ = subject.answer, subject.sources
    if answer.profile.description.strip():
        yield Sentence((" ".join(answer.profile.description.split()),))
    yield _facts(subject)
    circle = (circle_question(answer),) if answer.profile.has_cycle else ()
    verdicts: tuple[Block, ...] = (card(answer.verdict), *circle)
    if answer.no_circle:
        verdicts = verdicts[::-1]  # the cause first
    lines = (sources_[name].line for name in ("capacity", "circle") if name in sources_)
    yield part("verdict", "Verdict", (*_assumed(answer), *verdicts, *lines))
    yield from parts(answer, sources_)
    assumptions = (assumptions_table(answer.assumptions), sources_["explain"].line)
    yield part("assumptions", "What it rests on", assumptions)
    yield _commands(sources_)


_MOST_NAMED: Final = 3
"""Keys that are named before the verdict; the table at the end has all."""


def _assumed(answer: AllAnswers) -> Iterator[Sentence]:
    """Say which keys of the profile are assumed, before any figure that rests on them; those that carry most first."""
    heavy = heavy_assumptions(answer.verdict.deciding, answer.verdict.network)
    names = [given.name for given in answer.assumptions if given.grade == "assumed" and "." in given.name]
    names.sort(key=lambda name: not any(assumption.covers(name) for assumption in heavy))
    if names:
        parts = [part for name in names[:_MOST_NAMED] for part in (Code(name), ", ")][:-1]
        more = len(names) - _MOST_NAMED
        rest = f" and {more} more" if more > 0 else ""
        verb = "is" if len(names) == 1 else "are"
        yield Sentence((*parts, f"{rest} {verb} assumed: nobody has measured what these figures rest on."), "warns")


def _facts(subject: _Subject) -> Facts:
    """Settings of the bus, and the PROFILE argument."""
    bus, figures = bus_of(subject.answer.profile), subject.answer.capacity.results[0]
    setup = (figure for figure in bus.figures.setup if figure.key in bus.figures.headings)

    def item(name: str, figure: Figure) -> tuple[str, ShownValue]:
        unit = "us" if figure.unit == "us" else ""
        return name, ShownValue(figures.values()[figure.key], figure.key, unit)

    network = network_of(subject.answer.profile)
    return Facts(
        (
            *((nouns(2, noun), ShownValue(number, nouns(2, noun))) for number, noun in bus.counted(network)),
            *(item(figure_.label, figure_) for figure_ in setup),
            *((item("period", PERIOD), item("slice", AVAILABLE)) if network.groups else ()),
            ("deciding model", ShownValue(subject.answer.verdict.deciding.timing_model, TIMING_MODEL.key)),
            ("profile", Code(subject.origin)),
        )
    )


def _commands(sources: Sources) -> Chapter:
    columns = (TableColumn("what", kind="words"), TableColumn("command", kind="words"))
    rows = tuple(TableRow((source.command.purpose, source.command)) for source in sources.values())
    line = "The JSON document of one of these commands has each figure above, with all its digits."
    table = Table(columns, rows, Sentence(("Commands",)), stacks=True)
    return part("commands", "How to get every figure again", (Sentence((line,)), table))


def _comparison(subjects: Sequence[_Subject]) -> Table:
    columns = (
        TableColumn("profile", kind="words"),
        TableColumn("verdict", kind="words"),
        TableColumn("period", "us"),
        TableColumn("nodes"),
        TableColumn("axes"),
        TableColumn("utilisation", "%"),
        TableColumn("margin", "us"),
        TableColumn("+/-", "us"),
        TableColumn("safe axes"),
        *(TableColumn(CIRCLE_BY_KEY[key].symbol, group="contour error, um") for key in _MEASURES),
        TableColumn("circle", kind="words"),
    )
    rows = tuple(TableRow(_compared(subject)) for subject in subjects)
    return Table(columns, rows, Sentence(("All profiles, each under the timing model that decides",)))


def _compared(subject: _Subject) -> tuple[Cell, ...]:
    shown = (VERDICT, PERIOD, NODES, AXES, UTILISATION, MARGIN_CORRECTED, UNCERTAINTY, SAFE_AXES)
    bus = (attribute_value(figure, subject.answer.verdict.deciding) for figure in shown)
    link = SectionLink(subject.name, subject.key, subject.origin)
    return link, *bus, *_compared_circle(subject)


def _compared_circle(subject: _Subject) -> tuple[Cell, ...]:
    result = subject.answer.circle_figures
    if result is None:
        refused = Words("cannot be run", "fails") if subject.answer.no_circle else "not run"
        return MISSING, MISSING, MISSING, refused
    figures = tuple(attribute_value(CIRCLE_BY_KEY[key], result) for key in _MEASURES)
    verdict = verdict_words(result)
    return *figures, Words(verdict.text.lower(), verdict.state)
