"""Answer of `busplan map`."""

from collections.abc import Iterator
from functools import partial

from busplan.forms.blocks import (
    Block,
    Chart,
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Swatch,
    Table,
    TableColumn,
    TableRow,
    count_value,
    joined,
    sentence,
)
from busplan.forms.columns import sentence_text
from busplan.forms.numbers import nouns
from busplan.questions.fit.network import bus_of
from busplan.questions.map.cells import Cell, Region
from busplan.questions.map.characters import map_lines
from busplan.questions.map.labels import LOOKS, limit_words, looks_of, map_title, setting_words, state_words
from busplan.questions.map.svg import STYLE, map_svg
from busplan.questions.map.trade_off import TradeOff
from busplan.questions.sweep.top import payload_sentences
from busplan.questions.words.documents import document, with_profile
from busplan.questions.words.own_picture import OwnPicture
from busplan.questions.words.sentences import refused_circle


def map_report(found: TradeOff) -> Report:
    """Report of `map`."""
    return Report(
        Sentence(("Map of ", Code(found.profile.name))),
        lambda: tuple(_blocks(found)),
        partial(map_document, found),
        lambda: with_profile(found.profile.name, map_document(found)["cells"]),
    )


def _blocks(found: TradeOff) -> Iterator[Block]:
    """How much fits and whether this design does, the picture, and what limits each region."""
    yield from refused_circle(found.profile)
    yield headline(found)
    yield from _remarks(found)
    yield map_chart(found)
    yield regions_table(found)


def headline(found: TradeOff) -> Sentence:
    """Say how many settings fit, and what this design does."""
    drawn, fitting = len(found.cells), sum(cell.state == "fits" for cell in found.cells)
    circle = " with a circle that passes" if found.with_circle else ""
    counts = sentence(
        f"{{}}: {{}} of {{}} {nouns(drawn, 'setting')} are shown to fit{circle}.",
        Code(found.profile.name),
        count_value(fitting),
        count_value(drawn),
    )
    own = found.own
    if own is None:
        return joined(counts, Sentence(("This design is not on the map: it has other values.",)))
    limit = limit_words(own, found.profile)
    text = f"This design ({setting_words(found, own)}): {state_words(own.state, found)}{limit and f', {limit}'}."
    tone = LOOKS[own.state].tone
    return joined(Sentence(counts.parts, "fails" if tone == "neutral" else tone), Sentence((text,)))


def _remarks(found: TradeOff) -> Iterator[Sentence]:
    """Say what is not drawn or not judged, and why."""
    missing = found.not_drawn
    if missing:
        number = count_value(len(missing))
        yield sentence(f"{{}} {nouns(len(missing), 'setting')} cannot exist, as {missing[0].reason}.", number)
    if any(cell.state == "circle not judged" for cell in found.cells):
        yield Sentence(("Not every circle is judged: no contour tolerance is asked for.",), "warns")
    yield from payload_sentences(found.profile, (found.x.key, found.y.key))


def map_chart(found: TradeOff) -> Chart:
    """The picture, with how much fits and what lies along which direction."""
    svg = partial(map_svg, found, title=sentence_text(headline(found)), inline=True)
    fitting = sum(cell.state == "fits" for cell in found.cells)
    marked = "" if found.own is None else ", this design marked"
    caption = sentence(f"{{}} of {{}} settings fit, {map_title(found)}{marked}", *_counts(fitting, len(found.cells)))
    return Chart(OwnPicture(svg, partial(map_lines, found), stylesheet=STYLE), caption)


def _counts(*numbers: int) -> tuple[ShownValue, ...]:
    return tuple(count_value(one) for one in numbers)


def regions_table(found: TradeOff) -> Table:
    """How many cells each region has, and what limits it; the legend of the picture."""
    columns = (
        TableColumn("state", kind="words"),
        TableColumn("limited by", kind="words", wraps=True),
        TableColumn("settings"),
    )
    rows = (_region_row(found, one) for one in found.regions)
    return Table(columns, tuple(rows), Sentence(("What limits each region",)))


def _region_row(found: TradeOff, one: Region) -> TableRow:
    look = looks_of(found)[one.state, one.limited_by]
    name = Swatch(look.ink, look.mark, state_words(one.state, found))
    cells = count_value(one.cells, "cells")
    return TableRow((name, limit_words(one, found.profile), cells))


def map_document(found: TradeOff) -> JsonDocument:
    """Document of `busplan map --format json`."""
    return document(
        "map",
        profile=found.profile.name,
        timing_model=bus_of(found.profile).deciding_model,
        x={"key": found.x.key, "values": list(found.x.values)},
        y={"key": found.y.key, "values": list(found.y.values)},
        with_circle=found.with_circle,
        design=None if found.own is None else _record(found, found.own),
        regions=[{**one._asdict(), "limited_by": list(one.limited_by)} for one in found.regions],
        cells=[_record(found, cell) for cell in found.cells],
        not_drawn=[{found.x.key: one.x, found.y.key: one.y, "reason": one.reason} for one in found.not_drawn],
    )


def _record(found: TradeOff, cell: Cell) -> Record:
    """A cell as plain data, its values under the keys of the directions, as in a row of a sweep."""
    safety = bus_of(found.profile).safety.figure
    return {
        found.x.key: cell.x,
        found.y.key: cell.y,
        "nodes": cell.nodes,
        "axes": cell.axes,
        "state": cell.state,
        "limited_by": list(cell.limited_by),
        "binding_term": cell.binding_term,
        "verdict": cell.verdict,
        "margin_corrected_us": cell.margin_corrected_us,
        "uncertainty_us": cell.uncertainty_us,
        **({} if safety is None else {safety.key: cell.is_safe}),
        "circle_refused_by": list(cell.circle_refused_by),
        "circle_passed": cell.circle_passed,
    }
