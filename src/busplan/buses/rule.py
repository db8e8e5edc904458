"""What a rule of the gate is, and what it may ask: figures, figures after changes, a cure."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

if TYPE_CHECKING:
    from busplan.sections.profile import Profile

Severity = Literal["error", "warning"]


class RuleProblem(NamedTuple):
    """One thing that a rule found: the dotted key that causes it, and what is wrong."""

    key: str
    message: str


class RuleFigures(Protocol):
    """What a rule may read of the capacity under one timing model; figures of the kind are attributes, too."""

    @property
    def timing_model(self) -> str:
        """Name of the timing model."""

    @property
    def exceeded(self) -> tuple[str, ...]:
        """Keys of the limits that are broken."""

    @property
    def required_us(self) -> float:
        """What the cycle needs [us]."""

    @property
    def available_us(self) -> float:
        """What the slice gives it [us]."""

    @property
    def margin_us(self) -> float:
        """What is left of the slice [us]."""

    @property
    def max_nodes(self) -> int:
        """Most nodes that fit [1]."""

    def __getattr__(self, key: str) -> Any:
        """A figure of the kind."""


class RuleSubject(Protocol):
    """One profile with what the rules ask of it."""

    @property
    def profile(self) -> "Profile":
        """The profile."""

    @property
    def deciding(self) -> RuleFigures:
        """Capacity under the timing model that decides."""

    @property
    def others(self) -> Sequence[RuleFigures]:
        """Capacity under the other timing models."""

    @property
    def others_overrun(self) -> bool:
        """Whether the cycle is too long under another timing model; cheaper than its figures."""

    def after(self, changes: Mapping[str, object]) -> RuleFigures:
        """Capacity under the timing model that decides, with other values by dotted key."""

    def cure(self, *models: str) -> str:
        """The cheapest change after which these timing models fit, in words."""

    def room(self, nodes: int, *, utilisation: float = 1.0) -> str:
        """The cheapest change that makes room for some nodes under the model that decides, in words."""


class Rule(NamedTuple):
    """One rule of the gate."""

    code: str
    name: str
    severity: Severity
    summary: str
    """What is wrong, in one line."""
    explanation: str
    """Why it matters and how to mend it."""
    check: Callable[[RuleSubject], Iterator[RuleProblem]] | None = None
    """Looks at a profile that could be read; None for what is found in another way."""


def microseconds(value_us: float) -> str:
    """Write a time for a finding."""
    return f"{value_us:.3f} us"


def overrun(one: RuleFigures) -> str:
    """Say by how much a cycle is too long."""
    return (
        f"the cycle needs {microseconds(one.required_us)} of {microseconds(one.available_us)} under the "
        f"{one.timing_model} timing, {microseconds(-one.margin_us)} too much"
    )
