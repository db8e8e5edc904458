"""All findings of one run of the gate, and their summary."""

from functools import cached_property
from hashlib import sha256
from typing import NamedTuple

from busplan.buses.rule import Severity
from busplan.gate.finding import Finding
from busplan.gate.gate import FileResult
from busplan.profile.changes import NO_CHANGES, KeyChanges


class Summary(NamedTuple):
    """Counts of one run of the gate."""

    files: int
    errors: int
    warnings: int


class Located(NamedTuple):
    """A finding with its file, and a fingerprint that does not depend on lines and on other rules' findings."""

    path: str
    finding: Finding
    source: str
    fingerprint: str


class CheckReport:
    """Result of one run of the gate."""

    def __init__(self, files: tuple[FileResult, ...], changes: KeyChanges = NO_CHANGES, *, others: int = 0) -> None:
        self.files = files
        self.changes = changes
        self.others = others
        """How many files were skipped because they are no profiles."""

    @cached_property
    def summary(self) -> Summary:
        """Number of files, errors and warnings."""
        severities = [finding.severity for file in self.files for finding in file.findings]
        return Summary(len(self.files), severities.count("error"), severities.count("warning"))

    @property
    def failed(self) -> bool:
        """Whether a file could not be checked."""
        return any(file.failure is not None for file in self.files)

    def has_findings(self, least: Severity) -> bool:
        """Whether there are findings at or above a severity."""
        return self.summary.errors > 0 or (least == "warning" and self.summary.warnings > 0)

    @cached_property
    def located(self) -> tuple[Located, ...]:
        """All findings by file and place."""
        found = []
        for file in self.files:
            seen: dict[tuple[str, str], int] = {}
            for finding, source in zip(file.findings, file.source, strict=True):
                same = (finding.code, finding.key)
                number = seen[same] = seen.get(same, -1) + 1
                mark = "\0".join((file.path, *same, str(number)))
                found.append(
                    Located(file.path, finding, source, sha256(mark.encode("utf-8", "surrogatepass")).hexdigest())
                )
        return tuple(found)
