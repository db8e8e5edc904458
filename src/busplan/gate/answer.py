"""Answer of `busplan check` as sentences and as JSON; `gate` writes it for build services."""

from collections.abc import Iterator
from functools import partial

from busplan.forms.blocks import Code, JsonDocument, Record, Report, Sentence, State, count_value, joined, sentence
from busplan.forms.numbers import nouns
from busplan.gate.formats.plain import finding_parts
from busplan.gate.gate import Fit
from busplan.gate.report import CheckReport
from busplan.questions.words.documents import changed_document, document


def check_report(report: CheckReport) -> Report:
    """Report of `check`."""
    return Report(
        Sentence(("Check of profiles",)),
        lambda: tuple(_sentences(report)),
        partial(check_document, report),
        partial(check_records, report),
    )


def _sentences(report: CheckReport) -> Iterator[Sentence]:
    """Each finding, each file that could not be checked, and the summary."""
    for one in report.located:
        place, words = finding_parts(one.path, one.finding)
        yield Sentence((Code(place), f" {words}"), "fails" if one.finding.severity == "error" else "warns")
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
    return [{"path": one.path, **one.finding._asdict()} for one in report.located]


def check_document(report: CheckReport) -> JsonDocument:
    """Document of `busplan check --format json`."""
    files = []
    for one in report.files:
        content = {
            "path": one.path,
            "profile": one.profile,
            "status": one.status,
            **(one.fit or Fit(None, None, None))._asdict(),
            "findings": [finding._asdict() for finding in one.findings],
        }
        files.append(content if one.failure is None else {**content, "failure": one.failure})
    return changed_document(document("check", files=files, summary=report.summary._asdict()), report.changes)
