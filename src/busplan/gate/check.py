"""`busplan.check`."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

from busplan.forms.blocks import Report
from busplan.forms.columns import sentence_text
from busplan.gate.answer import check_report, summary_sentence
from busplan.gate.gate import FileResult, check_document, check_source
from busplan.gate.report import CheckReport, Located, Summary
from busplan.profile.collect import collect
from busplan.profile.document import Document
from busplan.profile.write import profile_text
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import ProfileLike, argument, items
from busplan.questions.circle.check import MOST_STEPS
from busplan.sections.profile import Profile


@dataclass(frozen=True, slots=True, repr=False)
class CheckAnswer(Answer):
    """Answer of `check`.

    Parameters
    ----------
    files
        Each file with its `status`, its `findings` and, if it could not be checked, its `failure`.
    """

    files: tuple[FileResult, ...]

    @property
    def findings(self) -> tuple[Located, ...]:
        """All findings by file and place, each with the `path` and the source line."""
        return self._found.located

    @property
    def summary(self) -> Summary:
        """Number of files, errors and warnings."""
        return self._found.summary

    @property
    def passed(self) -> bool:
        """Whether every file could be checked, and none has an error."""
        return not self._found.failed and not self._found.has_findings("error")

    def report(self) -> Report:
        """The answer in blocks."""
        return check_report(self._found)

    def _headline(self) -> str:
        return sentence_text(summary_sentence(self._found))

    @property
    def _found(self) -> CheckReport:
        return CheckReport(self.files)


def check(
    paths: ProfileLike | Iterable[ProfileLike], *, circle: bool = True, circle_steps: int = MOST_STEPS
) -> CheckAnswer:
    """Check whether profiles fit their bus and hold their circle.

    Parameters
    ----------
    paths
        One or several files, folders (every *.toml below with a `schema_version`), shipped names or a `Profile` each. A
        `Profile` is checked as the file that `busplan` would write of it, NAME.toml.
    circle
        Run the circle test of profiles that ask for one.
    circle_steps
        Most simulated steps of each axis of a circle: a longer one is not run, and has a warning.

    Returns
    -------
    CheckAnswer
        Findings with code, message, key, line and column. A file that cannot be read raises nothing: it has a
        `failure`, and the others are checked.

    Raises
    ------
    BusplanError
        No path, or standard input.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.check(["paper-4ms", "paper-dma"])
    >>> answer.passed, answer.summary
    (True, Summary(files=2, errors=0, warnings=0))
    """
    # A profile is iterable, too: over its sections.
    several = [paths] if isinstance(paths, str | os.PathLike | Profile) else items(paths, name="paths")
    checks = partial(check_document, with_circle=circle, circle_steps=circle_steps, record=False)
    written = [Document(f"{one.name}.toml", profile_text(one)) for one in several if isinstance(one, Profile)]
    files = [argument(one) for one in several if not isinstance(one, Profile)]
    sources = collect(files).sources if files else ()
    found = [check_source(source, with_circle=circle, circle_steps=circle_steps) for source in sources]
    return CheckAnswer((*found, *map(checks, written)))
