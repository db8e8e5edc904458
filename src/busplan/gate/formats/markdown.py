"""Findings as Markdown: for the summary page of a build, or a comment on a change."""

from collections.abc import Iterator
from typing import Final

from busplan.buses.rule import told_apart
from busplan.forms.columns import sentence_text
from busplan.forms.markdown_words import code, escaped, table
from busplan.forms.numbers import MISSING, plural
from busplan.gate.answer import summary_sentence
from busplan.gate.formats import GateFormat
from busplan.gate.gate import FileResult, Fit
from busplan.gate.report import CheckReport, Located
from busplan.questions.words.documents import changes_sentences

_PROFILES: Final = ("profile", "result", "verdict", "corrected margin, us")
_FINDINGS: Final = ("place", "rule", "severity", "what is wrong", "how to mend it")


class Markdown(GateFormat):
    """A table of the profiles with their verdicts, and one of the findings."""

    def write(self, report: CheckReport) -> str:
        """Write the summary and both tables; an empty one is left out."""
        return "".join(f"{line}\n" for line in _lines(report))


def _lines(report: CheckReport) -> Iterator[str]:
    said = (*changes_sentences(report.changes), summary_sentence(report))
    yield from ("### Check of profiles", "", escaped(" ".join(map(sentence_text, said))))
    if report.files:
        yield from ("", *table(_PROFILES, map(_profile, report.files), left=3))
    if report.located:
        yield from ("", *table(_FINDINGS, map(_finding, report.located), left=len(_FINDINGS)))


def _profile(file: FileResult) -> list[str]:
    fit = file.fit or Fit(None, None, None)
    margin = MISSING
    if fit.margin_corrected_us is not None:
        doubt = "" if fit.uncertainty_us is None else f" +/- {fit.uncertainty_us:.1f}"
        margin = f"{told_apart(fit.margin_corrected_us, 0.0)[0]}{doubt}"
    return [code(file.path), _result(file), fit.verdict or MISSING, margin]


def _result(file: FileResult) -> str:
    if file.failure is not None:
        return f"**could not be checked**: {escaped(file.failure)}"
    severities = [one.severity for one in file.findings]
    counts = [plural(severities.count(one), one) for one in ("error", "warning") if one in severities]
    said = ", ".join(counts) or "passes"
    return f"**{said}**" if "error" in severities else said


def _finding(one: Located) -> list[str]:
    finding = one.finding
    mending = [escaped(finding.help)] if finding.help else []
    mending += map(code, finding.cure.split("\n")) if finding.cure else []
    place = code(f"{one.path}:{finding.line}:{finding.column}")
    words = [escaped(f"{finding.code} {finding.rule}"), finding.severity, escaped(finding.problem)]
    return [place, *words, "<br>".join(mending)]
