"""Digest of a sweep for people: how many points fit, and the first rows."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from busplan.buses.figure import EXCEEDED, TIMING_MODEL, VERDICT, Figure
from busplan.english import nouns
from busplan.errors import BusplanError
from busplan.forms import blocks
from busplan.questions.fit.certainty import FITS
from busplan.questions.sweep.rows import first_rows
from busplan.questions.sweep.table import Part, Sweep, column_figures
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

_MOST_SHOWN: Final = 10_000
"""Most rows of a report."""


def default_columns(sweep: Sweep) -> tuple[str, ...]:
    """Default figures of a table, with the safe nodes of each group.

    A network without a cycle has what its kind adds to a table, and the limits that are broken.
    """
    if not sweep.profile.has_cycle:
        return (*(figure.key for figure in sweep.bus_figures.table), EXCEEDED.key, VERDICT.key)
    of_groups = (f"group.{group.name}.safe_nodes" for group in sweep.profile.group)
    return (*_RANKS, *of_groups, *(key for key in _OF_CIRCLES if key in sweep.columns))


class Digest:
    """Counts of a sweep's points, and its first rows, gathered while its parts go by."""

    def __init__(self, sweep: Sweep, *, most: int) -> None:
        """Gather up to `most` rows. BusplanError: a report does not show so many."""
        if min(most, sweep.rows) > _MOST_SHOWN:
            raise BusplanError(
                f"{sweep.rows:,} rows are more than the {_MOST_SHOWN:,} that a report shows; CSV, JSON and Parquet "
                "have every row"
            )
        self._sweep, self._most = sweep, most
        self._columns = (*sweep.grid.axes, TIMING_MODEL.key, *default_columns(sweep))
        self._rows: list[blocks.Record] = []
        self._fitting: Counter[str] = Counter()
        self._passed = self._unjudged = self._unsafe = 0

    def counted(self, parts: Iterable[Part]) -> Iterator[Part]:
        """The parts, counted as they are asked for."""
        for part in parts:
            self._add(part)
            yield part

    def take(self, parts: Iterable[Part]) -> "Digest":
        """Count all parts, and return the digest."""
        for part in parts:
            self._add(part)
        return self

    def _add(self, part: Part) -> None:
        sweep = self._sweep
        if len(self._rows) < self._most:
            self._rows += first_rows(sweep, part, self._columns, self._most - len(self._rows))
        for model, columns in zip(sweep.timing_models, part.by_model, strict=True):
            fits = columns[VERDICT.key] == FITS if model == sweep.deciding_model else columns["fits"]
            self._fitting[model] += part.count(fits)
        # Settings of the bus and the circle are the same under every model.
        first = part.by_model[0]
        if sweep.circle:
            self._passed += part.count(first["passed"] == True)  # noqa: E712 - an array
            self._unjudged += part.count(first["passed"] == None)  # noqa: E711 - an array
        if sweep.safety.figure is not None:
            self._unsafe += part.count(np.logical_not(first[sweep.safety.figure.key].astype(bool)))

    def sentences(self) -> Iterator[blocks.Sentence]:
        """Sentences on the number of points, on those that fit, and on what is wrong at others."""
        sweep, points = self._sweep, self._sweep.grid.points
        head = blocks.sentence(
            f"{{}}: {{}} {nouns(points, 'point')}; ", blocks.Code(sweep.profile.name), _points(points, "points")
        )
        fitting = (
            blocks.sentence(
                f"{{}} shown to fit ({model} model)"
                if model == sweep.deciding_model
                else f"{{}} fit by the {model} model",
                _points(number),
            )
            for model, number in self._fitting.items()
        )
        yield blocks.joined(head, blocks.joined(*fitting, by=", "), blocks.Sentence((".",)), by="")
        if sweep.circle:
            yield from self._circles()
        yield from payload_sentences(sweep.profile, sweep.grid.axes)
        if sweep.group:
            yield blocks.sentence(
                "Axes are counted with more nodes of {}, with the other groups unchanged.", blocks.Code(sweep.group)
            )
        safety, unsafe = sweep.safety.figure, self._unsafe
        if unsafe and safety is not None:
            words = f"At {{}} {nouns(unsafe, 'point')} the {sweep.safety.setting} is unsafe ({safety.key})."
            yield blocks.sentence(words, _points(unsafe), state="warns")

    def _circles(self) -> Iterator[blocks.Sentence]:
        """Points whose circle holds every tolerance, under each timing model."""
        if self._unjudged:
            words = "The circle is not judged at {}: no contour tolerance is asked for, or no error source matters."
            yield blocks.sentence(words, _points(self._unjudged), state="warns")
        if self._unjudged < self._sweep.grid.points:
            counts = (
                blocks.sentence(f"{{}} by the {model} model", _points(self._passed))
                for model in self._sweep.timing_models
            )
            head = blocks.Sentence(("The circle holds every tolerance at ",))
            yield blocks.joined(head, blocks.joined(*counts, by=" and "), blocks.Sentence((".",)), by="")

    def rows(self) -> tuple[blocks.Sentence, blocks.Table]:
        """Table of the first rows, after their number; headings are the names of the columns."""
        columns, records, total = self._columns, self._rows, self._sweep.rows
        figures = column_figures(self._sweep)
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

    def report(self) -> blocks.Report:
        """The digest in blocks."""
        title = blocks.Sentence(("Sweep of ", blocks.Code(self._sweep.profile.name)))
        return blocks.Report(title, (*self.sentences(), *self.rows()), {})


def _points(number: int, key: str = "") -> blocks.ShownValue:
    return blocks.count_value(number, key, grouped=True)


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
