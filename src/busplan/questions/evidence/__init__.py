"""`busplan.evidence`."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import Any, Literal, NamedTuple, Self

from pydantic import ConfigDict, Field, ValidationError, model_validator

from busplan.buses import kind_named, kind_names
from busplan.buses.bus import Bus
from busplan.buses.cycle import BusCycle
from busplan.buses.limits import COVERAGE
from busplan.buses.published import Tested, data_file, parts_tested
from busplan.english import plural
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.profile.document import override
from busplan.profile.sources import load
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.circle import CircleFigures
from busplan.questions.circle.roundness import run_circles
from busplan.questions.fit.figures import CapacityFigures, capacity_figures
from busplan.questions.fit.network import bus_of, model_names, network_of
from busplan.sections.base import Section
from busplan.sourced import Grade

Unit = Literal["us", "1", "s", "1/s", "mm", "bytes", "bits"]


class Comparison(NamedTuple):
    """A published figure and one computation of it."""

    section: str
    quantity: str
    unit: Unit
    published: float | None
    """Figure as printed, or quotient of two printed figures; None if the source gives a formula and no figure."""
    method: str
    """Equation or timing model of the computed figure."""
    computed: float
    grade: Grade | None
    """Grade of the published figure; None without one."""
    uncertainty: float | None = None
    """Expanded uncertainty of the computed figure, in `unit`; None if it is not computed."""

    @property
    def residual(self) -> float | None:
        """Computed less published figure, in `unit`."""
        return None if self.published is None else self.computed - self.published

    @property
    def relative_residual(self) -> float | None:
        """The residual as a share of the published figure [1]."""
        return None if self.published is None else (self.computed - self.published) / self.published


class EvidenceSection(NamedTuple):
    """A table or passage of a source."""

    title: str
    note: str
    comparisons: tuple[Comparison, ...]
    data: str
    """Data file with the published figures and their sources."""


class Row(Section):
    """A row with the keys of its table and its method filled in; `set` and `given` of all three are joined."""

    quantity: str
    unit: Unit
    published: int | float | None = Field(default=None, gt=0)
    """The figure as printed; None for a row with a computed one alone."""
    grade: Grade | None = None
    """Grade of the published figure."""
    share_of: int | float = Field(default=1, gt=0)
    """Printed figure of which both are shown as a share."""
    profile: str
    """Shipped profile of the computation."""
    set: dict[str, Any] = Field(default={})
    """New values of the profile, by dotted key."""
    model: str | None = None
    """Timing model; None for the one that decides."""
    method: str | None = None
    """Name of the computation; None for the timing model."""
    figures: tuple[str | int | float, ...] = Field(strict=False, min_length=1)
    """Terms of the computed figure: figures of capacity (required_us), of a transaction (latency.write.latency_us) or
    of the circle test (circle.duration_s), constants and functions of the kind of bus, and numbers of the source.
    """
    given: dict[str, Any] = Field(default={})
    """Arguments of the function."""
    divided_by: dict[str, Any] | None = None
    """Divisor of the computed figure: the same row with these keys changed."""
    doubt: str | None = None
    """Key of the doubts from which U of the computed figure comes."""

    @model_validator(mode="after")
    def _is_graded(self) -> Self:
        if (self.published is None) != (self.grade is None):
            raise ValueError("a published figure needs a grade; a computed one has none")
        return self


class _Table(Section):
    """A table [[evidence]]; its further keys apply to each of its rows."""

    model_config = ConfigDict(extra="allow")
    title: str
    source: str = ""
    note: str = ""
    part: str = ""
    methods: list[dict[str, Any]] = Field(default=[{}])
    rows: list[dict[str, Any]] = Field(min_length=1)


def sections_of(bus: Bus, data: str, *, progress: Progress | None = None) -> Iterator[EvidenceSection]:
    """Compare the published figures of a data file with computed ones, table by table.

    A table whose first profile is of another kind of bus is left out. Progress is called with the steps of circle tests
    simulated and the steps known to be needed. An unknown or missing key, profile, timing model or figure raises
    BusplanError, which names file, table and row.
    """
    cases: dict[str, _Case] = {}

    def case(row: Row) -> _Case:
        key = f"{row.profile} {row.set} {row.model}"
        if key not in cases:
            cases[key] = _Case(row, progress)
        return cases[key]

    for content in data_file(data).get("evidence", ()):
        with _placed(f"{data}.toml: [[evidence]] {content.get('title')!r}"):
            table = _Table.model_validate(content)
            rows = list(_rows(table))
            if bus_of(load(rows[0].profile).profile) is bus:
                note = " ".join(filter(None, (table.source and f"{table.source}.", table.note)))
                comparisons = tuple(_comparison(table.title, row, case) for row in rows)
                yield EvidenceSection(table.title, note, comparisons, data)


def _rows(table: _Table) -> Iterator[Row]:
    """Each row with each of its methods."""
    for content in table.rows:
        shared = {key: value for key, value in content.items() if key != "methods"}
        for method in content.get("methods", table.methods):
            with _placed(f"row {content.get('quantity')!r}"):
                yield Row.model_validate(_joined(table.model_extra or {}, shared, method))


def _joined(*parts: Mapping[str, Any]) -> dict[str, Any]:
    """All keys, each from the last part that has it; `set` and `given` are joined key by key."""
    joined: dict[str, Any] = {}
    for part in parts:
        for key, value in part.items():
            joined[key] = {**joined.get(key, {}), **value} if key in ("set", "given") else value
    return joined


@contextmanager
def _placed(place: str) -> Iterator[None]:
    """Put a place before each message of an error."""
    try:
        yield
    except ValidationError as error:
        problems = [f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}" for problem in error.errors()]
        raise BusplanError(*(f"{place}: {problem}" for problem in problems)) from None
    except (BusplanError, TypeError) as error:
        raise BusplanError(*(f"{place}: {problem}" for problem in str(error).split("\n"))) from error


class _Case:
    """A profile under a timing model, with figures by their names in rows."""

    def __init__(self, row: Row, progress: Progress | None) -> None:
        self.profile = override(load(row.profile).profile, row.set)
        self.network = network_of(self.profile)
        self.bus = self.network.bus
        self.model = row.model or self.bus.deciding_model
        self._progress = progress
        if self.model not in model_names(self.network):
            raise BusplanError(f"model: {self.model!r} is none of {', '.join(model_names(self.network))}")

    @cached_property
    def _figures(self) -> CapacityFigures:
        return CapacityFigures.of(capacity_figures(self.network, model=self.model))

    @cached_property
    def _cycle(self) -> BusCycle:
        return self.bus.cycle(self.network, model=self.model)

    @cached_property
    def _circle(self) -> CircleFigures:
        return run_circles(self.network, progress=self._progress).results[0]

    def sum_of(self, row: Row) -> float:
        """Sum of a row's figures for this profile and this model."""
        return sum(self._figure(name, row.given) if isinstance(name, str) else name for name in row.figures)

    def _figure(self, name: str, given: Mapping[str, Any]) -> float:
        source, _, key = name.rpartition(".")
        value: Any = None
        if name in self.bus.constants:
            value = float(self.bus.constants[name])
        elif function := self.bus.evidence_functions().get(name):
            value = function(self._cycle, **given)
        elif source == "circle":
            value = getattr(self._circle, key, None)
        elif source:
            transactions = {f"latency.{latency.name}": latency.phases for latency in self._cycle.latencies()}
            value = transactions.get(source, {}).get(key)
        else:
            value = self._figures.values().get(name)
        if not isinstance(value, (int, float)):
            raise BusplanError(f"figures: {name!r} is no number of {self.profile.name}, a bus of kind {self.bus.kind}")
        return value

    def uncertainty(self, key: str) -> float:
        """Expanded uncertainty from the doubts of a key."""
        doubts = [doubt.us for doubt in self._figures.doubts if doubt.key == key]
        if not doubts:
            raise BusplanError(f"doubt: {key!r} is no doubt of {self.profile.name}")
        return COVERAGE * hypot(*doubts)


def _comparison(title: str, row: Row, case: Callable[[Row], _Case]) -> Comparison:
    with _placed(f"row {row.quantity!r}"):
        computed, divisor = case(row), row.share_of
        if row.divided_by is not None:
            below = Row.model_validate(_joined(row.model_dump(exclude={"divided_by"}), row.divided_by))
            divisor = divisor * case(below).sum_of(below)
        return Comparison(
            title,
            row.quantity,
            row.unit,
            None if row.published is None else _divided(row.published, row.share_of),
            row.method or f"{computed.model} model",
            _divided(computed.sum_of(row), divisor),
            row.grade,
            None if row.doubt is None else _divided(computed.uncertainty(row.doubt), divisor),
        )


def _divided(number: float, divisor: float) -> float:
    """A quotient; a whole number divided by 1 stays whole."""
    return number if divisor == 1 else number / divisor


_PAPER = ("ieee1394", "paper")
"""Kind of bus and data file of the paper."""


class KindEvidence(NamedTuple):
    """Published figures on one kind of bus; no section if there are none."""

    kind: str
    title: str
    """Name of the kind."""
    tested: Tested
    """Parts of the model that published figures test."""
    sections: tuple[EvidenceSection, ...]


@dataclass(frozen=True, slots=True, repr=False)
class EvidenceAnswer(Answer):
    """Answer of `evidence`."""

    kinds: tuple[KindEvidence, ...]
    """Kinds of bus, each with `sections`, whose `comparisons` have a published figure, its grade, and the computed one.
    """
    paper: bool = False
    """Whether the figures are those of the paper alone."""

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.evidence.report import evidence_report

        return evidence_report(self.kinds, paper=self.paper)

    def _headline(self) -> str:
        figures = sum(len(section.comparisons) for kind in self.kinds for section in kind.sections)
        return f"{plural(figures, 'comparison')} on {', '.join(kind.kind for kind in self.kinds)}"


def evidence(kind: str | None = None, *, paper: bool = False, progress: Progress | None = None) -> EvidenceAnswer:
    """Show every figure of a kind of bus that others have published or measured, beside the computed one.

    Parameters
    ----------
    kind
        Kind of bus, as "ieee1394"; by default all of them.
    paper
        If True, show only the paper's own figures, on its kind of bus, as `busplan paper` does.
    progress
        Function called from time to time with the steps simulated and the steps known to be needed.

    Returns
    -------
    EvidenceAnswer
        The comparisons, kind by kind.

    Raises
    ------
    BusplanError
        No such kind; or a kind together with `paper`.

    Examples
    --------
    >>> import busplan
    >>> (can,) = busplan.evidence("can").kinds
    >>> comparison = can.sections[0].comparisons[1]
    >>> comparison.quantity, comparison.published, comparison.computed, comparison.grade
    ('8 bytes, 11 bits of identifier, worst stuffing', 135, 135.0, 'published')
    """
    if paper and kind is not None:
        raise BusplanError(f"kind {kind!r}: cannot be used with paper=True, which is of one kind")
    if kind not in (None, *kind_names()):
        raise BusplanError(f"{kind or repr(kind)}: no such kind of bus; there are {', '.join(kind_names())}")

    def of_kind(name: str, *only: str) -> KindEvidence:
        bus = kind_named(name)
        sections = (
            section for data in only or bus.evidence_data for section in sections_of(bus, data, progress=progress)
        )
        return KindEvidence(name, bus.title, parts_tested(bus.evidence_data, of_kind=True), tuple(sections))

    if paper:
        return EvidenceAnswer((of_kind(*_PAPER),), paper=True)
    return EvidenceAnswer(tuple(map(of_kind, kind_names() if kind is None else (kind,))))
