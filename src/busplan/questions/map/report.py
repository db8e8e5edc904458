"""Answer of `busplan map`."""

from collections.abc import Iterator, Mapping
from itertools import chain, pairwise
from math import isclose
from types import MappingProxyType
from typing import Final, NamedTuple

from busplan.buses.figure import MARGIN_CORRECTED, UNCERTAINTY, Ink, unit_of
from busplan.buses.parts import Value
from busplan.english import nouns
from busplan.forms import blocks, charts
from busplan.forms.blocks import State as Tone
from busplan.forms.numbers import period_value, sentence_text, with_unit
from busplan.questions.base.sentences import document, fields, with_profile
from busplan.questions.circle import CIRCLE_BY_KEY
from busplan.questions.fit.certainty import FITS, TIME
from busplan.questions.fit.grid import AXES
from busplan.questions.fit.network import PERIOD
from busplan.questions.map import Cell, Direction, MapAnswer, NotDrawn, Region, State
from busplan.questions.sweep.digest import payload_sentences
from busplan.sections.profile import Profile, varied_nodes

_DIGITS: Final = 6


class Look(NamedTuple):
    """Mark and colour of a state."""

    mark: str
    """Its character. Where a limit of the bus is broken, the letter of that limit replaces it."""
    ink: Ink
    tone: Tone
    """Its colour on a terminal."""


LOOKS: Final[Mapping[State, Look]] = MappingProxyType(
    {
        "fits": Look("#", "fits", "passes"),
        "circle fails": Look("%", "uneven", "fails"),
        "circle not judged": Look("+", "unjudged", "warns"),
        "circle cannot be run": Look("/", "refused", "fails"),
        "not shown to fit": Look("?", "unsure", "warns"),
        "unsafe": Look("!", "unsafe", "fails"),
        "does not fit": Look(".", "short", "neutral"),
    }
)
_BARRED: Final = Look("x", "barred", "neutral")
"""Cells where no period helps; the letter names the limit."""


def map_report(answer: MapAnswer) -> blocks.Report:
    """Report of `map`."""
    whole = map_document(answer)
    return blocks.Report(
        blocks.Sentence(("Map of ", blocks.Code(answer.profile.name))),
        tuple(_blocks(answer)),
        whole,
        with_profile(answer.profile.name, whole["cells"]),
    )


def _blocks(answer: MapAnswer) -> Iterator[blocks.Block]:
    """The number of settings that fit, the verdict on this design, the picture, and the limit of each region."""
    headline, looks = _headline(answer), _looks(answer)
    yield headline
    yield from _remarks(answer)
    if answer.y is None:
        if answer.profile.has_cycle:
            yield blocks.Chart(
                _curve(answer), blocks.Sentence((_CURVE.format(key=title_of(answer.x, answer.profile)),))
            )
        yield _values_table(answer)
        return
    title = " against ".join(title_of(direction, answer.profile) for direction in answer.directions)
    steps = "" if all(map(_is_even, answer.directions)) else "; steps are unequal"
    yield blocks.Chart(map_drawing(answer), blocks.Sentence((f"{title[:1].upper()}{title[1:]}{steps}",)))
    yield _regions_table(answer, looks)


def _headline(answer: MapAnswer) -> blocks.Sentence:
    """The number of settings that fit, and the verdict on this design."""
    fitting, drawn = _counts(answer)
    circle = " with a circle that passes" if answer.with_circle else ""
    words = f"{{}}: {{}} of {{}} {nouns(len(answer.cells), 'setting')} are shown to fit{circle}."
    counts = blocks.sentence(words, blocks.Code(answer.profile.name), fitting, drawn)
    design = answer.design
    if design is None:
        return blocks.joined(counts, blocks.Sentence(("This design is not on the map: it has other values.",)))
    tone = LOOKS[design.state].tone
    verdict = blocks.Sentence((f"This design ({_setting_words(answer, design)}): {_verdict_words(answer, design)}.",))
    return blocks.joined(blocks.Sentence(counts.parts, "fails" if tone == "neutral" else tone), verdict)


def _counts(answer: MapAnswer) -> tuple[blocks.ShownValue, blocks.ShownValue]:
    """Settings that fit, and all."""
    return blocks.count_value(sum(cell.state == FITS for cell in answer.cells)), blocks.count_value(len(answer.cells))


def _remarks(answer: MapAnswer) -> Iterator[blocks.Sentence]:
    """Settings that are not drawn or not judged, and why."""
    missing = answer.not_drawn
    if missing:
        number = blocks.count_value(len(missing))
        yield blocks.sentence(f"{{}} {nouns(len(missing), 'setting')} cannot exist, as {missing[0].reason}.", number)
    if any(cell.state == "circle not judged" for cell in answer.cells):
        yield blocks.Sentence(
            ("Not every circle is judged: no contour tolerance is asked for, or no error source matters.",), "warns"
        )
    yield from payload_sentences(answer.profile, [direction.key for direction in answer.directions])


_Looks = Mapping[tuple[State, tuple[str, ...]], Look]
"""The look of each region, by its state and limits."""


def _looks(answer: MapAnswer) -> _Looks:
    """The look of each region: that of its state, with a letter for each limit where no period helps."""
    looks = {(region.state, region.reasons): LOOKS[region.state] for region in answer.regions}
    barred = [limits for state, limits in looks if state == "does not fit" and limits != (TIME,)]
    # A limit alone has its own letter first; several together have b for both.
    barred.sort(key=len)
    names = (limits[0] if len(limits) == 1 else f"both{''.join(limits)}" for limits in barred)
    marks = zip(barred, charts.letters(names), strict=True)
    return looks | {("does not fit", limits): _BARRED._replace(mark=mark) for limits, mark in marks}


def map_drawing(answer: MapAnswer, *, frame: tuple[int, int] | None = None) -> charts.Drawing:
    """Picture of the verdict and its limit at each setting.

    `frame` is row and column of the setting to mark; by default those of this design.
    """
    looks, legend = _looks(answer), []
    for (state, limits), look in looks.items():
        limit = f": {' and '.join(limits)}" if look.ink == _BARRED.ink else ""
        legend.append(charts.Entry(look.ink, f"{_state_words(answer, state)}{limit}", look.mark))
    design = None
    if frame is not None or answer.design_place is not None:
        row, column = frame or answer.design_place or (0, 0)
        design = (column, row)
        legend.append(charts.Entry("frame", "this design" if frame is None else "this setting"))
    if answer.not_drawn:
        legend.append(charts.Entry("blank", "blank: cannot exist"))
    up, across = (
        charts.choices(
            f"{title_of(direction, answer.profile)}{'' if _is_even(direction) else ' in unequal steps'}",
            (value_text(direction, value) for value in direction.values),
            own=place,
        )
        for direction, place in zip(answer.directions, design[::-1] if design else (None, None), strict=True)
    )
    rows = tuple(tuple(_cell(answer, cell, looks) for cell in row) for row in answer.rows)
    title = sentence_text(_headline(answer))
    return charts.Drawing(
        title, (charts.Panel(charts.ChartGrid(across, up, rows, tuple(legend), design)),), has_characters=True
    )


_CURVE: Final = "Free time with its uncertainty, over {key}"
_MOST_DOTS: Final = 24
"""Most points of a curve that have a mark each."""


def _curve(answer: MapAnswer) -> charts.Drawing:
    """Draw the free time of one varied key, its uncertainty, and where it is not shown to fit."""
    names = [value_text(answer.x, value) for value in answer.x.values]
    values = [value for value in answer.x.values if isinstance(value, int | float) and not isinstance(value, bool)]
    is_line = len(values) == len(names)
    places = [float(value) for value in values] if is_line else [float(place) for place in range(len(names))]
    row = [cell if isinstance(cell, Cell) else None for cell in answer.rows[0]]
    free_us, ends_us = [cell and cell.margin_corrected_us for cell in row], [cell and _ends_us(cell) for cell in row]
    own = None if answer.design_place is None else places[answer.design_place[1]]
    title = title_of(answer.x, answer.profile)
    unit = unit_of(answer.x.key)
    label = f"{title}, {unit}" if unit and is_line else title
    across = charts.numbers(label, places[0], places[-1]) if is_line else charts.choices(label, names, own=own)
    shown_us = [us for us in (0.0, *free_us, *chain(*filter(None, ends_us))) if us is not None]
    middles = [(left + right) / 2 for left, right in pairwise(places)]
    edges = [across.low, *middles, across.high]
    shades = (
        charts.Shade(charts.Entry(LOOKS[cell.state].ink, _state_words(answer, cell.state)), *ends)
        for cell, *ends in zip(row, edges, edges[1:], strict=False)
        if cell is not None and cell.state != FITS
    )
    curves = [
        charts.Curve(
            charts.Entry("first", "free time", "o", "line"),
            tuple(zip(places, free_us, strict=True)),
            words=tuple("" if cell is None else _cell_words(answer, cell) for cell in row),
            has_dots=len(places) <= _MOST_DOTS,
            has_line=is_line,
        )
    ]
    if any(ends_us):
        curves += [
            charts.Curve(
                charts.Entry("gap", "with its uncertainty" if end else "", shape="line"),
                tuple((place, ends and ends[end]) for place, ends in zip(places, ends_us, strict=True)),
                has_dots=not is_line,
                has_line=is_line,
            )
            for end in (0, 1)
        ]
    guides = [charts.Guide(charts.Entry("limit", "no free time", shape="line"), y=0.0)]
    guides += [] if own is None else [charts.Guide(charts.Entry("own", "this design", shape="line"), x=own)]
    up = charts.numbers("free time, us", min(shown_us), max(shown_us), room=0.06)
    return charts.Drawing(
        sentence_text(_headline(answer)),
        (charts.Panel(charts.Curves(across, up, tuple(curves), tuple(guides), tuple(shades))),),
    )


def _ends_us(cell: Cell) -> tuple[float, float] | None:
    """Ends of the free time by its uncertainty; None where that is unknown [us]."""
    if cell.margin_corrected_us is None or cell.uncertainty_us is None:
        return None
    return cell.margin_corrected_us - cell.uncertainty_us, cell.margin_corrected_us + cell.uncertainty_us


def _values_table(answer: MapAnswer) -> blocks.Table:
    """Verdict, limit and free time at each value of one key."""
    columns = (
        blocks.TableColumn(title_of(answer.x, answer.profile), kind="words"),
        blocks.TableColumn("verdict", kind="words"),
        blocks.TableColumn("limited by", kind="words", wraps=True),
        *((blocks.TableColumn("free", "us"), blocks.TableColumn("+/-", "us")) if answer.profile.has_cycle else ()),
    )
    rows = []
    for cell in answer.cells:
        state = blocks.Words(_state_words(answer, cell.state), LOOKS[cell.state].tone)
        times = [blocks.attribute_value(figure, cell) for figure in (MARGIN_CORRECTED, UNCERTAINTY)]
        words = (value_text(answer.x, cell.x), state, _limit_words(answer, cell))
        rows.append(
            blocks.TableRow((*words, *(times if answer.profile.has_cycle else ())), highlighted=cell is answer.design)
        )
    return blocks.Table(columns, tuple(rows), heads=1)


def _cell_words(answer: MapAnswer, cell: Cell) -> str:
    return f"{_setting_words(answer, cell)}: {_verdict_words(answer, cell)}"


def _cell(answer: MapAnswer, cell: Cell | NotDrawn, looks: _Looks) -> charts.ChartCell | None:
    if isinstance(cell, NotDrawn):
        return None
    look = looks[cell.state, cell.reasons]
    return charts.ChartCell(look.ink, look.mark, _cell_words(answer, cell), look.tone)


def _regions_table(answer: MapAnswer, looks: _Looks) -> blocks.Table:
    """State, limit and number of settings of each region."""
    columns = (
        blocks.TableColumn("state", kind="words"),
        blocks.TableColumn("limited by", kind="words", wraps=True),
        blocks.TableColumn("settings"),
    )
    rows = []
    for region in answer.regions:
        look = looks[region.state, region.reasons]
        state = blocks.Swatch(look.ink, look.mark, _state_words(answer, region.state))
        rows.append(blocks.TableRow((state, _limit_words(answer, region), blocks.count_value(region.cells, "cells"))))
    return blocks.Table(columns, tuple(rows), blocks.Sentence(("What limits each region",)))


def circle_words(answer: MapAnswer, cell: Cell) -> blocks.Sentence | None:
    """Result of the circle test of a cell; None if none was asked for, or the cell does not fit."""
    if not answer.with_circle or cell.verdict != FITS or cell.state == "unsafe":
        return None
    words = ", ".join(("passes" if cell.state == FITS else cell.state.removeprefix("circle "), *cell.reasons))
    if cell.max_contour_error_mm is None:
        return blocks.Sentence((words,), LOOKS[cell.state].tone)
    error = blocks.attribute_value(CIRCLE_BY_KEY["max_contour_error_mm"], cell)
    return blocks.sentence(f"{words}; largest error {{}}", error, state=LOOKS[cell.state].tone)


def _setting_words(answer: MapAnswer, cell: Cell) -> str:
    """The setting of a cell, as "8 axes, period 4 ms"."""
    words = []
    values = answer.values_at(cell)
    for direction in reversed(answer.directions):
        text = value_text(direction, values[direction.key])
        axes = nouns(1 if text == "1" else 2, "axis")
        words.append(f"{text} {axes}" if direction.key == AXES else f"{title_of(direction, answer.profile)} {text}")
    return ", ".join(words)


def _verdict_words(answer: MapAnswer, cell: Cell) -> str:
    """The state of a cell, and its limit where it does not fit."""
    return ", ".join(filter(None, (_state_words(answer, cell.state), _limit_words(answer, cell))))


def _state_words(answer: MapAnswer, state: State) -> str:
    if state == "unsafe":
        return f"unsafe {answer.safety.setting}"
    return f"{state}, and the circle passes" if state == FITS and answer.with_circle else state


def _limit_words(answer: MapAnswer, region: Region | Cell) -> str:
    """Limits that keep a region from fitting; empty where it fits."""
    words = " and ".join(region.reasons)
    if region.reasons != (TIME,):
        return words
    return f"{words}, largest term {answer.bus_figures.term_label(region.binding_term)}"


def title_of(direction: Direction, profile: Profile) -> str:
    """Name of a direction in words."""
    if direction.key == AXES:
        return f"axes ({varied_nodes(profile).nodes_key})"
    return "period" if direction.key == PERIOD else direction.key


def value_text(direction: Direction, value: Value) -> str:
    """Write a value of a direction in few characters: only a period has its unit, any other is in that of its key."""
    if isinstance(value, str | bool):
        return str(value).lower() if isinstance(value, bool) else value
    shown = period_value(value) if direction.key == PERIOD else blocks.ShownValue(value)
    return with_unit(shown._replace(digits=_DIGITS))


def _is_even(direction: Direction) -> bool:
    """Whether the values are words, or numbers in equal steps."""
    values = [value for value in direction.values if not isinstance(value, str)]
    steps = [after - before for before, after in pairwise(values)]
    return len(values) < len(direction.values) or all(isclose(step, steps[0], rel_tol=1e-6) for step in steps)


def map_document(answer: MapAnswer) -> blocks.JsonDocument:
    """Document of `busplan map --format json`."""
    return document(
        "map",
        profile=answer.profile.name,
        timing_model=answer.timing_model,
        x={"key": answer.x.key, "values": list(answer.x.values)},
        y=None if answer.y is None else {"key": answer.y.key, "values": list(answer.y.values)},
        with_circle=answer.with_circle,
        design=None if answer.design is None else _record(answer, answer.design),
        regions=[fields(region, *region._fields) for region in answer.regions],
        cells=[_record(answer, cell) for cell in answer.cells],
        not_drawn=[{**answer.values_at(absent), "reason": absent.reason} for absent in answer.not_drawn],
    )


def _record(answer: MapAnswer, cell: Cell) -> blocks.Record:
    """A cell as plain data, its values under the keys of the directions, as in a row of a sweep."""
    safety = answer.safety.figure
    return {
        **answer.values_at(cell),
        **fields(cell, "nodes", "axes", "state", "reasons", "binding_term", "verdict"),
        **fields(cell, "available_us", "margin_corrected_us", "uncertainty_us"),
        **({} if safety is None else {safety.key: cell.is_safe}),
        **fields(cell, "circle_passed", "max_contour_error_mm"),
    }
