"""Findings for build services: GitHub's workflow commands, JUnit's XML, and Markdown for a summary or a comment."""

import re
from collections.abc import Iterator
from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from busplan.buses.rule import told_apart
from busplan.english import plural
from busplan.forms.markdown import code, escaped, table
from busplan.forms.numbers import MISSING, sentence_text
from busplan.gate.finding import finding_line
from busplan.gate.gate import FileResult, Fit
from busplan.gate.report import CheckReport, Located, summary_sentence
from busplan.printable import printable, printable_lines
from busplan.questions.words.documents import changes_sentences


def github(report: CheckReport) -> str:
    """One workflow command for each finding, which GitHub shows next to the line of the file."""
    return "".join(f"{_command(located)}\n" for located in report.located)


def _command(located: Located) -> str:
    finding = located.finding
    properties = {
        "file": located.path,
        "line": str(finding.line),
        "col": str(finding.column),
        "title": f"{finding.code} {finding.rule}",
    }
    said = ",".join(f"{name}={_escaped(value, property_=True)}" for name, value in properties.items())
    return f"::{finding.severity} {said}::{_escaped(finding.message, property_=False)}"


def _escaped(text: str, *, property_: bool) -> str:
    text = text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    # GitHub has no escape for other control characters.
    return printable(text.replace(":", "%3A").replace(",", "%2C") if property_ else text)


_NO_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(report: CheckReport) -> str:
    """One test case for each profile: errors are failures, files that could not be checked errors, warnings output."""
    failures = sum(any(finding.severity == "error" for finding in file.findings) for file in report.files)
    errors = sum(file.failure is not None for file in report.files)
    counts = {"tests": str(len(report.files)), "failures": str(failures), "errors": str(errors)}
    root = Element("testsuites", {"name": "busplan check", **counts})
    suite = SubElement(root, "testsuite", {"name": "busplan check", **counts})
    for file in report.files:
        _case(suite, file)
    indent(root)
    return tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _case(suite: Element, file: FileResult) -> None:
    case = SubElement(suite, "testcase", classname="busplan.check", name=_clean(file.path), file=_clean(file.path))
    if file.failure is not None:
        SubElement(case, "error", message=_clean(file.failure))
    for severity, tag in (("error", "failure"), ("warning", "system-out")):
        findings = [finding for finding in file.findings if finding.severity == severity]
        if not findings:
            continue
        said = {"message": _clean(findings[0].message), "type": findings[0].code} if tag == "failure" else {}
        SubElement(case, tag, said).text = _clean("\n".join(finding_line(file.path, finding) for finding in findings))


def _clean(text: str) -> str:
    return _NO_XML.sub("?", printable_lines(text))


_PROFILES: Final = ("profile", "result", "verdict", "corrected margin, us")
_FINDINGS: Final = ("place", "rule", "severity", "what is wrong", "how to mend it")


def markdown(report: CheckReport) -> str:
    """A table of the profiles with their verdicts, and one of the findings; an empty one is left out."""
    return "".join(f"{line}\n" for line in _markdown_lines(report))


def _markdown_lines(report: CheckReport) -> Iterator[str]:
    said = (*changes_sentences(report.changes), summary_sentence(report))
    yield from ("### Check of profiles", "", escaped(" ".join(map(sentence_text, said))))
    if report.files:
        yield from ("", *table(_PROFILES, map(_profile, report.files), left=3))
    if report.located:
        yield from ("", *table(_FINDINGS, map(_finding_row, report.located), left=len(_FINDINGS)))


def _profile(file: FileResult) -> list[str]:
    fit = file.fit or Fit(None, None, None)
    margin = MISSING
    if fit.margin_corrected_us is not None:
        doubt = "" if fit.uncertainty_us is None else f" +/- {fit.uncertainty_us:.1f}"
        margin = f"{told_apart(fit.margin_corrected_us, 0.0)[0]}{doubt}"
    return [code(file.path), _profile_result(file), fit.verdict or MISSING, margin]


def _profile_result(file: FileResult) -> str:
    if file.failure is not None:
        return f"**could not be checked**: {escaped(file.failure)}"
    severities = [finding.severity for finding in file.findings]
    counts = [
        plural(severities.count(severity), severity) for severity in ("error", "warning") if severity in severities
    ]
    said = ", ".join(counts) or "passes"
    return f"**{said}**" if "error" in severities else said


def _finding_row(located: Located) -> list[str]:
    finding = located.finding
    mending = [escaped(finding.help)] if finding.help else []
    mending += map(code, finding.cure.split("\n")) if finding.cure else []
    place = code(f"{located.path}:{finding.line}:{finding.column}")
    words = [escaped(f"{finding.code} {finding.rule}"), finding.severity, escaped(finding.problem)]
    return [place, *words, "<br>".join(mending)]
