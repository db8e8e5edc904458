"""The page of `busplan report`: a first screen for somebody who decides, and the answers one after the other."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from busplan.buses.figure import (
    AXES,
    MARGIN_CORRECTED,
    NODES,
    PERIOD,
    SAFE_AXES,
    UNCERTAINTY,
    UTILISATION,
    VERDICT,
)
from busplan.english import plural
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
    Table,
    TableColumn,
    TableRow,
    attribute_value,
)
from busplan.questions.base.shell import shell_word
from busplan.questions.capacity.lines import card
from busplan.questions.words.documents import document

if TYPE_CHECKING:
    from busplan.questions.report import ReportedProfile, Section


def page_report(profiles: "Sequence[ReportedProfile]", *, title: str | None = None) -> Report:
    """Make the page: a chapter for each profile, after a comparison if there are several.

    Parameters
    ----------
    profiles
        One or more.
    title
        Title of the page; by default the profile's name, or the number of profiles.
    """
    own = Code(profiles[0].network.profile.name) if len(profiles) == 1 else plural(len(profiles), "profile")
    return Report(
        Sentence((own if title is None else title,)),
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
                "profile": each.network.profile.name,
                "answers": {section.key: dict(section.report.document) for section in each.sections},
                "missing": list(each.missing),
            }
            for each in profiles
        ],
    )


def _blocks(profiles: "Sequence[ReportedProfile]") -> Iterator[Block]:
    if len(profiles) == 1:
        yield from _chapter(profiles[0])
        return
    yield Chapter(Sentence(("Comparison",)), (_comparison(profiles),), "comparison", "comparison")
    for number, profile in enumerate(profiles, start=1):
        yield Chapter(Sentence((Code(profile.network.profile.name),)), tuple(_chapter(profile)), key=f"p{number}")


def _chapter(reported: "ReportedProfile") -> Iterator[Block]:
    """The first screen, and every answer behind a fold."""
    description = reported.network.profile.description
    if description.strip():
        yield Sentence((" ".join(description.split()),))
    yield card(reported.verdict)
    yield from (Sentence((words,), "warns") for words in reported.missing)
    trade_off = reported.section("map")
    if trade_off is not None:
        yield from (block for block in trade_off.report.blocks if isinstance(block, Chart))
    yield from map(_folded, reported.sections)


_ON_FIRST_SCREEN: Final = {"capacity": Card, "map": Chart}
"""Blocks of an answer that stand on the first screen already."""


def _folded(section: "Section") -> Chapter:
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
    figures = (VERDICT, PERIOD, NODES, AXES, UTILISATION, MARGIN_CORRECTED, UNCERTAINTY, SAFE_AXES)
    rows = tuple(
        TableRow(
            (
                SectionLink(each.network.profile.name, f"p{number}", shell_word(each.argument)),
                *(attribute_value(figure, each.verdict.deciding) for figure in figures),
            )
        )
        for number, each in enumerate(profiles, start=1)
    )
    return Table(columns, rows, Sentence(("All profiles, each under the timing model that decides",)))
