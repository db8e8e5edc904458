"""Digest of a sweep for people: how many points fit, and the top rows."""

from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from busplan.buses.figure import EXCEEDED, TIMING_MODEL, VERDICT, Figure
from busplan.english import nouns
from busplan.forms import blocks
from busplan.questions.fit.certainty import FITS
from busplan.questions.sweep.rows import plain_rows
from busplan.questions.sweep.table import Columns, Sweep, column_figures
from busplan.sections.profile import Profile

_RANKS: Final[Mapping[str, int]] = MappingProxyType(
    {
        "required_us": 3,
        "available_us": 6,
        "margin_us": 1,
        "margin_corrected_us": 0,
        "uncertainty_us": 2,
        "max_axes": 4,
        "safe_axes": 0,
        "safe_limited_by": 5,
        "verdict": 0,
    }
)
"""Default figures of a table, each with its `TableColumn.rank`."""
_OF_CIRCLES: Final = (*("mean_contour_error_mm", "max_contour_error_mm", "phase_margin_deg", "passed"),)
"""Default figures of circle tests."""


def default_columns(sweep: Sweep) -> tuple[str, ...]:
    """Default figures of a table, with the safe nodes of each group.

    A network without a cycle has what its kind adds to a table, and the limits that are broken.
    """
    if not sweep.profile.has_cycle:
        return (*(figure.key for figure in sweep.bus_figures.table), EXCEEDED.key, VERDICT.key)
    of_groups = (f"group.{group.name}.safe_nodes" for group in sweep.profile.group)
    return (*_RANKS, *of_groups, *(key for key in _OF_CIRCLES if key in sweep.columns))


def sentences(sweep: Sweep, table: Columns) -> Iterator[blocks.Sentence]:
    """Sentences on the number of points, and of those that fit."""
    points = sweep.grid.points
    head = blocks.sentence(
        f"{{}}: {{}} {nouns(points, 'point')}; ", blocks.Code(sweep.profile.name), _points(points, "points")
    )
    fitting = (
        blocks.sentence(f"{{}} shown to fit ({model} model)", _points(np.sum(rows[VERDICT.key] == FITS)))
        if model == sweep.deciding_model
        else blocks.sentence(f"{{}} fit by the {model} model", _points(np.sum(rows["fits"])))
        for model, rows in _by_model(sweep, table)
    )
    yield blocks.joined(head, blocks.joined(*fitting, by=", "), blocks.Sentence((".",)), by="")
    # Settings of the bus and the circle are the same under every model.
    _, first = next(_by_model(sweep, table))
    if sweep.circle:
        yield from _circles(sweep, table)
    yield from payload_sentences(sweep.profile, sweep.grid.axes)
    if sweep.group:
        yield blocks.sentence(
            "Axes are counted with more nodes of {}, with the other groups unchanged.", blocks.Code(sweep.group)
        )
    safety = sweep.safety.figure
    unsafe = 0 if safety is None else np.sum(~first[safety.key].astype(bool))
    if unsafe and safety is not None:
        words = f"At {{}} {nouns(int(unsafe), 'point')} the {sweep.safety.setting} is unsafe ({safety.key})."
        yield blocks.sentence(words, _points(unsafe), state="warns")


def _by_model(sweep: Sweep, table: Columns) -> Iterator[tuple[str, Columns]]:
    """Each timing model with its rows, one for each point."""
    models = sweep.timing_models
    return (
        (model, {name: column[number :: len(models)] for name, column in table.items()})
        for number, model in enumerate(models)
    )


def _points(number: float, key: str = "") -> blocks.ShownValue:
    return blocks.count_value(int(number), key, grouped=True)


def _circles(sweep: Sweep, table: Columns) -> Iterator[blocks.Sentence]:
    """Points whose circle holds every tolerance, under each timing model."""
    passed = {model: rows["passed"].tolist() for model, rows in _by_model(sweep, table)}
    unjudged = next(iter(passed.values())).count(None)
    yield from _unjudged(unjudged)
    if unjudged < sweep.grid.points:
        counts = (
            blocks.sentence(f"{{}} by the {model} model", _points(results.count(True)))
            for model, results in passed.items()
        )
        head = blocks.Sentence(("The circle holds every tolerance at ",))
        yield blocks.joined(head, blocks.joined(*counts, by=" and "), blocks.Sentence((".",)), by="")


def _unjudged(points: int) -> Iterator[blocks.Sentence]:
    if points:
        words = "The circle is not judged at {}: no contour tolerance is asked for, or no error source matters."
        yield blocks.sentence(words, _points(points), state="warns")


def first_rows(sweep: Sweep, table: Columns, *, most: int | None) -> tuple[blocks.Sentence, blocks.Table]:
    """Table of the first rows, after their number; headings are the names of the columns.

    At most `most` rows; None for all.
    """
    columns = (*sweep.grid.axes, TIMING_MODEL.key, *default_columns(sweep))
    total = table[TIMING_MODEL.key].size
    figures = column_figures(sweep)
    records = plain_rows(sweep, {name: table[name] for name in columns}, np.arange(total)[:most])
    shown, words = _points(len(records)), f"{nouns(total, 'row')}."
    return (
        blocks.sentence(f"{{}} of {{}} {words}", shown, _points(total))
        if len(records) < total
        else blocks.sentence(f"{{}} {words}", shown),
        blocks.Table(
            tuple(_column(name, figures.get(name), rank=_RANKS.get(name, 0)) for name in columns),
            tuple(blocks.TableRow(tuple(_cells(record, figures))) for record in records),
            heads=columns.index(TIMING_MODEL.key) + 1,
        ),
    )


def payload_sentences(profile: Profile, varied: Collection[str]) -> Iterator[blocks.Sentence]:
    """Sentence that the payload does not follow the axes of a node, where these vary."""
    for nodes in profile.node_groups:
        if nodes.node_key("axes") not in varied or nodes.payload.follows_axes:
            continue
        section = f"group.{nodes.name}" if nodes.name else "payload"
        keys = blocks.Code(f"{section}.read_bytes_per_axis"), blocks.Code(f"{section}.write_bytes_per_axis")
        yield blocks.sentence("The payload does not depend on the axes of a node: {} and {} say what each adds.", *keys)


def _column(name: str, figure: Figure | None, *, rank: int) -> blocks.TableColumn:
    if figure is None:
        return blocks.TableColumn(name)
    # The name ends in any other unit.
    unit = "%" if figure.column == "%" else ""
    return blocks.TableColumn(name, unit, kind="words" if figure.sort in ("word", "words") else "figures", rank=rank)


def _cells(record: blocks.Record, figures: Mapping[str, Figure]) -> Iterator[blocks.ShownValue]:
    for name, value in record.items():
        figure = figures.get(name)
        if figure is None:
            yield blocks.ShownValue(value, name)
        else:
            shown = blocks.figure_value(figure, value)
            # In the unit of the column's name; a length in mm has three more decimals than one in um.
            finer = 3 if figure.unit == "mm" and figure.column == "um" else 0
            yield shown._replace(unit=figure.unit or shown.unit, decimals=shown.decimals and shown.decimals + finer)
