"""Parts of a kind of bus for the gate and `measured`: rules, and figures of a recording."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from operator import abs as distance
from operator import neg, pos
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, Protocol, TypeAlias

from busplan.english import told_apart
from busplan.sections.base import beside
from busplan.sourced import Sourced, read_toml

if TYPE_CHECKING:
    from busplan.buses.network import Network
    from busplan.buses.parts import Value
    from busplan.recordings.statistics import Events
    from busplan.sections.profile import Profile


Severity = Literal["error", "warning"]


class Mending(NamedTuple):
    """Advice that fixes a problem."""

    help: str = ""
    """Advice in words."""
    cure: tuple[str, ...] = ()
    """Lines of TOML, each a key with the value that fixes the problem."""


class RuleProblem(NamedTuple):
    """A problem that a rule reports: the dotted key that causes it, the fault, and its fix."""

    key: str
    message: str | Callable[[], str]
    """The problem in words, or a function for words that are slow to write, not called for a suppressed problem."""
    help: str = ""
    cure: tuple[str, ...] = ()
    weight: float = 0.0
    """How much it matters among problems of its rule, of which text may have only the heaviest."""


RuleFigures: TypeAlias = Any
"""Figures of `capacity` under a timing model: each figure, also of the kind, is an attribute named by its key."""


class RuleSubject(Protocol):
    """A profile, and all questions that rules may ask about it."""

    @property
    def profile(self) -> "Profile":
        """The profile."""

    @property
    def network(self) -> "Network":
        """Network of the profile."""

    @property
    def deciding(self) -> RuleFigures:
        """Capacity under the timing model that decides."""

    @property
    def others_fit(self) -> Sequence[tuple[str, bool]]:
        """The other timing models, each with whether the cycle fits."""

    def after(self, changes: Mapping[str, "Value"]) -> RuleFigures:
        """Capacity under the timing model that decides, with other values by dotted key."""

    def counts(self, changes: Mapping[str, "Value"] | None = None) -> Sequence[Any]:
        """Numbers of nodes that fit and that are shown to fit, by group or in all, with other values by dotted key."""

    def limit_words(self, key: str) -> str:
        """Words for the excess over a limit of the bus, or for why it is not shown to be kept."""

    def cure(self) -> Mending:
        """The least change after which the profile holds every constraint of a plan."""


Check: TypeAlias = Callable[[RuleSubject], Iterator[RuleProblem]]
"""Check of a valid profile: gives its problems."""


class Rule(NamedTuple):
    """One rule of the gate."""

    code: str
    name: str
    severity: Severity
    summary: str
    """The problem in one line."""
    explanation: str
    """Reason why the problem matters, and its fix."""
    check: Check | None = None
    """Check of the rule; None where another part of the gate reports the problem."""


def read_rules(package: str, checks: Mapping[str, Check]) -> tuple[Rule, ...]:
    """Rules of a package from its `rules.toml`, with checks by the code of their rule; line breaks become spaces."""
    rules = read_toml(package, "rules.toml")
    for rule in rules.values():
        rule["explanation"] = " ".join(rule["explanation"].split())
    return tuple(Rule(code, **rule, check=checks.get(code)) for code, rule in rules.items())


def contradicts(fits: bool, figures: RuleFigures) -> bool:
    """Whether a timing model that does not decide contradicts the verdict.

    `fits` tells whether required <= available under that model; `figures` are those of the model that decides. A cycle
    of the deciding model that lacks only room for U contradicts nothing; a broken limit is not about timing.
    """
    if set(figures.exceeded) - {"time"}:
        return False
    is_shown = figures.verdict == "fits" or (figures.margin_corrected_us or 0) >= (figures.uncertainty_us or 0)
    return not is_shown if fits else figures.verdict == "fits"


def overrun(figures: RuleFigures) -> str:
    """Words for the share of its slice that a cycle needs, and for its margin as far as it is known."""
    needs, given = told_apart(figures.required_us, figures.available_us)
    return f"needs {needs} us of {given} us, {margin(figures)}"


def margin(figures: RuleFigures) -> str:
    """Words for the margin as far as it is known."""
    if figures.margin_corrected_us is None:
        return f"margin {told_apart(figures.margin_us, 0.0)[0]} us under the {figures.timing_model} timing"
    value = told_apart(figures.margin_corrected_us, 0.0)[0]
    if figures.uncertainty_us is None:
        return f"margin {value} us, no bias or uncertainty known"
    interval = f"{value} +/- {figures.uncertainty_us:.1f} us"
    return f"margin {interval}, no bias known" if figures.bias_us is None else f"corrected margin {interval}"


CLOCK_TOLERANCE: Final = Sourced(
    100e-6,
    unit="1",
    grade="recalled",
    source="IEEE 802.3, clock of a 100 Mbit/s port, 100 ppm; taken for the clock of a recorder, too",
    meaning="largest error of the clocks that a period is made and recorded by, as a share of it",
)


def clocks_us(period_us: float) -> float:
    """Standard uncertainty of a period by the clocks of the bus and of the recorder [us]."""
    return float(CLOCK_TOLERANCE * period_us / 3**0.5)


_FIRST_DAY_NS: Final = 10 * 365 * 86400 * 1_000_000_000
_LAST_DAY_NS: Final = 1 << 63
_ROUNDING: Final = 1e-9
"""Relative rounding error of a figure."""
SURE: Final = 3.29 / 2
"""Least excess over the plan, in expanded uncertainties (k = 2), that is outside: k = 3.29, 99.9 % of normal errors."""
Sense = Literal["equal", "at most", "at least", "shown"]
"""Comparison that the recorded figure must pass against the planned one; shown: nothing is planned."""
_EXCESS: Final[Mapping[Sense, Callable[[Any], Any]]] = {"equal": distance, "at least": neg}
"""Excess over the plan of a residual, a number or an array; of other senses the residual."""
RecordedVerdict = Literal["within", "not shown", "outside"]
"""within: the plan is kept. not shown: the excess may be error, or the recording hides it. outside: surely not kept."""


class RecordedFigure(NamedTuple):
    """A figure as planned and as recorded, both in `unit`."""

    quantity: str
    unit: Literal["us", "bytes", "1", "share", "kbit/s"]
    """Unit of both values; a share is 0..1."""
    planned: float | None
    recorded: float | None
    """Recorded value; None where the recording does not show it."""
    uncertainty: float | None
    """Expanded uncertainty (k = 2) of the difference; None where it is not known, or where nothing is planned."""
    sense: Sense
    events: int
    """Number of events that the value is computed from [1]."""
    key: str = ""
    """Dotted key of the planned value in the profile."""
    note: str = ""
    is_mean: bool = False
    """Whether the value is the mean of its events and not their quantile."""
    hidden: str = ""
    """Reason why the recording cannot show a planned figure; empty where it can."""
    first_s: float | None = None
    """Time of the first event with the verdict of the figure, outside or not shown, from the first frame of the
    recording [s]. None where the figure is within, or has no such event."""
    first_frame: int | None = None
    """Number of its frame, from 1."""
    worst_s: float | None = None
    """Time of the event with the extreme value, the first of equal ones [s]; None where the figure has no events."""
    worst_frame: int | None = None
    """Number of its frame, from 1."""

    @property
    def residual(self) -> float | None:
        """Recorded value less planned value."""
        return None if self.planned is None or self.recorded is None else self.recorded - self.planned

    @property
    def beyond(self) -> float | None:
        """Excess over the plan: the distance for "equal", else negative within; None where nothing is planned."""
        if self.residual is None or self.sense == "shown":
            return None
        beyond: float = _EXCESS.get(self.sense, pos)(self.residual)
        return beyond

    @property
    def _most(self) -> float:
        """Largest excess over the plan that is not outside."""
        return SURE * (self.uncertainty or 0.0) + self._rounding

    @property
    def _rounding(self) -> float:
        return _ROUNDING * abs(self.planned or 0.0)

    @property
    def verdict(self) -> RecordedVerdict | None:
        """Verdict on the plan; None where nothing is planned.

        A worst case without an excess is within. So are a mean, and a figure that must be equal, with an excess of up
        to U. An excess of more than `SURE` times U is outside; one between is not shown.
        """
        if self.hidden:
            return "not shown"
        if self.beyond is None:
            return None
        doubt = (self.uncertainty or 0.0) if self.is_mean or self.sense == "equal" else 0.0
        if self.beyond <= self._rounding + doubt:
            return "within"
        return "outside" if self.beyond > self._most else "not shown"

    @property
    def first_words(self) -> str:
        """Moment of the first event in words; empty without one."""
        return "" if self.first_s is None else f"first at {self.first_s:.6f} s, frame {self.first_frame}"

    @property
    def worst_words(self) -> str:
        """Moment of the worst event in words, where it is not the first; empty without one."""
        if self.worst_s is None or self.worst_frame == self.first_frame:
            return ""
        return f"worst at {self.worst_s:.6f} s, frame {self.worst_frame}"

    def located(self, events: "Events") -> "RecordedFigure":
        """The figure with the moments of its first and its worst event.

        What is counted counts from the first on, also where the plan allows some.
        """
        if not len(events.values):
            return self
        beyond = _EXCESS.get(self.sense, pos)(events.values - (self.planned or 0.0))
        is_worst = beyond == beyond.max()
        worst = events.earliest(is_worst)
        chosen = beyond > (self._most if self.verdict == "outside" else self._rounding)
        if self.unit == "1" and self.sense == "at most":
            chosen[:] = True
        if self.verdict == "outside" and not chosen.any():
            chosen = is_worst
        has_first = self.verdict in ("outside", "not shown") and chosen.any()
        first = events.earliest(chosen) if has_first else (None, None)
        return self._replace(first_s=first[0], first_frame=first[1], worst_s=worst[0], worst_frame=worst[1])


class Recorded(NamedTuple):
    """A recording compared with the plan."""

    figures: tuple[RecordedFigure, ...]
    remarks: tuple[str, ...]
    """Sentences on other contents of the recording, and on what it does not show."""
    edits: Mapping[str, object]
    """New value of each measured key, by dotted key; None removes a key."""
    day: str
    """Day of the first stamp in UTC, such as 2026-11-23; empty where stamps have no date."""
    shows_nothing: tuple[str, ...] = ()
    """Reasons why the recording cannot show that the machine keeps its plan, a sentence each; empty where it can."""

    def unless_synthetic(self, synthetic: str) -> "Recorded":
        """The same comparison, or for the recording of an emulation one in which nothing is measured or shown.

        `synthetic` is what the recording says of an emulation; empty where it names none.
        """
        if not synthetic:
            return self
        return self._replace(edits={}, shows_nothing=(f"{synthetic}; no machine was recorded", *self.shows_nothing))


def latest_start(key: str, us: float, *, events: int, share: float) -> dict[str, object]:
    """New value of the latest start of a cycle, and the number of cycles of which it is the worst.

    A quantile below 1 is as rare as the worst of 1 / (1 - share) cycles.

    Examples
    --------
    >>> latest_start("bus.sync_jitter_us", 20.0, events=9000, share=1.0)
    {'bus.sync_jitter_us': 20.0, 'bus.sync_jitter_cycles': 9000}
    >>> latest_start("bus.sync_jitter_us", 12.5, events=9000, share=0.999)["bus.sync_jitter_cycles"]
    1000
    """
    cycles = events if share == 1 else min(events, round(1 / (1 - share)))
    return {key: us, beside(key, "cycles"): cycles}


def day_of(time_ns: int) -> str:
    """Day of a stamp in nanoseconds since 1970; empty if the clock counts from another start.

    Examples
    --------
    >>> day_of(1_700_000_000_000_000_000), day_of(5_000_000_000)
    ('2023-11-14', '')
    """
    if not _FIRST_DAY_NS <= time_ns < _LAST_DAY_NS:
        return ""
    return datetime.fromtimestamp(time_ns // 1_000_000_000, tz=UTC).date().isoformat()
