"""Answer of `busplan sweep` for people: how many points fit, and the top rows."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from math import isnan
from types import MappingProxyType
from typing import Final, NamedTuple, NoReturn

import numpy as np

from busplan.buses.figure import CIRCLE_REFUSED_BY, TIMING_MODEL, Figure
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
from busplan.questions.sweep.seeds import SeedTally
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
    """Default figures of a table; where nodes are in groups, counts of each instead of those of the whole."""
    of_circle = (key for key in (*CIRCLE_COLUMNS, *SUMMARY_COLUMNS) if key in sweep.columns)
    if not sweep.profile.group:
        return (*_RANKS, *of_circle)
    whole = (key for key in _RANKS if key not in COUNTS)
    return (*whole, *(f"group.{one.name}.safe_nodes" for one in sweep.profile.group), *of_circle)


class Tally:
    """Counts the points of a sweep and those that fit, block by block.

    Parameters
    ----------
    sweep
        What is counted.
    """

    def __init__(self, sweep: Sweep) -> None:
        self.points = 0
        self.profile = sweep.profile
        self.expected = sweep.grid.points
        self.bus = bus_of(sweep.profile)
        self._varied = frozenset(sweep.grid.axes)
        self._models = sweep.timing_models
        self._fits = [0] * len(sweep.timing_models)
        self._unsafe = 0
        self._refused = 0
        self._refused_by: dict[str, None] = {}
        self._passed: list[int] | None = None
        self._unjudged = 0
        self._seeds = None if sweep.seeds is None else SeedTally(sweep.seeds.size)

    @property
    def rows(self) -> int:
        """Rows so far: one for each point and timing model."""
        return self.points * len(self._models)

    def add(self, block: SweepBlock) -> None:
        """Count one more block."""
        points = block.chunk.points
        self.points += points
        for number, (model, figures) in enumerate(zip(self._models, block.models, strict=True)):
            decides = model == self.bus.deciding_model
            flags = np.equal(figures["verdict"].values, VERDICTS.index(FITS)) if decides else figures["fits"].values
            self._fits[number] += _share(flags, points)
        refused = block.models[0][CIRCLE_REFUSED_BY.key]
        for code, keys in enumerate(refused.words or ()):
            if isinstance(keys, list) and keys:
                self._refused += _share(np.equal(refused.values, code), points)
                self._refused_by |= dict.fromkeys(keys)
        safety = self.bus.safety.figure
        if safety is not None:
            # Settings of the bus are the same under every model.
            self._unsafe += points - _share(block.models[0][safety.key].values, points)
        if "passed" in block.models[0]:
            passed = [_share(figures["passed"].are_true, points) for figures in block.models]
            before = self._passed or [0] * len(passed)
            self._passed = [old + new for old, new in zip(before, passed, strict=True)]
            # A circle is the same under every model.
            self._unjudged += _share(block.models[0]["passed"].are_missing, points)
        if self._seeds is not None:
            self._seeds.add(block)

    def sentences(self) -> Iterator[Sentence]:
        """Summary of the counts."""
        whole = count_value(self.expected, "points", grouped=True)
        found = whole if self.points == self.expected else count_value(self.points, grouped=True)
        cut = Sentence(()) if self.points == self.expected else sentence(" of {} (interrupted)", whole)
        head = sentence(f"{{}}: {{}} {nouns(self.points, 'point')}", Code(self.profile.name), found)
        yield joined(head, cut, Sentence(("; ",)), self._fitting(), Sentence((".",)), by="")
        if self._refused:
            words = f"The circle cannot be run at {{}} {nouns(self._refused, 'point')}: {', '.join(self._refused_by)}."
            yield sentence(words, count_value(self._refused, grouped=True), state="fails")
        if self._unjudged:
            unjudged = count_value(self._unjudged, grouped=True)
            words = "The circle is not judged at {}: no contour tolerance is asked for."
            yield sentence(words, unjudged, state="warns")
        if self._passed is not None and self._unjudged < self.points:
            yield joined(
                Sentence(("The circle holds every tolerance at ",)),
                self._by_model(self._passed),
                Sentence((".",)),
                by="",
            )
        if self._seeds is not None:
            yield from self._seeds.sentences()
        yield from payload_sentences(self.profile, self._varied)
        safety = self.bus.safety.figure
        if self._unsafe and safety is not None:
            words = f"At {{}} points the {self.bus.safety.setting} is unsafe ({safety.key})."
            yield sentence(words, count_value(self._unsafe, grouped=True), state="warns")

    def _fitting(self) -> Sentence:
        parts = (
            sentence(
                f"{{}} shown to fit ({model} model)"
                if model == self.bus.deciding_model
                else f"{{}} fit by the closed form of the {model} model",
                count_value(count, grouped=True),
            )
            for count, model in zip(self._fits, self._models, strict=True)
        )
        return joined(*parts, by=", ")

    def _by_model(self, counts: Sequence[int]) -> Sentence:
        parts = (
            sentence(f"{{}} by the {model} model", count_value(count, grouped=True))
            for count, model in zip(counts, self._models, strict=True)
        )
        return joined(*parts, by=" and ")


def payload_sentences(profile: Profile, varied: Collection[str]) -> Iterator[Sentence]:
    """Say that the payload does not follow the axes of a node, where these vary.

    Parameters
    ----------
    profile
        The network.
    varied
        Keys that vary.
    """
    for one in profile.alike_nodes:
        if one.node_key("axes") not in varied or one.payload.follows_axes:
            continue
        section = f"group.{one.name}" if one.name else "payload"
        keys = Code(f"{section}.read_bytes_per_axis"), Code(f"{section}.write_bytes_per_axis")
        yield sentence("The payload does not depend on the axes of a node: {} and {} say what each adds.", *keys)


def _share(flags: Array, points: int) -> int:
    """Number of points of a block for which a flag is True, from its values before broadcasting."""
    count = int(flags.sum())
    return count * (points // int(flags.size))


def _not_kept() -> NoReturn:
    raise BusplanError("a sweep's document has every row: it is written as the rows come, and not from a few of them")


class TopRow(NamedTuple):
    """One of the top rows."""

    rank: float
    """Sort key, the smallest first."""
    record: Record


class TopRows:
    """The first rows of a sweep, or those with the largest or smallest value of one figure, in bounded memory.

    Parameters
    ----------
    columns
        Columns to keep.
    sort_by
        Column to sort by; None for the order of the grid.
    ascending
        Smallest first.
    top
        How many rows.
    """

    def __init__(self, columns: Sequence[str], *, sort_by: str | None, ascending: bool, top: int) -> None:
        self.columns = columns
        self.kept: list[TopRow] = []
        self._sort_by, self._top = sort_by, top
        self._sign = 1.0 if ascending else -1.0

    def add(self, block: SweepBlock) -> None:
        """Take one more block."""
        if self._sort_by is None:
            rows = block.chunk.points * len(block.models)
            chosen = range(min(rows, self._top - len(self.kept)))
            self.kept += [self._row(block, index, rank=0.0) for index in chosen]
            return
        ranks = self._sign * block.rows(self._sort_by).astype(float)
        worst = self.kept[-1].rank if len(self.kept) >= self._top else np.inf
        # NaN never ranks; among equals, the first in the grid stays.
        better = np.flatnonzero(ranks < worst)
        best = better[np.argsort(ranks[better], kind="stable")[: self._top]]
        self.kept += [self._row(block, int(index), rank=float(ranks[index])) for index in best]
        self.kept = sorted(self.kept, key=lambda row: row.rank)[: self._top]

    def _row(self, block: SweepBlock, index: int, *, rank: float) -> TopRow:
        return TopRow(rank, block.row(index, self.columns))

    @property
    def order(self) -> str:
        """The sort order in words."""
        if self._sort_by is None:
            return ""
        return f", {'smallest' if self._sign > 0 else 'largest'} {self._sort_by} first"


class Digest:
    """What is told of a sweep in sentences and top rows, of blocks that pass by and are not kept.

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
        self._tally = Tally(sweep)
        self._top = TopRows(sweep.columns, sort_by=sort_by, ascending=ascending, top=top)

    def add(self, block: SweepBlock) -> None:
        """Take one more block; blocks come in the order of the grid."""
        self._tally.add(block)
        self._top.add(block)

    @property
    def points(self) -> int:
        """Points so far."""
        return self._tally.points

    def sentences(self) -> Iterator[Sentence]:
        """How many points there are, and how many fit."""
        return self._tally.sentences()

    def report(self, document: Callable[[], JsonDocument] = _not_kept) -> Report:
        """The answer in blocks.

        Parameters
        ----------
        document
            Function that returns the document with all rows; without it the answer has none.
        """
        return sweep_report(self._top, self._tally, document=document)


def sweep_report(top: TopRows, tally: Tally, *, document: Callable[[], JsonDocument]) -> Report:
    """Report of `sweep` with its top rows.

    Parameters
    ----------
    top
        The rows to show.
    tally
        Counts of all points.
    document
        Function that returns the document with all rows.
    """
    return Report(
        Sentence(("Sweep of ", Code(tally.profile.name))),
        lambda: (*tally.sentences(), _shown(top, tally), top_table(top, tally.profile)),
        document,
        lambda: document()["rows"],
    )


def _shown(top: TopRows, tally: Tally) -> Sentence:
    total = count_value(tally.rows, grouped=True)
    words = f"{nouns(tally.rows, 'row')}{top.order}."
    if len(top.kept) < tally.rows:
        return sentence(f"{{}} of {{}} {words}", count_value(len(top.kept)), total)
    return sentence(f"{{}} {words}", total)


def top_table(top: TopRows, profile: Profile) -> Table:
    """The top rows; headings are the names that --columns and --sort take."""
    figures = column_figures(profile)
    # Columns that were asked for by name stay.
    ranks = _RANKS if all(name in top.columns for name in _RANKS if name not in COUNTS) else {}
    return Table(
        tuple(_column(name, figures.get(name), rank=ranks.get(name, 0)) for name in top.columns),
        tuple(TableRow(tuple(_cells(row, figures))) for row in top.kept),
        heads=top.columns.index(TIMING_MODEL.key) + 1,
    )


def _column(name: str, figure: Figure | None, *, rank: int) -> TableColumn:
    if figure is None:
        return TableColumn(name)
    # The name ends in any other unit.
    unit = "%" if figure.column == "%" else ""
    return TableColumn(name, unit, kind="words" if figure.sort in ("word", "words") else "figures", rank=rank)


def _cells(row: TopRow, figures: Mapping[str, Figure]) -> Iterator[ShownValue]:
    for name, own in row.record.items():
        value = None if isinstance(own, float) and isnan(own) else own
        figure = figures.get(name)
        if figure is None:
            yield ShownValue(value, name)
        else:
            shown = figure_value(figure, value)
            # In the unit of the column's name; a length in mm has three more decimals than one in um.
            finer = 3 if figure.unit == "mm" and figure.column == "um" else 0
            yield shown._replace(unit=figure.unit or shown.unit, decimals=shown.decimals and shown.decimals + finer)
