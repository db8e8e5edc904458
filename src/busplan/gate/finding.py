"""Findings of the gate: of a profile's bus, its circle, and a recording of the machine."""

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, Final, NamedTuple

from busplan.buses.parts import Value
from busplan.buses.rule import Mending, RecordedFigure, Rule, RuleProblem, Severity
from busplan.elementwise import within
from busplan.english import listed, printable, told_apart
from busplan.gate import rules
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.profile.document import LoadedProfile, Spot
from busplan.profile.edit import short_text
from busplan.questions.base.arguments import FilePath
from busplan.questions.fit.certainty import available_us
from busplan.questions.fit.circle_setup import path_steps, refusals
from busplan.questions.fit.cure import changeable, cure
from busplan.questions.fit.figures import FitFigures, GroupCapacity, figures, node_counts
from busplan.questions.fit.network import PERIOD, changed, model_names, network_of
from busplan.sections.base import value_at
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.parameters import Refused


class Finding(NamedTuple):
    """One finding at its place; lines and columns count from 1."""

    code: str
    rule: str
    severity: Severity
    message: str
    """Problem and remedy in one line."""
    key: str
    line: int
    column: int
    marked_column: int
    """First column of the mark: of the value, or of the name or comment in its place."""
    marked_end_column: int
    """First column after the mark."""
    problem: str
    """The problem alone."""
    help: str | None = None
    """Remedy, in words."""
    cure: str | None = None
    """Remedy as lines of TOML: key = value."""
    weight: float = 0.0
    """As of its `RuleProblem`."""

    @property
    def record(self) -> dict[str, Any]:
        """The finding in JSON and CSV."""
        return {name: value for name, value in self._asdict().items() if name != "weight"}


def finding_parts(path: str, finding: Finding) -> tuple[str, str]:
    """Place and message of a finding."""
    return f"{path}:{finding.line}:{finding.column}:", f"{finding.code} {finding.severity}: {finding.message}"


def finding_line(path: str, finding: Finding) -> str:
    """The line path:line:column: CODE severity: message."""
    return printable(" ".join(finding_parts(path, finding)))


class Violation(NamedTuple):
    """A problem at its place, before comments suppress it."""

    rule: Rule
    problem: RuleProblem
    spot: Spot


def finding_of(rule: Rule, problem: RuleProblem, spot: Spot, *, words: str) -> Finding:
    """Finding of a broken rule; `words` are the problem with its key and circumstances."""
    cure = f"cheapest cure: {', '.join(problem.cure)}" if problem.cure else ""
    message = "; ".join(filter(None, (words, problem.help, cure)))
    mending = problem.help or None, "\n".join(problem.cure) or None
    return Finding(rule.code, rule.name, rule.severity, message, problem.key, *spot, words, *mending, problem.weight)


class Subject:
    """A profile with the figures that rules need, each computed at its first use.

    `changes` are already made to the profile, but not to its text. `circle_steps` is the number of steps of each axis
    above which its circle is not run; None runs no circle.
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
        """Verdict by the timing model that decides."""
        return figures(self.network, model=self.network.bus.deciding_model)

    @property
    def others_fit(self) -> tuple[tuple[str, bool], ...]:
        """Other timing models, each with whether the cycle fits, found without all their figures."""
        given_us, bus = available_us(self.network), self.network.bus
        return tuple(
            (model, bool(within(bus.cycle(self.network, model=model).required_us, given_us)))
            for model in model_names(self.network)
            if model != bus.deciding_model
        )

    def after(self, changes: Mapping[str, Value]) -> FitFigures:
        """Verdict with other values by dotted key."""
        return figures(changed(self.network, changes), model=self.deciding.timing_model)

    def counts(self, changes: Mapping[str, Value] | None = None) -> tuple[GroupCapacity, ...]:
        """Numbers of nodes that fit and that are shown to fit, by group, with other values by dotted key."""
        network = changed(self.network, changes) if changes else self.network
        return node_counts(network, model=self.deciding.timing_model)

    def limit_words(self, key: str) -> str:
        """Excess over a limit of the bus in words, or the reason why it is not shown to be kept."""
        limit = self.network.bus.limit(key)
        return "" if limit is None else limit.words(self.network)

    def cure(self) -> Mending:
        """Change after which the profile holds every constraint of a plan; one for all rules."""
        return self._cure

    @cached_property
    def _cure(self) -> Mending:
        mending = cure(self.network)
        if mending.changes is None:
            return Mending(f"no change of {listed(changeable(self.network), 'and')} helps: {mending.why}")
        lines = tuple(f"{key} = {short_text(value)}" for key, value in mending.changes.items())
        return Mending("the period must change" if PERIOD in mending.changes else "", lines)


MOST_STEPS: Final = 10_000_000
"""Steps of a circle that the gate runs, at most: some seconds, and a few hundred megabytes."""


def circle_problems(subject: Subject) -> Iterator[tuple[Rule, RuleProblem]]:
    """Run the circle test of a profile; yields each broken rule with its problem.

    A circle that cannot be run is a problem even if circles are not to be run. A cycle that does not fit has no circle;
    another rule reports it. A circle of more steps than the subject's `circle_steps` is not run.
    """
    profile, network, most_steps = subject.profile, subject.network, subject.circle_steps
    refused = refusals(network) if profile.asks_for_circle else ()
    yield from ((rules.IMPOSSIBLE_CIRCLE, _refused(cause, profile)) for cause in refused)
    if refused or most_steps is None or not profile.asks_for_circle or not subject.deciding.fits:
        return
    from busplan.questions.circle.failures import STABILITY
    from busplan.questions.circle.roundness import run_circles

    steps = path_steps(network)
    if steps > most_steps:
        words = f"the circle was not run: {steps:,} steps, over the limit of {most_steps:,}"
        yield rules.LONG_CIRCLE, RuleProblem(_key_in_file("circle.radius_mm", profile=profile), words)
        return
    result = run_circles(network).results[0]
    first = result.to_attack
    attack = "no single error source of the profile explains it" if first is None else f"attack {first[0].source} first"
    for failure in result.failures:
        if failure.is_of_bus:  # Another rule reports a cycle that is not shown to fit.
            continue
        is_stability = failure.name in STABILITY
        # A finding needs a key in the file, where a default limit is not.
        is_set = failure.name in profile.tolerance.model_fields_set
        key = f"tolerance.{failure.name}" if is_set else "servo.position_gain_per_s"
        way_out = ""
        if failure.name in CONTOUR_MEASURES and failure.value is not None:
            way_out = attack
        elif is_stability and value_at(profile, "servo.position_gain_per_s"):
            way_out = "lower servo.position_gain_per_s or what delays the loop"
        yield rules.OF_STABILITY if is_stability else rules.OF_CIRCLE, RuleProblem(key, failure.text, way_out)


def _refused(cause: Refused, profile: Profile) -> RuleProblem:
    """Reason why a circle cannot be run, at a key of the file."""
    key = _key_in_file(cause.name, *cause.beside, profile=profile)
    # A finding begins with its key, so the message leaves the name out.
    words, _, way_out = (f"{cause.value}: {cause.right}" if key == cause.name else cause.message).partition("; ")
    return RuleProblem(key, words, way_out)


def _key_in_file(*keys: str, profile: Profile) -> str:
    """First of some keys that the profile sets; without one, the section servo or circle."""
    for key in keys:
        section, _, name = key.rpartition(".")
        if name in value_at(profile, section).model_fields_set:
            return key
    return "servo" if "servo" in profile.model_fields_set else "circle"


def circle_rules_run(subject: Subject, problems: Iterable[tuple[Rule, RuleProblem]]) -> set[str]:
    """Codes of the circle rules that were checked: all for a circle that was run, else the rule on why it was not."""
    not_run = {rule.code for rule, _ in problems if rule in (rules.IMPOSSIBLE_CIRCLE, rules.LONG_CIRCLE)}
    if not_run:
        return not_run
    is_run = subject.circle_steps is not None and (subject.deciding.fits or not subject.profile.asks_for_circle)
    return {rule.code for rule in (rules.CIRCLE if is_run else (rules.IMPOSSIBLE_CIRCLE,))}


_UNPLANNED: Final = "name"
"""Key of a finding whose figure no key plans: every profile has a name."""


class Recording(NamedTuple):
    """A recording of the profile's machine."""

    path: FilePath
    quantile: float = 1.0
    """Share of the events that a recorded worst case covers, 0.5..1 [1]."""


def plan_problems(profile: Profile, recording: Recording) -> Iterator[tuple[Rule, RuleProblem]]:
    """Compare a recording with the plan.

    Yields figures outside the plan, those not shown to be within it, or the reason why nothing is shown. A recording
    that cannot be read, or not be compared with the profile, raises BusplanError.
    """
    from busplan.questions.measured import measured

    answer = measured(profile, recording.path, quantile=recording.quantile)
    for figure in answer.figures:
        way_out = "busplan measured --apply writes what was measured" if answer.edits.get(figure.key) else ""
        if figure.verdict == "outside":
            yield rules.OUTSIDE_PLAN, RuleProblem(figure.key or _UNPLANNED, _words(figure), way_out)
        elif figure.verdict == "not shown" and not answer.shows_nothing:
            yield rules.NOT_RECORDED, RuleProblem(figure.key or _UNPLANNED, f"not shown: {_words(figure)}", way_out)
    for reason in answer.shows_nothing:
        yield rules.NOTHING_RECORDED, RuleProblem(_UNPLANNED, reason, "record it anew")


def _words(figure: RecordedFigure) -> str:
    first = figure.first_words and f", {figure.first_words}"
    if figure.hidden or figure.planned is None or figure.recorded is None:
        return f"{figure.quantity}: {figure.hidden}{first}"
    unit = {"1": "", "share": " %"}.get(figure.unit, f" {figure.unit}")
    factor = 100 if figure.unit == "share" else 1
    if figure.unit in ("1", "bytes"):
        recorded, allowed = f"{figure.recorded:.0f}", f"{figure.planned:.0f}"
    else:
        recorded, allowed = told_apart(factor * figure.recorded, factor * figure.planned)
    doubt = "" if figure.uncertainty is None else f" +/- {factor * figure.uncertainty:.2g}"
    sense = "" if figure.sense == "equal" else f"{figure.sense} "
    note = f" ({figure.note})" if figure.note else ""
    return f"{figure.quantity}: {recorded}{doubt}{unit} recorded, {sense}{allowed}{unit} planned{first}{note}"
