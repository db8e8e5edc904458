"""Check of documents against all rules, except those that their comments suppress."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, Literal, NamedTuple

from busplan.buses.cycle import RestsOn
from busplan.buses.rule import Rule, RuleProblem
from busplan.errors import BusplanError, PlacedError
from busplan.gate.baseline import Record, figures_of, keys_of, known_as, regression
from busplan.gate.finding import (
    MOST_STEPS,
    Finding,
    Recording,
    Subject,
    Violation,
    circle_problems,
    circle_rules_run,
    finding_of,
    plan_problems,
)
from busplan.gate.rules import (
    BASELINE,
    BY_PROBLEM,
    NEVER_SUPPRESSED,
    RECORDING,
    SUPPRESSION_WITHOUT_EFFECT,
    SUPPRESSION_WITHOUT_REASON,
    all_rules,
    cycle_rules,
)
from busplan.gate.selection import EVERY_RULE, Selection
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.profile.document import Document, LoadedProfile, Spot, decode, read_bytes, validate
from busplan.profile.kinds import path_of
from busplan.profile.sources import ProfileSource
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.figures import CycleFigures
from busplan.sourced import constants_changed

MARK: Final = "busplan:"
_MARKED_COMMENT: Final = re.compile(r"#\s*busplan:")
_IGNORE_COMMENT: Final = re.compile(r"#\s*busplan:\s*ignore\s*\[(?P<codes>[^\]\n]*)\](?P<reason>[^\n]*)")


class Suppression(NamedTuple):
    """A comment that suppresses rules, and its line."""

    codes: tuple[str, ...]
    """Codes of rules; empty if the comment is not understood."""
    reason: str
    spot: Spot
    of_line: int


def suppressions(document: Document) -> Iterator[Suppression]:
    """Suppressions in a valid TOML text."""
    if MARK not in document.text:
        return
    for offset in document.comments:
        if not _MARKED_COMMENT.match(document.text, offset):
            continue
        match = _IGNORE_COMMENT.match(document.text, offset)
        line, column = document.lines.line_and_column(offset)
        written = document.text[offset:].partition("\n")[0].rstrip()
        spot = Spot(line, column, column, column + len(written))
        if match is None:
            yield Suppression((), "", spot, line)
            continue
        alone = not document.text[document.lines.offset(line, 1) : offset].strip()
        codes = tuple(code.strip() for code in match["codes"].split(","))
        yield Suppression(codes, match["reason"].strip(), spot, line + 1 if alone else line)


def suppress(
    violations: Iterable[Violation], document: Document, *, ran: set[str]
) -> tuple[list[Violation], list[tuple[Violation, str]], list[Finding]]:
    """Separate suppressed problems from others, and check the suppressing comments themselves.

    A suppression can be without effect only for the rules that `ran`. Returns the problems that are left, the
    suppressed ones with the reason in their comment, and findings on comments.
    """
    left = list(violations)
    suppressed: list[tuple[Violation, str]] = []
    findings: list[Finding] = []
    for comment in suppressions(document):
        if not comment.codes:
            words, way_out = "the comment suppresses nothing", "write # busplan: ignore[CODE] reason"
            findings.append(_comment_finding(SUPPRESSION_WITHOUT_EFFECT, comment, words, way_out))
        elif not comment.reason:
            words, way_out = "the suppression gives no reason", "add the reason after the bracket"
            findings.append(_comment_finding(SUPPRESSION_WITHOUT_REASON, comment, words, way_out))
        for code in comment.codes:
            hit = [broken for broken in left if broken.rule.code == code and broken.spot.line == comment.of_line]
            left = [broken for broken in left if broken not in hit]
            suppressed += ((broken, comment.reason) for broken in hit)
            if code not in all_rules():
                message = f"{code or 'nothing'} is not the code of a rule"
            elif code in NEVER_SUPPRESSED:
                message = f"{code} cannot be suppressed; correct the profile"
            elif not hit and code in ran:
                message = f"{code} has nothing to suppress on line {comment.of_line}"
            else:
                continue
            findings.append(_comment_finding(SUPPRESSION_WITHOUT_EFFECT, comment, message))
    return left, suppressed, findings


def _comment_finding(rule: Rule, suppression: Suppression, words: str, way_out: str = "") -> Finding:
    return finding_of(rule, RuleProblem("", words, way_out), suppression.spot, words=words)


Status = Literal["ok", "findings", "error"]
SuppressedBy = Literal["comment", "selection", "baseline"]


class Fit(NamedTuple):
    """Verdict of the timing model that decides, and the fit of a cycle in its slice."""

    verdict: str | None = None
    """The verdict: fits, not shown to fit, or does not fit."""
    margin_corrected_us: float | None = None
    """Time left in the slice, corrected for the bias [us]; None for messages alone."""
    uncertainty_us: float | None = None
    """Expanded uncertainty of the corrected margin [us]."""
    rests_on: tuple[RestsOn, ...] = ()
    """Assumptions of the verdict that the profile does not give."""


class Suppressed(NamedTuple):
    """A finding that does not count."""

    finding: Finding
    by: SuppressedBy
    reason: str


class FileResult(NamedTuple):
    """Result of one file."""

    path: str
    profile: str | None
    """Name of the profile; None if it cannot be read."""
    findings: tuple[Finding, ...]
    """Findings that count, in the order of their places."""
    figures: dict[str, float]
    """Figures for a baseline; empty if the profile cannot be read or they were not requested."""
    source: tuple[str, ...] = ()
    """Source line of each finding."""
    failure: str | None = None
    """Reason why the file could not be checked; None if it was."""
    keys: Mapping[str, object] | None = None
    """Keys for a baseline; None where `figures` is empty."""
    fit: Fit | None = None
    """Fit of the cycle; None if the profile cannot be read."""
    circle_not_run: bool = False
    """Whether the profile asks for a circle test that the check left out."""
    suppressed: tuple[Suppressed, ...] = ()
    """Findings that a comment, the selection of rules or the baseline suppresses."""
    mended: tuple[str, ...] = ()
    """Findings in the baseline that no longer exist."""

    @property
    def rests_on_words(self) -> str:
        """Assumptions of the verdict in words; empty if the profile gives all, or cannot be read."""
        return "" if self.fit is None else ", ".join(dict.fromkeys(part.words for part in self.fit.rests_on))

    @property
    def status(self) -> Status:
        """Whether the file has no findings, has findings, or could not be checked."""
        if self.failure is not None:
            return "error"
        return "findings" if self.findings else "ok"


def check_source(
    source: ProfileSource | Document, recorded: Record | None = None, *, options: Mapping[str, Any]
) -> FileResult:
    """Read a file, unless it is in memory, and check it against all rules.

    A file that cannot be read gives a result with a failure. `recorded` is its record in a baseline, or None; options
    are arguments of `check_document`.
    """
    with constants_changed(options.get("changes", NO_CHANGES).changed_constants):
        return _check_source(source, recorded, options)


def _check_source(source: ProfileSource | Document, recorded: Record | None, options: Mapping[str, Any]) -> FileResult:
    if isinstance(source, Document):
        return check_document(source, baseline=recorded, **options)
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
    return check_document(document, baseline=recorded, **options)


def check_document(
    document: Document,
    *,
    with_circle: bool = True,
    circle_steps: int = MOST_STEPS,
    changes: KeyChanges = NO_CHANGES,
    baseline: Record | None = None,
    record: bool = True,
    recording: Recording | None = None,
    selection: Selection = EVERY_RULE,
) -> FileResult:
    """Check a document against all rules.

    Circles run on `with_circle`, those of more than `circle_steps` steps never. Changes that the schema refuses give a
    result with a failure, and so does a recording that cannot be compared. `baseline` is the profile's record; `record`
    asks for the figures of a new one; the selection says which rules count.
    """
    try:
        profile = validate(document)
    except PlacedError as error:
        # Comments do not suppress these, because they prevent all other checks.
        return _result(document, None, list(_file_findings(error)))
    try:
        profile = changes.applied(profile)
    except BusplanError as error:
        failure = f"{document.name}: {'; '.join(error.problems)}"
        return FileResult(document.name, profile.name, (), {}, failure=failure)
    subject = Subject(LoadedProfile(profile, document), changes, circle_steps=circle_steps if with_circle else None)
    rules = cycle_rules(profile.bus.kind)
    of_circle = list(circle_problems(subject))
    problems = [(rule, problem) for rule in rules if rule.check for problem in rule.check(subject)] + of_circle
    ran = {rule.code for rule in rules} | circle_rules_run(subject, of_circle)
    if baseline is not None:
        problems += ((BASELINE, problem) for problem in regression(subject, baseline))
        ran.add(BASELINE.code)
    if recording is not None:
        try:
            problems += plan_problems(profile, recording)
        except BusplanError as error:
            return FileResult(document.name, profile.name, (), {}, failure="; ".join(error.problems))
        ran.update(rule.code for rule in RECORDING)
    paths: dict[int, Any] = {}
    violations = [_placed(document, rule, problem, paths) for rule, problem in problems]
    if changes.entries:
        # Comments are about the file as it is. With changes, a suppression without effect is no fault.
        ran = set()
    left, commented, of_comments = suppress(violations, document, ran=ran)
    found = [*(_finding_of(violation, subject) for violation in left), *of_comments]
    suppressed = [Suppressed(_finding_of(violation, subject), "comment", reason) for violation, reason in commented]
    known = set() if baseline is None else set(baseline.findings)
    findings = []
    for finding in found:
        reason = selection.reason(finding.code, document.name)
        if reason:
            suppressed.append(Suppressed(finding, "selection", reason))
        elif known_as(finding.code, finding.key) in known:
            suppressed.append(Suppressed(finding, "baseline", "known in the baseline"))
        else:
            findings.append(finding)
    here = {known_as(finding.code, finding.key) for finding in (*found, *(each.finding for each in suppressed))}
    not_run = profile.asks_for_circle and not with_circle
    result = _result(document, profile.name, findings)._replace(
        fit=_fit(subject), circle_not_run=not_run, suppressed=tuple(suppressed), mended=tuple(sorted(known - here))
    )
    return result._replace(figures=figures_of(subject), keys=keys_of(profile)) if record else result


def _fit(subject: Subject) -> Fit:
    deciding = subject.deciding
    fit = Fit(deciding.verdict, rests_on=deciding_cycle(subject.network).rests_on())
    if not isinstance(deciding, CycleFigures):
        return fit
    return fit._replace(margin_corrected_us=deciding.margin_corrected_us, uncertainty_us=deciding.uncertainty_us)


def unreadable(name: str, error: PlacedError, content: bytes) -> FileResult:
    """Result for a file that is not text."""
    lines = content.decode("utf-8-sig", errors="replace").split("\n")
    findings = tuple(_file_findings(error))
    return FileResult(name, None, findings, {}, tuple(lines[finding.line - 1] for finding in findings))


def _file_findings(error: PlacedError) -> Iterator[Finding]:
    last = len(error.placed) - 1
    for number, problem in enumerate(error.placed):
        rule = BY_PROBLEM[problem.kind]
        more = f"; {error.hidden} more problems of this file are not listed" if error.hidden and number == last else ""
        spot = Spot(problem.line, problem.column, *(problem.marked or (problem.column, problem.column + 1)))
        words = problem.message + more
        yield finding_of(rule, RuleProblem(problem.key, words), spot, words=words)


def _placed(document: Document, rule: Rule, problem: RuleProblem, paths: dict[int, Any]) -> Violation:
    """Place of a problem at its key, or at the table that should have it; `paths` are the `arrays` of `path_of`."""
    path = path_of(document.data(), problem.key, paths) if problem.key.count(".") > 1 else (*problem.key.split("."),)
    return Violation(rule, problem, document.spot(path))


def _finding_of(violation: Violation, subject: Subject) -> Finding:
    rule, problem, spot = violation
    message = problem.message if isinstance(problem.message, str) else problem.message()
    return finding_of(rule, problem, spot, words=f"{problem.key}: {message}{subject.origin}")


def _result(document: Document, name: str | None, findings: list[Finding]) -> FileResult:
    ordered = tuple(sorted(findings, key=lambda finding: (finding.line, finding.column, finding.code, finding.message)))
    lines = document.text.split("\n") if ordered else []
    return FileResult(document.name, name, ordered, {}, tuple(lines[finding.line - 1] for finding in ordered))
