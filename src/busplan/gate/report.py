"""Answer of `busplan check`: its findings and their summary, as sentences and as JSON."""

from collections.abc import Iterator
from hashlib import sha256
from typing import NamedTuple

from busplan.buses.rule import Severity
from busplan.english import nouns
from busplan.forms.blocks import Code, JsonDocument, Record, Report, Sentence, State, count_value, joined, sentence
from busplan.gate.finding import Finding, finding_parts
from busplan.gate.gate import FileResult, Fit
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.questions.words.documents import changed_document, document


class Summary(NamedTuple):
    """Counts of one run of the gate."""

    files: int
    errors: int
    warnings: int
    circles_not_run: int = 0


class Located(NamedTuple):
    """A finding with its file, and a fingerprint that does not depend on lines and on other rules' findings."""

    path: str
    finding: Finding
    source: str
    fingerprint: str


class CheckReport(NamedTuple):
    """Result of one run of the gate."""

    files: tuple[FileResult, ...]
    """Each file with its `status`, its `findings` and, if it could not be checked, its `failure`."""
    changes: KeyChanges = NO_CHANGES
    """What was changed in every file."""
    others: int = 0
    """Number of files that were skipped because they are no profiles."""
    unmatched: str = ""
    """Which profiles have no record in the baseline, and which records no profile; empty where there is none."""

    @property
    def summary(self) -> Summary:
        """Number of files, errors, warnings, and circle tests that were not run."""
        severities = [finding.severity for file in self.files for finding in file.findings]
        not_run = sum(file.circle_not_run for file in self.files)
        return Summary(len(self.files), severities.count("error"), severities.count("warning"), not_run)

    @property
    def failed(self) -> bool:
        """Whether a file could not be checked."""
        return any(file.failure is not None for file in self.files)

    def has_findings(self, least: Severity) -> bool:
        """Whether there are findings at or above a severity."""
        return self.summary.errors > 0 or (least == "warning" and self.summary.warnings > 0)

    @property
    def located(self) -> tuple[Located, ...]:
        """All findings by file and place."""
        located = []
        for file in self.files:
            seen: dict[tuple[str, str], int] = {}
            for finding, source in zip(file.findings, file.source, strict=True):
                same = (finding.code, finding.key)
                number = seen[same] = seen.get(same, -1) + 1
                mark = "\0".join((file.path, *same, str(number)))
                located.append(
                    Located(file.path, finding, source, sha256(mark.encode("utf-8", "surrogatepass")).hexdigest())
                )
        return tuple(located)


def check_report(report: CheckReport) -> Report:
    """Report of `check`."""
    return Report(
        Sentence(("Check of profiles",)),
        tuple(_sentences(report)),
        check_document(report),
        check_records(report),
    )


def _sentences(report: CheckReport) -> Iterator[Sentence]:
    """Each finding, each file that could not be checked, and the summary."""
    for located in report.located:
        place, words = finding_parts(located.path, located.finding)
        yield Sentence((Code(place), f" {words}"), "fails" if located.finding.severity == "error" else "warns")
    yield from (Sentence((file.failure,), "fails") for file in report.files if file.failure is not None)
    yield summary_sentence(report)


def summary_sentence(report: CheckReport) -> Sentence:
    """Say how many profiles were checked, and what was found."""
    counts = report.summary
    failed = sum(file.failure is not None for file in report.files)
    checked = counts.files - failed
    summary = sentence(
        f"checked {{}} {nouns(checked, 'profile')}: {{}} {nouns(counts.errors, 'error')}, "
        f"{{}} {nouns(counts.warnings, 'warning')}",
        count_value(checked, "files"),
        count_value(counts.errors, "errors"),
        count_value(counts.warnings, "warnings"),
        state=_state(report),
    )
    if failed:
        summary = joined(summary, sentence("{} could not be checked", count_value(failed)), by="; ")
    if counts.circles_not_run:
        words = f"{{}} {nouns(counts.circles_not_run, 'circle test')} not run"
        summary = joined(summary, sentence(words, count_value(counts.circles_not_run, "circles_not_run")), by="; ")
    if report.others:
        words = f"skipped {{}} {nouns(report.others, 'file')} without a schema_version"
        summary = joined(summary, sentence(words, count_value(report.others)), by="; ")
    return summary


def _state(report: CheckReport) -> State:
    if report.failed or report.has_findings("error"):
        return "fails"
    return "warns" if report.has_findings("warning") else "passes"


def check_records(report: CheckReport) -> list[Record]:
    """One row for each finding."""
    return [{"path": located.path, **located.finding._asdict()} for located in report.located]


def check_document(report: CheckReport) -> JsonDocument:
    """Document of `busplan check --format json`."""
    files = []
    for file in report.files:
        content = {
            "path": file.path,
            "profile": file.profile,
            "status": file.status,
            **(file.fit or Fit(None, None, None))._asdict(),
            "findings": [finding._asdict() for finding in file.findings],
        }
        files.append(content if file.failure is None else {**content, "failure": file.failure})
    return changed_document(document("check", files=files, summary=report.summary._asdict()), report.changes)
