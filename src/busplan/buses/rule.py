"""Rules of the gate, and what a recording shows, as a kind of bus gives them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, Protocol, TypeAlias

from busplan.sourced import Sourced, read_toml

if TYPE_CHECKING:
    from busplan.buses.limits import Value
    from busplan.buses.network import Network
    from busplan.sections.profile import Profile


Severity = Literal["error", "warning"]


class Mending(NamedTuple):
    """Mending of a problem."""

    help: str = ""
    """Advice in words."""
    cure: tuple[str, ...] = ()
    """Lines of TOML, each a key with the value that mends it."""


class RuleProblem(NamedTuple):
    """A problem that a rule reports: the dotted key that causes it, what is wrong, and how it is mended."""

    key: str
    message: str | Callable[[], str]
    """The problem in words; or a function for them, where that takes long: a comment may suppress the problem."""
    help: str = ""
    cure: tuple[str, ...] = ()


RuleFigures: TypeAlias = Any
"""Figures of `capacity` under a timing model, each an attribute by its key; those of the kind, too."""


class RuleSubject(Protocol):
    """One profile with what the rules ask of it."""

    @property
    def profile(self) -> "Profile":
        """The profile."""

    @property
    def network(self) -> "Network":
        """Its network."""

    @property
    def deciding(self) -> RuleFigures:
        """Capacity under the timing model that decides."""

    @property
    def others_fit(self) -> Sequence[tuple[str, bool]]:
        """The other timing models, each with whether the cycle fits."""

    def after(self, changes: Mapping[str, "Value"]) -> RuleFigures:
        """Capacity under the timing model that decides, with other values by dotted key."""

    def counts(self, changes: Mapping[str, "Value"] | None = None) -> Sequence[Any]:
        """How many nodes of each group, or of all, fit and are shown to fit, with other values by dotted key."""

    def limit_words(self, key: str) -> str:
        """Say by how much a limit of the bus is broken, or why it is not shown to be kept."""

    def cure(self) -> Mending:
        """The least change after which the profile holds every constraint of a plan."""


Check: TypeAlias = Callable[[RuleSubject], Iterator[RuleProblem]]
"""Check of a profile that could be read: the problems that it has."""


class Rule(NamedTuple):
    """One rule of the gate."""

    code: str
    name: str
    severity: Severity
    summary: str
    """The problem in one line."""
    explanation: str
    """Why it matters and how to mend it."""
    check: Check | None = None
    """None where another part of the gate reports the problem."""


def read_rules(package: str, checks: Mapping[str, Check]) -> tuple[Rule, ...]:
    """Read the rules of a package from its `rules.toml`; a line break in an explanation is a space.

    Parameters
    ----------
    package
        The package.
    checks
        Check of a rule by its code.
    """
    rules = read_toml(package, "rules.toml")
    for rule in rules.values():
        rule["explanation"] = " ".join(rule["explanation"].split())
    return tuple(Rule(code, **rule, check=checks.get(code)) for code, rule in rules.items())


def contradicts(fits: bool, figures: RuleFigures) -> bool:
    """Tell whether a timing model that does not decide contradicts the verdict.

    A cycle that lacks only its reserve contradicts nothing, and a broken limit is no question of timing.

    Parameters
    ----------
    fits
        Whether required <= available under that model.
    figures
        Figures under the model that decides.
    """
    if set(figures.exceeded) - {"time"}:
        return False
    is_shown = figures.verdict == "fits" or (figures.margin_corrected_us or 0) >= (figures.uncertainty_us or 0)
    return not is_shown if fits else figures.verdict == "fits"


_MOST_DECIMALS: Final = 9


def told_apart(first: float, second: float) -> tuple[str, str]:
    """Write two numbers with one decimal, or with as many as tell them apart.

    Examples
    --------
    >>> told_apart(348.461939453, 250.0), told_apart(250.0004, 250.0)
    (('348.5', '250.0'), ('250.0004', '250.0000'))
    """
    for decimals in range(1, _MOST_DECIMALS + 1):
        texts = f"{first:.{decimals}f}", f"{second:.{decimals}f}"
        if texts[0] != texts[1]:
            return texts
    return f"{first:.1f}", f"{second:.1f}"


def overrun(figures: RuleFigures) -> str:
    """Say what a cycle needs of its slice, and the margin as far as it is known."""
    needs, given = told_apart(figures.required_us, figures.available_us)
    return f"needs {needs} us of {given} us, {margin(figures)}"


def margin(figures: RuleFigures) -> str:
    """Say how large the margin is, as far as it is known."""
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

_FIRST_DAY_NS: Final = 10 * 365 * 86400 * 1_000_000_000
_LAST_DAY_NS: Final = 1 << 63
_ROUNDING: Final = 1e-9
"""Share of a figure that is rounding."""
SURE: Final = 3.29 / 2
"""Expanded uncertainties (k = 2) from its plan on which a figure is outside it: k = 3.29, 99.9 % of a normal error."""
Sense = Literal["equal", "at most", "at least", "shown"]
"""Way in which a recorded figure is within its plan; shown: nothing is planned."""
RecordedVerdict = Literal["within", "not shown", "outside"]
"""Whether a figure is within its plan, beside it by no more than the doubt allows or hidden, or surely outside."""


class RecordedFigure(NamedTuple):
    """A figure as planned and as recorded, both in `unit`."""

    quantity: str
    unit: Literal["us", "bytes", "1", "share", "kbit/s"]
    """A share is 0..1."""
    planned: float | None
    recorded: float | None
    """None where the recording does not show it."""
    uncertainty: float | None
    """Expanded uncertainty (k = 2) of the difference; None where it is not known, or where nothing is planned."""
    sense: Sense
    events: int
    """Number of events that it is taken from [1]."""
    key: str = ""
    """Dotted key of the profile that plans it."""
    note: str = ""
    is_mean: bool = False
    """Whether it is the mean of its events, whatever the quantile."""
    hidden: str = ""
    """Why the recording cannot show it, though something is planned; empty where it can."""

    @property
    def residual(self) -> float | None:
        """Recorded less planned."""
        return None if self.planned is None or self.recorded is None else self.recorded - self.planned

    @property
    def beyond(self) -> float | None:
        """How far it is beside its plan, on the side that counts; negative within; None where nothing is planned."""
        if self.residual is None or self.sense == "shown":
            return None
        return {"equal": abs(self.residual), "at most": self.residual, "at least": -self.residual}[self.sense]

    @property
    def verdict(self) -> RecordedVerdict | None:
        """How it stands to its plan; None where nothing is planned.

        A worst case that was recorded within the plan is within it; beyond by less than a doubt of 99.9 % it is not
        shown. A mean, and what is to be equal, is within up to U.
        """
        if self.hidden:
            return "not shown"
        if self.beyond is None:
            return None
        doubt, rounding = self.uncertainty or 0.0, _ROUNDING * abs(self.planned or 0.0)
        if self.beyond <= rounding + (doubt if self.is_mean or self.sense == "equal" else 0.0):
            return "within"
        return "outside" if self.beyond > SURE * doubt + rounding else "not shown"


class Recorded(NamedTuple):
    """A recording beside the plan."""

    figures: tuple[RecordedFigure, ...]
    remarks: tuple[str, ...]
    """Sentences on what the recording has beside that, and what it does not show."""
    edits: Mapping[str, object]
    """New value by dotted key of what was measured; None removes a key."""
    day: str
    """Day of the first stamp in UTC, as 2026-11-23; empty where stamps do not say it."""
    shows_nothing: tuple[str, ...] = ()
    """Why the recording as a whole shows no machine within its plan, a sentence each; empty where it can."""


def day_of(time_ns: int) -> str:
    """Day of a stamp, nanoseconds since 1970; empty of a clock that counts from its own start.

    Examples
    --------
    >>> day_of(1_700_000_000_000_000_000), day_of(5_000_000_000)
    ('2023-11-14', '')
    """
    if not _FIRST_DAY_NS <= time_ns < _LAST_DAY_NS:
        return ""
    return datetime.fromtimestamp(time_ns // 1_000_000_000, tz=UTC).date().isoformat()
