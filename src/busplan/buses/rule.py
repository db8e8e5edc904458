"""Rules of the gate, and the questions they may ask: figures, figures after changes, a cure."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, Protocol, TypeAlias

if TYPE_CHECKING:
    from busplan.buses.network import Network
    from busplan.buses.parts import Value
    from busplan.sections.profile import Profile

Severity = Literal["error", "warning"]


class Mending(NamedTuple):
    """Mending of a problem."""

    help: str = ""
    """In words."""
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
    def others(self) -> Sequence[RuleFigures]:
        """Capacity under the other timing models."""

    @property
    def others_fit(self) -> Sequence[tuple[str, bool]]:
        """The other timing models, each with whether the cycle fits; cheaper than their figures."""

    def after(self, changes: Mapping[str, "Value"]) -> RuleFigures:
        """Capacity under the timing model that decides, with other values by dotted key."""

    def counts(self, changes: Mapping[str, "Value"] | None = None) -> Sequence[Any]:
        """How many nodes of each group, or of all, fit and are shown to fit, with other values by dotted key."""

    def limit_words(self, key: str) -> str:
        """Say by how much a limit of the bus is broken, or why it is not shown to be kept."""

    def cure(self) -> Mending:
        """The least change after which the profile holds every constraint of a plan."""


class Rule(NamedTuple):
    """One rule of the gate."""

    code: str
    name: str
    severity: Severity
    summary: str
    """The problem in one line."""
    explanation: str
    """Why it matters and how to mend it."""
    check: Callable[[RuleSubject], Iterator[RuleProblem]] | None = None
    """Check of a profile that could be read; None where another part of the gate reports the problem."""


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
    said = f"{value} +/- {figures.uncertainty_us:.1f} us"
    return f"margin {said}, no bias known" if figures.bias_us is None else f"corrected margin {said}"
