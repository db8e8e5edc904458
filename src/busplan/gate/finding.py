"""Findings of rules, and the profile that rules check."""

from collections.abc import Mapping
from functools import cached_property
from typing import Final, NamedTuple

from busplan.buses.rule import Mending, Rule, RuleProblem, Severity
from busplan.forms.numbers import listed
from busplan.printable import printable
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.profile.document import Spot
from busplan.profile.toml import LoadedProfile, override
from busplan.profile.write import short_text
from busplan.questions.circle.check import MOST_STEPS
from busplan.questions.fit.certainty import available_us, cycle_of, fits_in
from busplan.questions.fit.figures import FitFigures, GroupCapacity, figures, node_counts
from busplan.questions.fit.network import bus_of, model_names, network_of
from busplan.questions.plan.advice import UNTESTED_CIRCLE, changeable, cure
from busplan.questions.plan.freedoms import PERIOD


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


NO_VALUES: Final[Mapping[str, object]] = {}


class Subject:
    """A profile with the figures that rules need, each computed once, at first use.

    Parameters
    ----------
    loaded
        The profile and its text.
    changes
        Changes of the profile, which the text does not show.
    circle_steps
        Most simulated steps of each axis of the circle that a cure gives the profile; None for no circle.
    """

    def __init__(
        self,
        loaded: LoadedProfile,
        changes: KeyChanges = NO_CHANGES,
        *,
        circle_steps: int | None = MOST_STEPS,
    ) -> None:
        self.profile = loaded.profile
        self.network = network_of(loaded.profile)
        self.circle_steps = circle_steps
        self.document = loaded.document
        self.origin = f" (with {changes.words})" if changes.words else ""
        """End of the messages: the changes, which the document does not show."""

    @cached_property
    def deciding(self) -> FitFigures:
        """Capacity under the timing model that decides."""
        return figures(self.network, model=bus_of(self.profile).deciding_model)

    @cached_property
    def others(self) -> tuple[FitFigures, ...]:
        """Capacity under the other timing models."""
        return tuple(figures(self.network, model=model) for model in self._other_models)

    @property
    def others_fit(self) -> tuple[tuple[str, bool], ...]:
        """The other timing models, each with whether the cycle fits; no figures are computed for that."""
        given_us = available_us(self.network)
        return tuple(
            (model, bool(fits_in(cycle_of(self.profile, model=model).required_us, available_us=given_us)))
            for model in self._other_models
        )

    @property
    def _other_models(self) -> tuple[str, ...]:
        deciding = bus_of(self.profile).deciding_model
        return tuple(model for model in model_names(self.profile) if model != deciding)

    def after(self, changes: Mapping[str, object]) -> FitFigures:
        """Capacity under the timing model that decides, with new values by dotted key."""
        return figures(network_of(override(self.profile, dict(changes))), model=self.deciding.timing_model)

    def counts(self, changes: Mapping[str, object] = NO_VALUES) -> tuple[GroupCapacity, ...]:
        """How many nodes of each group, or of all, fit and are shown to fit, with new values by dotted key."""
        return node_counts(network_of(override(self.profile, dict(changes))), model=self.deciding.timing_model)

    def limit_words(self, key: str) -> str:
        """Say by how much a limit of the bus is broken, or why it is not shown to be kept."""
        limit = bus_of(self.profile).limit(key)
        return "" if limit is None else limit.words(self.network)

    def cure(self) -> Mending:
        """The least change after which the profile holds every constraint of a plan; one for all rules."""
        return self._cure

    @cached_property
    def _cure(self) -> Mending:
        mending = cure(self.profile, circle_steps=self.circle_steps)
        if mending.changes is None:
            return Mending(f"no change of {listed(changeable(self.profile), 'and')} is a cure: {mending.why}")
        lines = tuple(f"{key} = {short_text(value)}" for key, value in mending.changes.items())
        if mending.circle_failures:
            return Mending(f"with {', '.join(lines)} it fits, and then {mending.circle_failures[0]}; `plan` tries more")
        words = (
            "the period must change" if PERIOD in mending.changes else "",
            UNTESTED_CIRCLE if mending.circle_failures is None else "",
        )
        return Mending("; ".join(filter(None, words)), lines)
