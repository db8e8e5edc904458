"""From answers to the content of a page: a chapter for each profile and, for several, a comparison in front."""

from collections.abc import Sequence
from typing import NamedTuple

from busplan import __version__
from busplan.analysis.all_answers import AllAnswers
from busplan.analysis.network import bus_of
from busplan.answers.circle import um
from busplan.answers.page.bus import axes_part, bus_verdict, fit_word, models_part, plain, terms_part, timeline_part
from busplan.answers.page.circle import circle_part, circle_verdict, sources_part
from busplan.answers.page.commands import shell_word, sources
from busplan.answers.page.content import (
    Cell,
    Chapter,
    ChapterLink,
    Code,
    Page,
    Part,
    Row,
    SourceCommand,
    Table,
    TableColumn,
)
from busplan.forms.lines import count, percent, plural, us


class ReportedProfile(NamedTuple):
    """One profile of a page."""

    argument: str
    """The PROFILE argument."""
    answer: AllAnswers
    other_period: bool
    """Whether its period is not that of its file."""


def page(subjects: Sequence[ReportedProfile], *, title: str | None) -> Page:
    """Put the content of a page together.

    Parameters
    ----------
    subjects
        One or more profiles.
    title
        Heading of the page; without it the profile's name, or how many there are.
    """
    chapters = tuple(_chapter(subject, anchor=f"p{number}") for number, subject in enumerate(subjects, start=1))
    several = len(chapters) > 1
    own = plural(len(chapters), "profile") if several else chapters[0].name
    table = _comparison(subjects, chapters) if several else None
    return Page(own if title is None else title, f"busplan {__version__}", table, chapters)


def _chapter(subject: ReportedProfile, *, anchor: str) -> Chapter:
    answer = subject.answer
    listed = sources(answer, argument=subject.argument, anchor=anchor, other_period=subject.other_period)
    named = {one.anchor.removeprefix(f"{anchor}-"): one for one in listed}
    verdicts = (bus_verdict(answer, named), circle_verdict(answer, named))
    parts = (
        Part("verdict", "Verdict", verdicts=verdicts, commands=tuple(v.source for v in verdicts if v.source)),
        models_part(answer, named),
        timeline_part(answer, named),
        terms_part(answer, named),
        axes_part(answer, named),
        circle_part(answer, named),
        sources_part(answer, named),
        _assumptions_part(named["explain"]),
        _commands_part(listed),
    )
    capacity, bus = named["capacity"], bus_of(answer.profile)
    facts = tuple(
        (word, capacity.figure(f"/results/0/{key}", plain, unit))
        for word, key, unit in (
            ("nodes", "nodes", ""),
            ("axes", "axes", ""),
            *((figure.label, figure.key, "") for figure in bus.setup_figures if figure.key in bus.facts),
            ("period", "period_us", "us"),
            ("slice", "available_us", "us"),
        )
    )
    return Chapter(
        anchor,
        answer.profile.name,
        shell_word(subject.argument),
        answer.profile.description.strip(),
        (*facts, ("deciding model", capacity.figure("/verdicts/0/timing_model", str))),
        tuple(part for part in parts if part is not None),
        listed,
    )


def _assumptions_part(source: SourceCommand) -> Part:
    rows = tuple(
        Row(
            (
                Code(one["name"]),
                source.figure(f"/assumptions/{number}/value", _value, one["unit"]),
                *(one[key] for key in ("unit", "grade", "source", "meaning")),
            )
        )
        for number, one in enumerate(source.value("/assumptions"))
    )
    columns = tuple(
        TableColumn(word, "figures" if word == "value" else "words")
        for word in ("name", "value", "unit", "grade", "source", "meaning")
    )
    table = Table("Assumptions with their grades, the least well known first", columns, rows, stacks=True)
    return Part("assumptions", "What it rests on", tables=(table,), commands=(source.anchor,))


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else plain(value)


def _commands_part(listed: Sequence[SourceCommand]) -> Part:
    rows = tuple(Row((one.purpose, one)) for one in listed)
    columns = (TableColumn("what", "words"), TableColumn("command", "words"))
    line = "Every figure above stands in the JSON document of one of these commands, to its last digit."
    return Part(
        "commands", "How to get every figure again", (line,), tables=(Table("Commands", columns, rows, stacks=True),)
    )


def _comparison(subjects: Sequence[ReportedProfile], chapters: Sequence[Chapter]) -> Table:
    models = tuple(dict.fromkeys(one.timing_model for each in subjects for one in each.answer.capacity.results))
    columns = (
        TableColumn("profile", "words"),
        TableColumn("fits", "words"),
        TableColumn("models agree", "words"),
        TableColumn("period, us"),
        TableColumn("nodes"),
        TableColumn("axes"),
        TableColumn("used, %"),
        *(TableColumn(f"{model}", group="margin, us") for model in models),
        TableColumn("most axes"),
        *(TableColumn(word, group="contour error, um") for word in ("mean", "max", "G")),
        TableColumn("circle passed", "words"),
    )
    rows = tuple(
        Row(_compared(subject, chapter, models=models)) for subject, chapter in zip(subjects, chapters, strict=True)
    )
    return Table("All profiles, each under the timing model that decides", columns, rows)


def _compared(subject: ReportedProfile, chapter: Chapter, *, models: Sequence[str]) -> tuple[Cell, ...]:
    answer, (capacity, *_) = subject.answer, chapter.sources
    places = {one.timing_model: f"/results/{index}" for index, one in enumerate(answer.capacity.results)}
    own = places[answer.verdict.deciding.timing_model]
    circle = next((one for one in chapter.sources if one.document["command"] == "circle-test"), None)
    measures = ("mean_contour_error_mm", "max_contour_error_mm", "circular_deviation_mm")
    return (
        ChapterLink(chapter.name, chapter.anchor, chapter.origin),
        capacity.figure("/verdicts/0/fits", fit_word),
        capacity.figure("/verdicts/0/models_agree", fit_word),
        capacity.figure(f"{own}/period_us", plain, "us"),
        *(capacity.figure(f"{own}/{key}", count) for key in ("nodes", "axes")),
        capacity.figure(f"{own}/utilisation", percent, "%"),
        *(capacity.figure(f"{places[one]}/margin_us", us, "us") if one in places else "-" for one in models),
        capacity.figure(f"{own}/max_axes", count),
        *(("-",) * 3 if circle is None else (circle.figure(f"/results/0/{key}", um, "um") for key in measures)),
        "not run" if circle is None else circle.figure("/results/0/passed", fit_word),
    )
