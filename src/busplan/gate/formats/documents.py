"""Findings as JSON: the document of `check`, GitLab's code quality report, and SARIF 2.1.0 of code scanning services.

References
----------
OASIS, Static Analysis Results Interchange Format (SARIF) Version 2.1.0.
"""

import os
from pathlib import Path, PurePath
from typing import Final
from urllib.parse import quote

from busplan import __version__
from busplan.buses.rule import Rule
from busplan.forms import markdown, terminal
from busplan.forms.blocks import JsonDocument
from busplan.gate.report import CheckReport, Located, check_document
from busplan.gate.rules import all_rules, rule_report
from busplan.printable import to_json


def json(report: CheckReport) -> str:
    """The document of `busplan check`."""
    return to_json(check_document(report))


def gitlab(report: CheckReport) -> str:
    """GitLab's code quality report: one issue for each finding."""
    issues = [
        {
            "description": f"{located.finding.code} {located.finding.message}",
            "check_name": located.finding.rule,
            "fingerprint": located.fingerprint,
            "severity": "major" if located.finding.severity == "error" else "minor",
            "location": {"path": PurePath(located.path).as_posix(), "lines": {"begin": located.finding.line}},
        }
        for located in report.located
    ]
    return to_json(issues)


_SCHEMA: Final = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif(report: CheckReport) -> str:
    """One SARIF run with all rules and results; files that could not be checked are notifications."""
    failures = [file for file in report.files if file.failure is not None]
    run = {
        "tool": {
            "driver": {
                "name": "busplan",
                "semanticVersion": __version__,
                "rules": [_rule(rule) for rule in all_rules().values()],
            }
        },
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {
                "executionSuccessful": not failures,
                "toolExecutionNotifications": [
                    {"level": "error", "message": {"text": file.failure}} for file in failures
                ],
            }
        ],
        "results": [_result(located) for located in report.located],
    }
    document = {"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}
    return to_json(document)


def _rule(rule: Rule) -> JsonDocument:
    page = rule_report(rule)
    return {
        "id": rule.code,
        "name": "".join(word.capitalize() for word in rule.name.split("-")),
        "shortDescription": {"text": rule.summary},
        "fullDescription": {"text": rule.explanation},
        "help": {"text": terminal.text(page), "markdown": markdown.text(page)},
        "defaultConfiguration": {"level": rule.severity},
    }


def _result(located: Located) -> JsonDocument:
    finding = located.finding
    return {
        "ruleId": finding.code,
        "ruleIndex": list(all_rules()).index(finding.code),
        "level": finding.severity,
        "message": {"text": finding.message},
        "locations": [
            {
                "physicalLocation": {
                    "artifactLocation": _artifact(located.path),
                    "region": {
                        "startLine": finding.line,
                        "startColumn": finding.column,
                        "endColumn": finding.marked_end_column,
                    },
                }
            }
        ],
        "partialFingerprints": {"busplanFinding/v1": located.fingerprint},
        # SARIF's own fixes are edits of a file, and a cure may be a key that the file does not have.
        **({"properties": {"cure": finding.cure}} if finding.cure else {}),
    }


def _artifact(path: str) -> dict[str, str]:
    """URI of a file, relative to the working folder if the file is below it."""
    pure = PurePath(path)
    if pure.is_absolute() or ".." in pure.parts:
        return {"uri": Path(path).resolve().as_uri()}
    return {"uri": quote(os.fsencode(pure.as_posix())), "uriBaseId": "%SRCROOT%"}
