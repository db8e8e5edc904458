"""Findings as JUnit XML: one test case for each profile, also without findings."""

import re
from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from busplan.gate.formats import GateFormat
from busplan.gate.formats.plain import finding_line
from busplan.gate.gate import FileResult
from busplan.gate.report import CheckReport
from busplan.printable import printable_lines

_NO_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class JUnit(GateFormat):
    """One test case for each profile."""

    def write(self, report: CheckReport) -> str:
        """Write errors as failures, files that could not be checked as errors, warnings as output."""
        failures = sum(any(one.severity == "error" for one in file.findings) for file in report.files)
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
        found = [one for one in file.findings if one.severity == severity]
        if not found:
            continue
        said = {"message": _clean(found[0].message), "type": found[0].code} if tag == "failure" else {}
        SubElement(case, tag, said).text = _clean("\n".join(finding_line(file.path, one) for one in found))


def _clean(text: str) -> str:
    return _NO_XML.sub("?", printable_lines(text))
