"""Findings as JSON: the document of `check`, and GitLab's code quality report."""

from pathlib import PurePath

from busplan.forms.json_document import to_json
from busplan.gate.answer import check_document
from busplan.gate.formats import GateFormat
from busplan.gate.report import CheckReport
from busplan.printable import json_text


class Json(GateFormat):
    """The document of `busplan check`."""

    def write(self, report: CheckReport) -> str:
        """Write files, findings and the summary."""
        return to_json(check_document(report))


class GitLab(GateFormat):
    """GitLab's code quality report."""

    def write(self, report: CheckReport) -> str:
        """Write one issue for each finding."""
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
