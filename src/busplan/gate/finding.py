"""Findings of rules, and the profile that rules check."""

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

from busplan.buses.parts import Value
from busplan.buses.rule import Mending, Rule, RuleProblem, Severity
from busplan.english import listed
from busplan.printable import printable
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.profile.document import Spot
from busplan.profile.toml import LoadedProfile
from busplan.profile.write import short_text
from busplan.questions.fit.certainty import available_us, fits_in
from busplan.questions.fit.figures import FitFigures, GroupCapacity, figures, node_counts
from busplan.questions.fit.network import PERIOD, changed, model_names, network_of
from busplan.questions.plan.changes import changeable, cure


class Finding(NamedTuple):
    """One finding at its place; lines and columns count from 1."""

    code: str
    rule: str
    severity: Severity
    message: str
    """Problem and remedy, in one line."""
    key: str
    line: int
    column: int
    marked_column: int
    """First column of the value, or of what stands for it: a name, a comment."""
    marked_end_column: int
    """First column after it."""
    problem: str
    """The problem."""
    help: str | None = None
    """Remedy, in words."""
    cure: str | None = None
    """Remedy, as lines of TOML: key = value."""


def finding_parts(path: str, finding: Finding) -> tuple[str, str]:
    """Place and message of a finding."""
    return f"{path}:{finding.line}:{finding.column}:", f"{finding.code} {finding.severity}: {finding.message}"


def finding_line(path: str, finding: Finding) -> str:
    """Write path:line:column: CODE severity: message."""
    return printable(" ".join(finding_parts(path, finding)))


class Violation(NamedTuple):
    """A problem at its place, before comments suppress it."""

    rule: Rule
    problem: RuleProblem
    spot: Spot


def finding_of(rule: Rule, problem: RuleProblem, spot: Spot, *, words: str) -> Finding:
    """Make the finding of a problem.

    Parameters
    ----------
    rule
        The rule that is broken.
    problem
        The problem, with its key and how it is mended.
    spot
        Its place.
    words
        What is wrong, with the key and the circumstances.
    """
    cure = f"cheapest cure: {', '.join(problem.cure)}" if problem.cure else ""
    message = "; ".join(filter(None, (words, problem.help, cure)))
    mending = problem.help or None, "\n".join(problem.cure) or None
    return Finding(rule.code, rule.name, rule.severity, message, problem.key, *spot, words, *mending)


class Subject:
    """A profile with the figures that rules need, each computed once, at first use.

    Parameters
    ----------
    loaded
        The profile and its text.
    changes
        Changes of the profile, which the text does not show.
    circle_steps
        Most simulated steps of each axis of its circle; None for no circle.
    """

    def __init__(
        self, loaded: LoadedProfile, changes: KeyChanges = NO_CHANGES, *, circle_steps: int | None = None
    ) -> None:
        self.profile = loaded.profile
        self.network = network_of(loaded.profile)
        self.circle_steps = circle_steps
        self.document = loaded.document
        self.origin = f" (with {changes.words})" if changes.words else ""
        """End of the messages: the changes, which the document does not show."""

    @cached_property
    def deciding(self) -> FitFigures:
        """The verdict, by the timing model that decides."""
        return figures(self.network, model=self.network.bus.deciding_model)

    @cached_property
    def others(self) -> tuple[FitFigures, ...]:
        """Figures under the other timing models."""
        return tuple(figures(self.network, model=model) for model in self._other_models)

    @property
    def others_fit(self) -> tuple[tuple[str, bool], ...]:
        """The other timing models, each with whether the cycle fits; no figures are computed for that."""
        given_us, cycle = available_us(self.network), self.network.bus.cycle
        return tuple(
            (model, bool(fits_in(cycle(self.network, model=model).required_us, available_us=given_us)))
            for model in self._other_models
        )

    @property
    def _other_models(self) -> tuple[str, ...]:
        deciding = self.network.bus.deciding_model
        return tuple(model for model in model_names(self.network) if model != deciding)

    def after(self, changes: Mapping[str, Value]) -> FitFigures:
        """The verdict with other values by dotted key."""
        return figures(changed(self.network, changes), model=self.deciding.timing_model)

    def counts(self, changes: Mapping[str, Value] | None = None) -> tuple[GroupCapacity, ...]:
        """How many nodes of each group, or of all, fit and are shown to fit, with other values by dotted key."""
        network = changed(self.network, changes) if changes else self.network
        return node_counts(network, model=self.deciding.timing_model)

    def limit_words(self, key: str) -> str:
        """Say by how much a limit of the bus is broken, or why it is not shown to be kept."""
        limit = self.network.bus.limit(key)
        return "" if limit is None else limit.words(self.network)

    @cached_property
    def _cure(self) -> Mending:
        mending = cure(self.network)
        if mending.changes is None:
            return Mending(f"no change of {listed(changeable(self.network), 'and')} is a cure: {mending.why}")
        lines = tuple(f"{key} = {short_text(value)}" for key, value in mending.changes.items())
        return Mending("the period must change" if PERIOD in mending.changes else "", lines)

    def cure(self) -> Mending:
        """The change after which the profile holds every constraint of a plan; one for all rules."""
        return self._cure
