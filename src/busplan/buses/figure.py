"""One figure of an answer: its key, symbol, unit, source and meaning.

Each figure is defined once: tables, JSON, sweeps, differences and derivations read it here. The figures of every bus
are in this module; a kind of bus adds its own.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal, NamedTuple, Protocol, Self, get_args

from busplan.buses import time_slice
from busplan.errors import BusplanError
from busplan.sourced import EQUATIONS, read_toml

Sort = Literal["number", "count", "truth", "word", "words"]
"""Sort of a figure's values."""
Better = Literal["more", "less", "neither"]
Ink = Literal[
    "sync",
    "contention",
    "request",
    "acknowledge",
    "work",
    "response",
    "gap",
    "long-gap",
    "reserve",
    "idle",
    "in",
    "out",
    "fits",
    "unsure",
    "short",
    "barred",
    "unsafe",
    "uneven",
    "unjudged",
    "refused",
]
"""Colour of a stretch of time, or of a setting of a map, by its meaning to a reader."""
Wait = Literal["wire", "nodes", "adapter", "host"]
"""What a cycle waits for; nodes are also devices and drives."""
WAITS: Final[tuple[Wait, ...]] = get_args(Wait)

_UNITS: Final = {
    "_mm_per_min": "mm/min",
    "_us": "us",
    "_bytes": "bytes",
    "_mm": "mm",
    "_deg": "deg",
    "_db": "dB",
    "_hz": "Hz",
    "_kbit_s": "kbit/s",
    "_mbit_s": "Mbit/s",
    "_mm_s": "mm/s",
    "_per_s": "1/s",
    "_s": "s",
}
"""Unit by the end of a key's name, the longer ends first."""


class Figure(NamedTuple):
    """One key of a command's JSON."""

    key: str
    """Name in JSON, CSV and the results."""
    symbol: str
    """Symbol in a derivation."""
    reference: str
    """Numbers of the equations, or another source."""
    meaning: str
    """Meaning in one line."""
    label: str = ""
    """Name in tables; a figure without it is in no table of a command."""
    column: str = ""
    """Text of a table's unit column, where that is not the unit: "%" for a share."""
    sort: Sort = "number"
    decimals: int | None = 3
    """Decimals of a plain number in tables; None for as many as it has."""
    better: Better = "neither"
    """Direction of improvement."""
    scale: str | None = None
    """Key of the figure that the rounding error is relative to, for a difference of two large figures."""
    relative: bool = True
    """Whether a relative change has a meaning."""
    ink: Ink = "idle"
    letter: str = ""
    """Letter and `ink` in drawings, where the figure is a part of the slice."""
    is_hexadecimal: bool = False
    """Whether tables write it as 0x1f."""
    waits_for: Wait = "wire"
    """What the cycle waits for in a term."""

    @property
    def unit(self) -> str:
        """Unit by the end of the key; empty for counts, shares and words."""
        return unit_of(self.key)


@cache
def unit_of(key: str) -> str:
    """Unit by the end of a key's name; empty for counts, shares and words.

    Examples
    --------
    >>> unit_of("margin_us"), unit_of("max_nodes")
    ('us', '')
    """
    return next((unit for end, unit in _UNITS.items() if key.endswith(end)), "")


def by(*functions: Callable[..., object]) -> str:
    """Numbers of the equations that some functions compute, ascending.

    Examples
    --------
    >>> by(time_slice.required_time_slice_us, time_slice.time_slice_us)
    '(1) (2)'
    """
    numbers = {number for function in functions for number in EQUATIONS[function.__name__].numbers}
    return " ".join(f"({number})" for number in sorted(numbers))


def by_key(figures: Iterable[Figure]) -> dict[str, Figure]:
    """Figures by their keys."""
    return {figure.key: figure for figure in figures}


_SLICE: Final = by(time_slice.required_time_slice_us)
_CYCLE: Final = by(time_slice.time_slice_us, time_slice.required_time_slice_us)

TIMING_MODEL: Final = Figure(
    "timing_model", "model", "profile", "timing model of the figures", "timing model", sort="word"
)
PERIOD: Final = Figure("period_us", "T_s", "profile", "communication period", "period T_s", decimals=None)
NODES: Final = Figure("nodes", "N", "profile", "distributed nodes, host not counted", "nodes N", "nodes", "count")
AXES: Final = Figure("axes", "axes", "profile", "axes of all nodes", "axes", "axes", "count")
AVAILABLE: Final = Figure(
    "available_us",
    "alpha T_s",
    by(time_slice.time_slice_us),
    "share of the period that is for communication",
    "available time",
)
REQUIRED: Final = Figure(
    "required_us", "T_need", _SLICE, "time that the whole cycle needs, N T_cs", "required time", better="less"
)
NONPERIODIC: Final = Figure(
    "nonperiodic_us",
    "T_npd",
    "profile",
    "time kept for non-periodic data",
    "non-periodic T_npd",
    ink="reserve",
    letter="N",
)
TIME_SLICE: Final = Figure(
    "time_slice_us",
    "T_cs,given",
    by(time_slice.time_slice_us),
    "time slice that the cycle gives each node",
    "time slice T_cs, given",
)
REQUIRED_TIME_SLICE: Final = Figure(
    "required_time_slice_us", "T_cs,needed", _SLICE, "time slice that each node needs", "time slice T_cs, needed"
)
BINDING_TERM: Final = Figure(
    "binding_term", "binding term", _SLICE, "largest term of the required time", "largest term", sort="word"
)
UTILISATION: Final = Figure(
    "utilisation", "rho", _CYCLE, "share of the slice that is used, 0..1", "utilisation", "%", decimals=2, better="less"
)
MARGIN: Final = Figure(
    "margin_us", "margin", _CYCLE, "unused time of the slice", "margin", better="more", scale="available_us"
)
MAX_NODES: Final = Figure(
    "max_nodes",
    "N_max",
    _CYCLE,
    "largest number of nodes that fit the period",
    "most nodes",
    "nodes",
    "count",
    better="more",
)
MAX_AXES: Final = Figure(
    "max_axes",
    "axes_max",
    _CYCLE,
    "axes of the largest number of nodes that fits",
    "most axes",
    "axes",
    "count",
    better="more",
)
LIMITED_BY: Final = Figure(
    "limited_by", "limit", _CYCLE, "limit that stops the number of nodes", "limited by", sort="word"
)
MIN_PERIOD: Final = Figure(
    "min_period_us",
    "T_s,min",
    _CYCLE,
    "smallest period with enough time for these nodes, null without one; other limits may still be broken",
    "smallest period",
    better="less",
)
MIN_SLICE_RATIO: Final = Figure(
    "min_slice_ratio",
    "alpha_min",
    _CYCLE,
    "smallest slice ratio that these nodes fit with",
    "smallest slice ratio alpha",
    "1",
    decimals=4,
)
EXCEEDED: Final = Figure(
    "exceeded",
    "broken",
    _CYCLE,
    "limits that are broken: time without bias and U, each other limit by more than its U",
    sort="words",
)
FITS: Final = Figure(
    "fits",
    "fits",
    _CYCLE,
    "whether no limit is broken, time among them: required <= available",
    "no limit broken",
    sort="truth",
    better="more",
)
_CERTAINTY: Final = "JCGM 100"
BIAS: Final = Figure("bias_us", "bias", "residual", "mean time that the bus takes beyond the timing model", "bias")
MARGIN_CORRECTED: Final = Figure(
    "margin_corrected_us",
    "margin_c",
    _CERTAINTY,
    "unused time of the slice, less the bias",
    "corrected margin",
    better="more",
    scale="available_us",
)
UNCERTAINTY: Final = Figure(
    "uncertainty_us",
    "U",
    _CERTAINTY,
    "expanded uncertainty of the corrected margin, two standard uncertainties",
    "uncertainty U",
)
SAFE_REQUIRED: Final = Figure(
    "safe_required_us",
    "T_safe",
    _CERTAINTY,
    "slice in which the cycle is shown to fit, reserve included",
    "slice needed to show that it fits",
    better="less",
)
LEAST_REQUIRED: Final = Figure(
    "least_required_us",
    "T_least",
    _CERTAINTY,
    "time that the whole cycle needs at least, without what is only possible; a period shorter than this does not fit",
    "required time, at least",
    better="less",
)
SAFE_NODES: Final = Figure(
    "safe_nodes",
    "N_safe",
    _CERTAINTY,
    "largest number of nodes that are shown to fit, on a bus set safely for them",
    "safe nodes",
    "nodes",
    "count",
    better="more",
)
SAFE_AXES: Final = Figure(
    "safe_axes", "axes_safe", _CERTAINTY, "axes of the safe nodes", "safe axes", "axes", "count", better="more"
)
SAFE_LIMITED_BY: Final = Figure(
    "safe_limited_by",
    "limit_safe",
    _CERTAINTY,
    "limit that stops the number of safe nodes",
    "safe nodes limited by",
    sort="word",
)
SAFE_MIN_PERIOD: Final = Figure(
    "safe_min_period_us",
    "T_s,safe",
    _CERTAINTY,
    "smallest period shown to have enough time for these nodes, null without one; other limits may be broken",
    "period with enough time",
    better="less",
)
VERDICT: Final = Figure(
    "verdict", "verdict", _CERTAINTY, "fits, not shown to fit, or does not fit", "verdict", sort="word", better="more"
)
NOT_SHOWN: Final = Figure(
    "not_shown",
    "not shown",
    _CERTAINTY,
    "limits that are neither broken nor shown to be kept, time among them",
    sort="words",
)
CERTAINTY: Final = (
    *(BIAS, MARGIN_CORRECTED, UNCERTAINTY, SAFE_REQUIRED, LEAST_REQUIRED, SAFE_NODES, SAFE_AXES),
    *(SAFE_LIMITED_BY, SAFE_MIN_PERIOD, NOT_SHOWN, VERDICT),
)
"""Figures of the timing model that decides; no other model has them."""
TRANSACTION: Final = Figure("transaction", "kind", "profile", "what is timed", sort="word")
PAYLOAD_BYTES: Final = Figure("payload_bytes", "P", "profile", "payload of the transaction", sort="count")


_OF_EVERY_BUS: Final = by_key(figure for figure in tuple(globals().values()) if isinstance(figure, Figure))


def read_figures(package: str) -> dict[str, tuple[Figure, ...]]:
    """Figures of a package's `figures.toml`, by group: a table of a group has the fields of a figure, by its key.

    An empty table stands for the figure of every bus with that key; `decimals = "all"` gives as many as a number has.
    """
    groups = read_toml(package, "figures.toml")
    return {name: tuple(_read_figure(*row) for row in rows.items()) for name, rows in groups.items()}


def _read_figure(key: str, fields: dict[str, Any]) -> Figure:
    if fields.get("decimals") == "all":
        fields["decimals"] = None
    return Figure(key, **fields) if fields else _OF_EVERY_BUS[key]


class HasOwn(Protocol):
    """Figures of an answer, among them those of the kind of bus."""

    @property
    def own(self) -> "OwnFigures":
        """Figures of the kind."""


@dataclass(frozen=True)
class OwnFigures:
    """Figures and terms that only a kind of bus has, in plain numbers: each kind declares its record.

    A field has the name of a figure's key, so JSON, CSV and Python have the same names.
    """

    @classmethod
    def of(cls, figures: HasOwn) -> Self:
        """Record of the kind in the figures of an answer; BusplanError for figures of another kind."""
        if isinstance(figures.own, cls):
            return figures.own
        raise BusplanError(f"the figures are {type(figures.own).__name__}, not {cls.__name__}")


class BusFigures(NamedTuple):
    """Figures of a kind of bus, and their places in answers."""

    terms: tuple[Figure, ...]
    """Figures of the terms, in the order of the wire."""
    document_terms: tuple[Figure, ...] = ()
    """Figures of the terms in the order of the JSON of `capacity`, where it differs."""
    setup: tuple[Figure, ...] = ()
    """Figures of the settings of the bus."""
    headings: tuple[str, ...] = ()
    """Keys of the set-up figures that a page's heading shows."""
    added: tuple[Figure, ...] = ()
    """Other figures of `capacity`."""
    counts: tuple[Figure, ...] = ()
    """Other counts of nodes in `capacity`."""
    table: tuple[Figure, ...] = ()
    """Rows of the kind in the table of `capacity`."""
    compared: tuple[Figure, ...] = ()
    """Figures of the kind that `diff` compares under each timing model."""
    planned: tuple[str, ...] = ()
    """Keys of the kind's figures that `plan` shows for each option."""
    latency_rows: tuple[Figure, ...] = ()
    """Rows of the table of `latency`, where they are not the terms."""
    latency_shown: tuple[str, ...] = ()
    """Keys of the rows that any answer shows; all where it is empty."""
    latency_main: str = ""
    """Key of the row that the name of a transaction means; the last where it is empty."""
    latency_document: tuple[Figure, ...] = ()
    """Figures of `latency`, in the order of its document, where it has more than those rows."""
    has_many_transactions: bool = False
    """Whether the table of `latency` has a row for each transaction, and a column for each figure."""
    deadlines: tuple[str, str] | None = None
    """Keys of the response time and of the deadline of a transaction, for a kind with deadlines."""

    @property
    def capacity(self) -> tuple[Figure, ...]:
        """Figures of `capacity`, in the order of its document."""
        return (
            *(TIMING_MODEL, PERIOD, NODES, AXES),
            *self.setup,
            *(AVAILABLE, REQUIRED, TIME_SLICE, REQUIRED_TIME_SLICE),
            *self.added,
            *(self.document_terms or self.terms),
            *(BINDING_TERM, UTILISATION, MARGIN),
            *self.counts,
            *(MAX_NODES, MAX_AXES, LIMITED_BY, MIN_PERIOD, MIN_SLICE_RATIO, EXCEEDED, FITS),
            *CERTAINTY,
        )

    @property
    def latency_table(self) -> tuple[Figure, ...]:
        """Rows of the table of `latency`."""
        return self.latency_rows or (*self.terms, REQUIRED)

    @property
    def latency(self) -> tuple[Figure, ...]:
        """Figures of `latency`, in the order of its document."""
        return self.latency_document or (TIMING_MODEL, TRANSACTION, NODES, *self.latency_table)

    def term_label(self, name: str | None) -> str:
        """Label of a term in tables, by its short name; empty without a figure."""
        return next((figure.label for figure in self.terms if term_name(figure.key) == name), "")


def term_name(key: str) -> str:
    """Short name of a term: the key of its figure without prefix and unit.

    Examples
    --------
    >>> term_name("cycle_data_us"), term_name("sync_us")
    ('data', 'sync')
    """
    return key.removeprefix("cycle_").removesuffix("_us")
