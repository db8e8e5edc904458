"""What a rule says, and what it says it of."""

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Literal, NamedTuple

from busplan.analysis.capacity.cycle import cycle, fits_in
from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.latency import BOTH_MODELS
from busplan.buses.ieee1394.timing import TimingModelName
from busplan.profile.toml import LoadedProfile

Severity = Literal["error", "warning"]


class Problem(NamedTuple):
    """One thing that a rule found: the dotted key that causes it, and what is wrong."""

    key: str
    message: str


class Finding(NamedTuple):
    """One finding at its place; lines and columns count from 1."""

    code: str
    rule: str
    severity: Severity
    message: str
    key: str
    line: int
    column: int


class Subject:
    """One profile with what the rules ask of it, computed once and only when asked."""

    def __init__(self, loaded: LoadedProfile) -> None:
        self.profile = loaded.profile
        self.document = loaded.document

    @cached_property
    def deciding(self) -> CapacityFigures:
        """Capacity under the timing model that decides."""
        return figures(self.profile, model=self.profile.bus.timing_model)

    @cached_property
    def other(self) -> CapacityFigures:
        """Capacity under the other timing model."""
        return figures(self.profile, model=self._other_model)

    @property
    def other_overruns(self) -> bool:
        """Whether the cycle does not fit under the other timing model, which takes no figures to tell."""
        now = cycle(self.profile, model=self._other_model, nodes=self.profile.bus.nodes)
        available_us = self.profile.cycle.slice_ratio * self.profile.cycle.period_us
        return not fits_in(now.required_us, available_us=available_us)

    @property
    def _other_model(self) -> TimingModelName:
        (model,) = (model for model in BOTH_MODELS if model != self.profile.bus.timing_model)
        return model


class Rule(NamedTuple):
    """One rule of the gate."""

    code: str
    name: str
    severity: Severity
    summary: str
    """What is wrong, in one line."""
    explanation: str
    """Why it matters and how to mend it."""
    check: Callable[[Subject], Iterator[Problem]] | None = None
    """Looks at a profile that could be read; None for what is found in another way."""
