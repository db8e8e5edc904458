"""Check documents against all rules."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Literal, NamedTuple

from busplan.analysis.circle.check import MOST_STEPS
from busplan.buses.rule import Rule, RuleProblem
from busplan.errors import BusplanError, PlacedError
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.profile.collect import ProfileSource
from busplan.profile.document import Document
from busplan.profile.keys import path_of
from busplan.profile.toml import LoadedProfile, decode, read_bytes, validate
from busplan.rules import circle
from busplan.rules.baseline import Recorded, figures_of, regressions
from busplan.rules.file import BY_KIND
from busplan.rules.finding import Finding, Subject
from busplan.rules.registry import BASELINE, all_rules, cycle_rules
from busplan.rules.suppression import suppress

Status = Literal["ok", "findings", "error"]


class FileResult(NamedTuple):
    """Result of one file."""

    path: str
    profile: str | None
    """Name of the profile; None if it cannot be read."""
    findings: tuple[Finding, ...]
    """In the order of their places."""
    figures: dict[str, float]
    """Figures for a baseline; empty if the profile cannot be read or they were not requested."""
    source: tuple[str, ...] = ()
    """Source line of each finding."""
    failure: str | None = None
    """Why the file could not be checked; None if it was checked."""

    @property
    def status(self) -> Status:
        """Whether the file has no findings, has findings, or could not be checked."""
        if self.failure is not None:
            return "error"
        return "findings" if self.findings else "ok"


def check_source(
    source: ProfileSource,
    *,
    with_circle: bool = True,
    circle_steps: int = MOST_STEPS,
    changes: KeyChanges = NO_CHANGES,
    recorded: Mapping[str, Recorded] | None = None,
    record: bool = False,
) -> FileResult:
    """Read one file and check it against all rules.

    Parameters
    ----------
    source
        The file; if it cannot be read, the result has a failure.
    with_circle
        Whether to run the circle test of profiles that ask for one.
    circle_steps
        Most simulated steps of each axis of a circle: a longer one is not run.
    changes
        Changes of the profile; if its schema refuses them, the result has a failure.
    recorded
        Baseline figures by file name; None for no baseline.
    record
        Whether to give the figures that a baseline records.
    """
    if source.failure is not None:
        return FileResult(source.name, None, (), {}, failure=source.failure)
    try:
        content = read_bytes(source.path, name=source.name)
    except BusplanError as error:
        return FileResult(source.name, None, (), {}, failure=str(error))
    try:
        document = decode(content, name=source.name)
    except PlacedError as error:
        return unreadable(source.name, error, content)
    before = None if recorded is None else recorded.get(source.name, {})
    return check_document(
        document,
        with_circle=with_circle,
        circle_steps=circle_steps,
        changes=changes,
        baseline=before,
        record=record,
    )


def check_document(
    document: Document,
    *,
    with_circle: bool = True,
    circle_steps: int = MOST_STEPS,
    changes: KeyChanges = NO_CHANGES,
    baseline: Recorded | None = None,
    record: bool = True,
) -> FileResult:
    """Check one document against all rules.

    Parameters
    ----------
    document
        The text and its name.
    with_circle
        Whether to run the circle test of profiles that ask for one.
    circle_steps
        Most simulated steps of each axis of a circle: a longer one is not run.
    changes
        Changes of the profile; if its schema refuses them, the result has a failure.
    baseline
        Baseline figures of the profile; None for no baseline.
    record
        Whether to give the figures that a baseline records.

    Returns
    -------
    FileResult
        Findings in the order of their places, without suppressed ones.
    """
    try:
        profile = validate(document)
    except PlacedError as error:
        # These cannot be suppressed: nothing else of the file was checked.
        return _result(document, None, list(_of_file(error)), {})
    try:
        profile = changes.applied(profile)
    except BusplanError as error:
        failure = f"{document.name}: {'; '.join(error.problems)}"
        return FileResult(document.name, profile.name, (), {}, failure=failure)
    subject = Subject(LoadedProfile(profile, document), changes, circle_steps=circle_steps if with_circle else None)
    own = cycle_rules(profile.bus.kind)
    found = list(_findings(subject, own))
    ran = {rule.code for rule in own}
    if with_circle:
        problems = list(circle.circle_problems(subject, most_steps=circle_steps))
        found += [_placed(subject, all_rules()[code], problem) for code, problem in problems]
        ran |= circle.answered(subject, problems)
    if baseline is not None:
        lost = regressions(figures_of(subject), baseline)
        found += [_placed(subject, BASELINE, problem) for problem in lost]
        ran.add(BASELINE.code)
    if changes.each:
        # What a comment suppresses is of the file as it is.
        ran = set()
    figures = figures_of(subject) if record else {}
    return _result(document, profile.name, suppress(found, document, ran=ran), figures)


def _findings(subject: Subject, rules: Iterable[Rule]) -> Iterator[Finding]:
    for rule in rules:
        if rule.check is not None:
            for problem in rule.check(subject):
                yield _placed(subject, rule, problem)


def unreadable(name: str, error: PlacedError, content: bytes) -> FileResult:
    """Make the result for a file that is not text."""
    lines = content.decode("utf-8-sig", errors="replace").split("\n")
    found = tuple(_of_file(error))
    return FileResult(name, None, found, {}, tuple(lines[one.line - 1] for one in found))


def _of_file(error: PlacedError) -> Iterator[Finding]:
    last = len(error.placed) - 1
    for number, one in enumerate(error.placed):
        rule = BY_KIND[one.kind]
        more = f"; {error.hidden} more problems of this file are not listed" if error.hidden and number == last else ""
        yield Finding(rule.code, rule.name, rule.severity, one.message + more, one.key, one.line, one.column)


def _placed(subject: Subject, rule: Rule, problem: RuleProblem) -> Finding:
    """Make a finding at the line of the problem's key, or of the table that should have it."""
    document = subject.document
    line, column = document.lines.line_and_column(
        document.nearest(path_of(document.data() if problem.key.count(".") > 1 else {}, problem.key))
    )
    message = f"{problem.key}: {problem.message}{subject.origin}"
    return Finding(rule.code, rule.name, rule.severity, message, problem.key, line, column)


def _result(document: Document, name: str | None, found: list[Finding], figures: dict[str, float]) -> FileResult:
    ordered = tuple(sorted(found, key=lambda one: (one.line, one.column, one.code, one.message)))
    lines = document.text.split("\n") if ordered else []
    return FileResult(document.name, name, ordered, figures, tuple(lines[one.line - 1] for one in ordered))
