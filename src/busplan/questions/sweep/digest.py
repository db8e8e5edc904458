"""Digest of a sweep for people: how many points fit, and the top rows."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from math import isnan
from types import MappingProxyType
from typing import Final, NoReturn

import numpy as np

from busplan.buses.figure import CIRCLE_REFUSED_BY, EXCEEDED, TIMING_MODEL, VERDICT, Figure
from busplan.errors import BusplanError
from busplan.forms.blocks import (
    Code,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    count_value,
    figure_value,
    joined,
    sentence,
)
from busplan.forms.numbers import nouns
from busplan.questions.fit.certainty import FITS, VERDICTS
from busplan.questions.fit.figures import COUNTS
from busplan.questions.fit.network import bus_of
from busplan.questions.sweep.asked import Sweep, column_figures
from busplan.questions.sweep.blocks import SweepBlock
from busplan.questions.sweep.grid import Array
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
CIRCLE_COLUMNS: Final = ("mean_contour_error_mm", "max_contour_error_mm", "phase_margin_deg", "passed")
"""Default figures of circle tests."""
SUMMARY_COLUMNS: Final = (
    *("failed_share", "failed_share_high", "max_contour_error_mean_mm"),
    *("max_contour_error_std_mm", "max_contour_error_p95_mm", "max_contour_error_worst_mm"),
)
"""Default figures of a summary over seeds."""


def default_columns(sweep: Sweep) -> tuple[str, ...]:
    """Default figures of a table; where nodes are in groups, counts of each instead of those of the whole.

    A network without a cycle has what its kind adds to a table, and the limits that are broken.
    """
    if not sweep.profile.has_cycle:
        return (*(figure.key for figure in bus_of(sweep.profile).figures.table), EXCEEDED.key, VERDICT.key)
    of_circle = (key for key in (*CIRCLE_COLUMNS, *SUMMARY_COLUMNS) if key in sweep.columns)
    if not sweep.profile.group:
        return (*_RANKS, *of_circle)
    whole = (key for key in _RANKS if key not in COUNTS)
    return (*whole, *(f"group.{group.name}.safe_nodes" for group in sweep.profile.group), *of_circle)


def _not_kept() -> NoReturn:
    raise BusplanError("a sweep's document has every row: it is written as the rows come, and not from a few of them")


class Digest:
    """Counts of a sweep in sentences, and its first or best rows, from blocks that pass by and are not kept.

    Parameters
    ----------
    sweep
        The sweep; its columns are those of the rows.
    top
        How many rows.
    sort_by
        Column in numbers to sort by; None for the order of the grid.
    ascending
        Smallest first.
    """

    def __init__(self, sweep: Sweep, *, top: int, sort_by: str | None = None, ascending: bool = False) -> None:
        self.points = 0
        """Points so far."""
        self._sweep, self._bus = sweep, bus_of(sweep.profile)
        self._top, self._sort_by = top, sort_by
        self._sign = 1.0 if ascending else -1.0
        self._kept: list[tuple[float, Record]] = []
        """The top rows, each after its rank, the smallest first."""
        self._fits = [0] * len(sweep.timing_models)
        self._passed = [0] * len(sweep.timing_models)
        self._counts: Counter[str] = Counter()
        self._refused_by: dict[str, None] = {}

    def add(self, block: SweepBlock) -> None:
        """Take one more block; blocks come in the order of the grid."""
        self._keep_top(block)
        points = block.chunk.points
        self.points += points
        for number, (model, figures) in enumerate(zip(self._sweep.timing_models, block.models, strict=True)):
            decides = model == self._bus.deciding_model
            flags = np.equal(figures["verdict"].values, VERDICTS.index(FITS)) if decides else figures["fits"].values
            self._fits[number] += _share(flags, points)
            if "passed" in figures:
                self._passed[number] += _share(figures["passed"].are_true, points)
        # Settings of the bus and the circle are the same under every model.
        figures = block.models[0]
        refused = figures[CIRCLE_REFUSED_BY.key]
        for code, keys in enumerate(refused.words or ()):
            if isinstance(keys, list) and keys:
                self._counts["refused"] += _share(np.equal(refused.values, code), points)
                self._refused_by |= dict.fromkeys(keys)
        if self._bus.safety.figure is not None:
            self._counts["unsafe"] += points - _share(figures[self._bus.safety.figure.key].values, points)
        if "passed" in figures:
            self._counts["unjudged"] += _share(figures["passed"].are_missing, points)
        if "failed_share" in figures:
            failed = figures["failed_share"].values
            self._counts["never"] += int(np.sum(failed == 0))
            self._counts["always"] += int(np.sum(failed == 1))
            self._counts["unjudged"] += int(np.sum(np.isnan(failed)))
            self._counts["unmoved"] += int(np.sum(figures["max_contour_error_std_mm"].values == 0))

    def _keep_top(self, block: SweepBlock) -> None:
        columns = self._sweep.columns
        if self._sort_by is None:
            rows = block.chunk.points * len(block.models)
            chosen = range(min(rows, self._top - len(self._kept)))
            self._kept += [(0.0, block.row(index, columns)) for index in chosen]
            return
        ranks = self._sign * block.rows(self._sort_by).astype(float)
        worst = self._kept[-1][0] if len(self._kept) >= self._top else np.inf
        # NaN never ranks; among equals, the first in the grid stays.
        better = np.flatnonzero(ranks < worst)
        best = better[np.argsort(ranks[better], kind="stable")[: self._top]]
        self._kept += [(float(ranks[index]), block.row(int(index), columns)) for index in best]
        self._kept = sorted(self._kept, key=lambda ranked: ranked[0])[: self._top]

    @property
    def rows(self) -> list[Record]:
        """The top rows so far."""
        return [record for _, record in self._kept]

    def sentences(self) -> Iterator[Sentence]:
        """How many points there are, and how many fit."""
        sweep = self._sweep
        expected = sweep.grid.points
        whole = count_value(expected, "points", grouped=True)
        points = whole if self.points == expected else count_value(self.points, grouped=True)
        cut = Sentence(()) if self.points == expected else sentence(" of {} (interrupted)", whole)
        head = sentence(f"{{}}: {{}} {nouns(self.points, 'point')}", Code(sweep.profile.name), points)
        yield joined(head, cut, Sentence(("; ",)), self._fitting(), Sentence((".",)), by="")
        refused = self._counts["refused"]
        if refused:
            words = f"The circle cannot be run at {{}} {nouns(refused, 'point')}: {', '.join(self._refused_by)}."
            yield sentence(words, count_value(refused, grouped=True), state="fails")
        yield from self._over_seeds() if sweep.seeds is not None else self._circles()
        yield from payload_sentences(sweep.profile, sweep.grid.axes)
        safety = self._bus.safety.figure
        if self._counts["unsafe"] and safety is not None:
            words = f"At {{}} points the {self._bus.safety.setting} is unsafe ({safety.key})."
            yield sentence(words, count_value(self._counts["unsafe"], grouped=True), state="warns")

    def _fitting(self) -> Sentence:
        parts = (
            sentence(
                f"{{}} shown to fit ({model} model)"
                if model == self._bus.deciding_model
                else f"{{}} fit by the closed form of the {model} model",
                count_value(count, grouped=True),
            )
            for count, model in zip(self._fits, self._sweep.timing_models, strict=True)
        )
        return joined(*parts, by=", ")

    def _circles(self) -> Iterator[Sentence]:
        """Circle tests without a summary over seeds."""
        yield from self._unjudged()
        if self._sweep.circle and self._counts["unjudged"] < self.points:
            passed = (
                sentence(f"{{}} by the {model} model", count_value(count, grouped=True))
                for count, model in zip(self._passed, self._sweep.timing_models, strict=True)
            )
            head = Sentence(("The circle holds every tolerance at ",))
            yield joined(head, joined(*passed, by=" and "), Sentence((".",)), by="")

    def _over_seeds(self) -> Iterator[Sentence]:
        """Points whose circle fails with no, some and every seed."""
        never, always, unmoved = (self._counts[key] for key in ("never", "always", "unmoved"))
        judged = self.points - self._counts["unjudged"]
        if judged and self._sweep.seeds is not None:
            seeds = count_value(self._sweep.seeds.size, grouped=True)
            counts = (count_value(count, grouped=True) for count in (never, judged - never - always, always))
            points = f"{judged:,} {nouns(judged, 'point')}"
            words = f"The circle holds every tolerance with each of {{}} seeds at {{}} of {points}, "
            yield sentence(f"{words}fails with some at {{}} and with all at {{}}.", seeds, *counts)
        yield from self._unjudged()
        if unmoved:
            points = nouns(unmoved, "point")
            words = f"At {{}} {points} all seeds gave the same circle: a seed draws for {{}} and {{}}."
            drawn = Code("delivery.jitter_us"), Code("delivery.loss_probability")
            yield sentence(words, count_value(unmoved, grouped=True), *drawn, state="warns")

    def _unjudged(self) -> Iterator[Sentence]:
        if self._counts["unjudged"]:
            words = "The circle is not judged at {}: no contour tolerance is asked for, or no error source matters."
            yield sentence(words, count_value(self._counts["unjudged"], grouped=True), state="warns")

    def report(self, document: Callable[[], JsonDocument] = _not_kept) -> Report:
        """The answer in blocks.

        Parameters
        ----------
        document
            Function that returns the document with all rows; without it the answer has none.
        """
        return Report(
            Sentence(("Sweep of ", Code(self._sweep.profile.name))),
            lambda: (*self.sentences(), self._shown(), self._table()),
            document,
            lambda: document()["rows"],
        )

    def _shown(self) -> Sentence:
        """How many rows are shown, and their order."""
        rows = self.points * len(self._sweep.timing_models)
        order = f", {'smallest' if self._sign > 0 else 'largest'} {self._sort_by} first" if self._sort_by else ""
        total, words = count_value(rows, grouped=True), f"{nouns(rows, 'row')}{order}."
        if len(self._kept) < rows:
            return sentence(f"{{}} of {{}} {words}", count_value(len(self._kept)), total)
        return sentence(f"{{}} {words}", total)

    def _table(self) -> Table:
        """The top rows; headings are the names that --columns and --sort take."""
        columns, figures = self._sweep.columns, column_figures(self._sweep.profile)
        # Columns that were asked for by name stay.
        ranks = _RANKS if all(name in columns for name in _RANKS if name not in COUNTS) else {}
        return Table(
            tuple(_column(name, figures.get(name), rank=ranks.get(name, 0)) for name in columns),
            tuple(TableRow(tuple(_cells(record, figures))) for record in self.rows),
            heads=columns.index(TIMING_MODEL.key) + 1,
        )


def _share(flags: Array, points: int) -> int:
    """Number of points of a block for which a flag is True, from its values before broadcasting."""
    return int(flags.sum()) * (points // int(flags.size))


def payload_sentences(profile: Profile, varied: Collection[str]) -> Iterator[Sentence]:
    """Say that the payload does not follow the axes of a node, where these vary.

    Parameters
    ----------
    profile
        The network.
    varied
        Keys that vary.
    """
    for nodes in profile.alike_nodes:
        if nodes.node_key("axes") not in varied or nodes.payload.follows_axes:
            continue
        section = f"group.{nodes.name}" if nodes.name else "payload"
        keys = Code(f"{section}.read_bytes_per_axis"), Code(f"{section}.write_bytes_per_axis")
        yield sentence("The payload does not depend on the axes of a node: {} and {} say what each adds.", *keys)


def _column(name: str, figure: Figure | None, *, rank: int) -> TableColumn:
    if figure is None:
        return TableColumn(name)
    # The name ends in any other unit.
    unit = "%" if figure.column == "%" else ""
    return TableColumn(name, unit, kind="words" if figure.sort in ("word", "words") else "figures", rank=rank)


def _cells(record: Record, figures: Mapping[str, Figure]) -> Iterator[ShownValue]:
    for name, own in record.items():
        value = None if isinstance(own, float) and isnan(own) else own
        figure = figures.get(name)
        if figure is None:
            yield ShownValue(value, name)
        else:
            shown = figure_value(figure, value)
            # In the unit of the column's name; a length in mm has three more decimals than one in um.
            finer = 3 if figure.unit == "mm" and figure.column == "um" else 0
            yield shown._replace(unit=figure.unit or shown.unit, decimals=shown.decimals and shown.decimals + finer)
