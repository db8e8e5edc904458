"""Answer of `busplan map`."""

from collections.abc import Iterator

from busplan.english import nouns
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
from busplan.forms.numbers import sentence_text
from busplan.questions.map.drawing import (
    LOOKS,
    limit_words,
    looks_of,
    map_drawing,
    map_title,
    setting_words,
    state_words,
)
from busplan.questions.map.trade_off import Cell, Region, TradeOff
from busplan.questions.sweep.digest import payload_sentences
from busplan.questions.words.documents import document, fields, with_profile


def map_report(trade_off: TradeOff) -> Report:
    """Report of `map`."""
    return Report(
        Sentence(("Map of ", Code(trade_off.profile.name))),
        tuple(_blocks(trade_off)),
        map_document(trade_off),
        with_profile(trade_off.profile.name, map_document(trade_off)["cells"]),
    )


def _blocks(trade_off: TradeOff) -> Iterator[Block]:
    """How much fits and whether this design does, the picture, and what limits each region."""
    yield headline(trade_off)
    yield from _remarks(trade_off)
    yield map_chart(trade_off)
    yield regions_table(trade_off)


def headline(trade_off: TradeOff) -> Sentence:
    """Say how many settings fit, and what this design does."""
    drawn, fitting = len(trade_off.cells), sum(cell.state == "fits" for cell in trade_off.cells)
    circle = " with a circle that passes" if trade_off.with_circle else ""
    counts = sentence(
        f"{{}}: {{}} of {{}} {nouns(drawn, 'setting')} are shown to fit{circle}.",
        Code(trade_off.profile.name),
        count_value(fitting),
        count_value(drawn),
    )
    own = trade_off.own
    if own is None:
        return joined(counts, Sentence(("This design is not on the map: it has other values.",)))
    limit = limit_words(own, trade_off)
    text = (
        f"This design ({setting_words(trade_off, own)}): {state_words(own.state, trade_off)}{limit and f', {limit}'}."
    )
    tone = LOOKS[own.state].tone
    return joined(Sentence(counts.parts, "fails" if tone == "neutral" else tone), Sentence((text,)))


def _remarks(trade_off: TradeOff) -> Iterator[Sentence]:
    """Say what is not drawn or not judged, and why."""
    missing = trade_off.not_drawn
    if missing:
        number = count_value(len(missing))
        yield sentence(f"{{}} {nouns(len(missing), 'setting')} cannot exist, as {missing[0].reason}.", number)
    if any(cell.state == "circle not judged" for cell in trade_off.cells):
        yield Sentence(
            ("Not every circle is judged: no contour tolerance is asked for, or no error source matters.",), "warns"
        )
    yield from payload_sentences(trade_off.profile, (trade_off.x.key, trade_off.y.key))


def map_chart(trade_off: TradeOff) -> Chart:
    """The picture, with how much fits and what lies along which direction."""
    fitting = sum(cell.state == "fits" for cell in trade_off.cells)
    marked = "" if trade_off.own is None else ", this design marked"
    caption = sentence(
        f"{{}} of {{}} settings fit, {map_title(trade_off)}{marked}", *_counts(fitting, len(trade_off.cells))
    )
    return Chart(map_drawing(trade_off, title=sentence_text(headline(trade_off))), caption)


def _counts(*numbers: int) -> tuple[ShownValue, ...]:
    return tuple(count_value(number) for number in numbers)


def regions_table(trade_off: TradeOff) -> Table:
    """How many cells each region has, and what limits it; the legend of the picture."""
    columns = (
        TableColumn("state", kind="words"),
        TableColumn("limited by", kind="words", wraps=True),
        TableColumn("settings"),
    )
    rows = (_region_row(trade_off, region) for region in trade_off.regions)
    return Table(columns, tuple(rows), Sentence(("What limits each region",)))


def _region_row(trade_off: TradeOff, region: Region) -> TableRow:
    look = looks_of(trade_off)[region.state, region.limited_by]
    name = Swatch(look.ink, look.mark, state_words(region.state, trade_off))
    cells = count_value(region.cells, "cells")
    return TableRow((name, limit_words(region, trade_off), cells))


def map_document(trade_off: TradeOff) -> JsonDocument:
    """Document of `busplan map --format json`."""
    return document(
        "map",
        profile=trade_off.profile.name,
        timing_model=trade_off.network.bus.deciding_model,
        x={"key": trade_off.x.key, "values": list(trade_off.x.values)},
        y={"key": trade_off.y.key, "values": list(trade_off.y.values)},
        with_circle=trade_off.with_circle,
        design=None if trade_off.own is None else _record(trade_off, trade_off.own),
        regions=[fields(region, *region._fields) for region in trade_off.regions],
        cells=[_record(trade_off, cell) for cell in trade_off.cells],
        not_drawn=[
            {trade_off.x.key: absent.x, trade_off.y.key: absent.y, "reason": absent.reason}
            for absent in trade_off.not_drawn
        ],
    )


def _record(trade_off: TradeOff, cell: Cell) -> Record:
    """A cell as plain data, its values under the keys of the directions, as in a row of a sweep."""
    safety = trade_off.network.bus.safety.figure
    return {
        trade_off.x.key: cell.x,
        trade_off.y.key: cell.y,
        **fields(cell, "nodes", "axes", "state", "limited_by", "binding_term", "verdict"),
        **fields(cell, "margin_corrected_us", "uncertainty_us"),
        **({} if safety is None else {safety.key: cell.is_safe}),
        **fields(cell, "circle_passed"),
    }
