"""Findings as JSON: our own document, and GitLab's code quality report."""

from pathlib import PurePath

from busplan.answers.documents import document
from busplan.forms.json_and_csv import to_json
from busplan.printable import json_text
from busplan.rules.report import CheckReport


def as_json(report: CheckReport) -> str:
    """Our own document."""
    files = []
    for one in report.files:
        content = {
            "path": one.path,
            "profile": one.profile,
            "status": one.status,
            "findings": [finding._asdict() for finding in one.findings],
        }
        files.append(content if one.failure is None else {**content, "failure": one.failure})
    return to_json(document("check", files=files, summary=report.summary._asdict()))


def as_gitlab(report: CheckReport) -> str:
    """GitLab's code quality report."""
    issues = [
        {
            "description": f"{one.finding.code} {one.finding.message}",
            "check_name": one.finding.rule,
            "fingerprint": one.fingerprint,
            "severity": "major" if one.finding.severity == "error" else "minor",
            "location": {"path": PurePath(one.path).as_posix(), "lines": {"begin": one.finding.line}},
        }
        for one in report.located
    ]
    return json_text(issues, indent=2) + "\n"
