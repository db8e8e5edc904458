"""`busplan.report`."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

from busplan.buses.figure import AXES, MARGIN_CORRECTED, NODES, PERIOD, SAFE_AXES, UNCERTAINTY, UTILISATION, VERDICT
from busplan.english import has_controls, plural
from busplan.errors import ArgumentError, BusplanError
from busplan.forms.blocks import (
    Block,
    Card,
    Chapter,
    Chart,
    Code,
    Command,
    Detail,
    JsonDocument,
    Report,
    SectionLink,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    attribute_value,
)
from busplan.profile.changes import NO_CHANGES, KeyChanges, change_options, shell_word
from busplan.progress import Progress, part_of
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import FilePath, Origin, ProfileLike, load_profile, one_or_several, origin_of
from busplan.questions.base.sentences import changed_report, document
from busplan.questions.capacity import capacity
from busplan.questions.capacity.sensitivity import too_large
from busplan.questions.capacity.verdict import Verdict
from busplan.questions.circle import circle_test
from busplan.questions.explain import explain
from busplan.questions.fit.circle_setup import refusals
from busplan.questions.fit.network import network_of
from busplan.questions.latency import latency
from busplan.questions.map import map_
from busplan.questions.measured import measured
from busplan.questions.timeline import timeline
from busplan.sections.profile import Profile
from busplan.sourced import constants_changed


def page_report(profiles: "Sequence[ReportedProfile]", *, title: str | None = None) -> Report:
    """The page: a chapter for each profile, after a comparison if there are several."""
    usual = Code(profiles[0].profile.name) if len(profiles) == 1 else plural(len(profiles), "profile")
    return Report(
        Sentence((usual if title is None else title,)),
        tuple(_blocks(profiles)),
        _document(profiles),
        is_page=True,
        is_whole=True,
    )


def _document(profiles: "Sequence[ReportedProfile]") -> JsonDocument:
    """Document of `busplan report --format json`: for each profile, the documents of its answers."""
    return document(
        "report",
        profiles=[
            {
                "profile": reported.profile.name,
                "answers": {section.key: dict(section.report.document) for section in reported.sections},
                "missing": list(reported.missing),
            }
            for reported in profiles
        ],
    )


def _blocks(profiles: "Sequence[ReportedProfile]") -> Iterator[Block]:
    if len(profiles) == 1:
        yield from _chapter(profiles[0])
        return
    yield Chapter(Sentence(("Comparison",)), (_comparison(profiles),), "comparison", "comparison")
    for number, profile in enumerate(profiles, start=1):
        yield Chapter(Sentence((Code(profile.profile.name),)), tuple(_chapter(profile)), key=f"p{number}")


def _chapter(reported: "ReportedProfile") -> Iterator[Block]:
    """The first screen, and every answer behind a fold."""
    description = reported.profile.description
    if description.strip():
        yield Sentence((" ".join(description.split()),))
    yield reported.verdict.card
    yield from (Sentence((words,), "warns") for words in reported.missing)
    trade_off = reported.section("map")
    if trade_off is not None:
        yield from (block for block in trade_off.report.blocks if isinstance(block, Chart))
    yield from map(_folded, reported.sections)


_ON_FIRST_SCREEN: Final = {"capacity": Card, "map": Chart}
"""Blocks of an answer that stand on the first screen already."""


def _folded(section: "PageSection") -> Chapter:
    shown = _ON_FIRST_SCREEN.get(section.key, ())
    blocks = [block for block in _whole(section.report.blocks) if not isinstance(block, shown)]
    return Chapter(Sentence((section.title,)), (*blocks, Command(section.command)), section.key, is_folded=True)


def _whole(blocks: Sequence[Block]) -> Iterator[Block]:
    for block in blocks:
        yield from block.blocks if isinstance(block, Detail) else (block,)


def _comparison(profiles: "Sequence[ReportedProfile]") -> Table:
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
    )
    figures = (VERDICT, PERIOD, NODES, AXES, UTILISATION, MARGIN_CORRECTED, UNCERTAINTY)
    rows = tuple(
        TableRow(
            (
                SectionLink(reported.profile.name, f"p{number}", shell_word(reported.argument)),
                *(attribute_value(figure, reported.verdict.figures.values()) for figure in figures),
                ShownValue(reported.verdict.cycle and reported.verdict.cycle.most_axes, SAFE_AXES.key),
            )
        )
        for number, reported in enumerate(profiles, start=1)
    )
    return Table(columns, rows, Sentence(("All profiles, each under the timing model that decides",)))


@dataclass(frozen=True)
class PageSection:
    """One answer on a page."""

    key: str
    title: str
    command: str
    """The shell command that gives it again."""
    report: Report


@dataclass(frozen=True)
class ReportedProfile:
    """One profile of a page, with its answers."""

    argument: str
    """The PROFILE argument."""
    changes: KeyChanges
    """Changes of its file by options."""
    profile: Profile
    verdict: Verdict
    sections: tuple[PageSection, ...]
    """Its answers, that of `capacity` first."""
    missing: tuple[str, ...]
    """Why an answer is not among them that its reader expects."""

    def section(self, key: str) -> PageSection | None:
        """The answer of a name."""
        return next((section for section in self.sections if section.key == key), None)


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class ReportAnswer(Answer):
    """Answer of `report`: a page. `html` is its text, `save(path)` writes it.

    Parameters
    ----------
    profiles
        Each profile with its answers.
    title
        Heading of the page; None for the profile's name or the number of profiles.
    """

    profiles: tuple[ReportedProfile, ...]
    title: str | None

    def report(self) -> Report:
        """The answer in blocks."""
        page, changes = page_report(self.profiles, title=self.title), self.profiles[0].changes
        # As on the command line, where all profiles have the same ones.
        return changed_report(page, changes) if all(profile.changes == changes for profile in self.profiles) else page

    def _headline(self) -> str:
        return "; ".join(f"{each.profile.name}: {each.verdict.figures.verdict}" for each in self.profiles)


def report(
    profiles: ProfileLike | Iterable[ProfileLike],
    *,
    title: str | None = None,
    circle: bool | None = None,
    recording: FilePath | None = None,
    channel: str | None = None,
    progress: Progress | None = None,
    origins: Iterable[Origin] | None = None,
) -> ReportAnswer:
    """Put the answers for one or several profiles on one page.

    Parameters
    ----------
    profiles
        One or several: a `Profile`, a path or a shipped name each. The page names commands that repeat its answers; in
        those of a `Profile` stands the shipped one it was made from with its changes, else NAME.toml.
    title
        Heading of the page; by default the profile's name, or how many profiles.
    circle
        Run the circle test; by default of profiles whose servo values are measured.
    recording
        A recording of the machine of a single profile, as for `measured`: the page compares it with the plan, and shows
        its longest cycle.
    channel
        Channel of a CAN log; by default the only one.
    progress
        Called from time to time with the steps simulated and the steps known to be needed.
    origins
        How the page's commands give each profile, if not as above: a PROFILE argument, and the changes by options that
        the profile has already.

    Returns
    -------
    ReportAnswer
        Its `html` is the page, one file without network or script; `save("report.html")` writes it, and .md, .txt and
        .json. A notebook shows it.

    Raises
    ------
    BusplanError
        Not a profile, a title that is no words in one line, not an origin for each profile, or not a recording of the
        one profile.

    Examples
    --------
    >>> import busplan
    >>> page = busplan.report(["paper-4ms", "paper-1ms"])
    >>> page
    <ReportAnswer: paper-4ms: fits; paper-1ms: fits>
    >>> page.html.splitlines()[0], page.profiles[0].verdict.deciding.safe_axes
    ('<!DOCTYPE html>', 52)
    """
    if title is not None and (not isinstance(title, str) or has_controls(title) or not title.strip()):
        raise ArgumentError(f"title {title!r}: expected words in one line, without control characters")
    # A profile is iterable, too: over its sections.
    given = [profiles] if isinstance(profiles, Profile) else one_or_several(profiles, name="profiles")
    loaded = [load_profile(profile) for profile in given]
    if origins is None:
        origins = [
            origin_of(profile) if isinstance(profile, Profile) else (os.fspath(profile), NO_CHANGES)
            for profile in given
        ]
    if recording is not None and len(given) > 1:
        raise ArgumentError(f"recording: belongs to one profile, and there are {len(given)}")
    named = list(origins)
    if len(named) != len(given):
        raise BusplanError(f"origins: {len(named)} for {plural(len(given), 'profile')}; expected one for each")
    reported = []
    for number, ((argument, changes), profile) in enumerate(zip(named, loaded, strict=True)):
        part = None if progress is None else part_of(progress, number=number, of=len(loaded))
        with constants_changed(profile.constants):
            recorded = None if recording is None else (recording, channel)
            reported.append(_reported(profile, argument, changes, circle=circle, recorded=recorded, progress=part))
    return ReportAnswer(tuple(reported), title)


_Recording: TypeAlias = tuple[FilePath, str | None]
"""A recording, and its channel."""


def _reported(
    profile: Profile,
    argument: str,
    changes: KeyChanges,
    *,
    circle: bool | None,
    recorded: _Recording | None,
    progress: Progress | None,
) -> ReportedProfile:
    reason = too_large(profile)
    is_varied = profile.has_cycle and not reason
    bus, made = capacity(profile, sensitivity=is_varied), _Sections(profile, argument, changes)
    if profile.has_cycle and reason:
        made.missing.append(f"What moves the margin is not shown: {reason}.")
    of_bus = made.command("capacity", *(("--sensitivity",) if is_varied else ()))
    answers = (
        PageSection("capacity", "Every figure of the cycle", of_bus, bus.report()),
        *made.of_plan(),
        *(made.of_recording(*recorded) if recorded else ()),
        *(made.of_circle(progress) if _asks_for_circle(profile, circle) else ()),
        made.of_inputs(),
    )
    return ReportedProfile(argument, changes, profile, bus.verdicts[0], answers, tuple(made.missing))


class _Sections:
    """The answers for a profile, each with its command."""

    def __init__(self, profile: Profile, argument: str, changes: KeyChanges) -> None:
        self.profile, self.argument, self.changes = profile, argument, changes
        self.missing: list[str] = []
        """Why an answer is not there."""

    def command(self, name: str, *more: str, takes_period: bool = True) -> str:
        """A command with the changes of the profile."""
        changes, period_us = self.changes, self.profile.cycle.period_us
        if not takes_period:
            changes = KeyChanges(tuple(change for change in changes.entries if change.option != "--period"))
        return " ".join(
            ("busplan", name, shell_word(self.argument), *more, *change_options(changes, period_us=period_us))
        )

    def drawn(
        self, name: str, title: str, command: str, question: Callable[[Profile], Answer]
    ) -> Iterator[PageSection]:
        """An answer that may not be possible, with more groups or nodes than can be drawn, or without a whole cycle."""
        try:
            answer = question(self.profile).report()
        except BusplanError as error:
            self.missing.append(f"The {name} is not drawn: {error}.")
        else:
            yield PageSection(name.replace(" ", "_"), title, command, answer)

    def of_plan(self) -> Iterator[PageSection]:
        """Map, latencies and timeline."""
        has_cycle = self.profile.has_cycle
        if has_cycle:
            yield from self.drawn("map", "What fits, and what limits it", self.command("map"), map_)
        yield PageSection("latency", "Delay of data", self.command("latency"), latency(self.profile).report())
        if has_cycle:
            yield from self.drawn("timeline", "The cycle to scale", self.command("timeline"), timeline)

    def of_recording(self, path: FilePath, channel: str | None) -> Iterator[PageSection]:
        """A recording beside the plan, and its longest cycle."""
        file, on = shell_word(os.fspath(path)), () if channel is None else ("--channel", shell_word(channel))
        beside = measured(self.profile, path, channel=channel).report()
        yield PageSection("measured", "A recording beside the plan", self.command("measured", file, *on), beside)
        if self.profile.has_cycle:
            title, command = (
                "Where the time of a recorded cycle went",
                self.command("timeline", "--recording", file, *on),
            )
            yield from self.drawn("recorded cycle", title, command, partial(timeline, recording=path, channel=channel))

    def of_circle(self, progress: Progress | None) -> Iterator[PageSection]:
        """The circle test, where it can be run."""
        if refused := _circle_refused(self.profile):
            self.missing.append(f"The circle test cannot be run: {refused}.")
            return
        test = circle_test(self.profile, contributions=True, progress=progress).report()
        yield PageSection("circle", "The circle", self.command("circle-test", "--contributions"), test)

    def of_inputs(self) -> PageSection:
        """What the verdict rests on."""
        # The list of explain takes no --period.
        command = self.command("explain", takes_period=False)
        return PageSection("explain", "What it rests on", command, explain(self.profile).report())


def _asks_for_circle(profile: Profile, circle: bool | None) -> bool:
    """Whether a circle belongs on the page: asked for, or with measured servo values."""
    if circle is None:
        return profile.asks_for_circle and profile.servo.grades_given[0] == "measured"
    return circle


def _circle_refused(profile: Profile) -> str:
    """Reasons that no circle can be run; empty if one can."""
    if not profile.asks_for_circle:
        return "the profile has no section for it"
    return "; ".join(cause.message for cause in refusals(network_of(profile)))
