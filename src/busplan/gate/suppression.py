"""`# busplan: ignore[CODE] reason`: on the line of the finding, or alone on the line above."""

import re
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from busplan.buses.rule import Rule, RuleProblem
from busplan.gate.finding import Finding, Violation, finding_of
from busplan.gate.registry import NEVER_SUPPRESSED, SUPPRESSION_WITHOUT_EFFECT, SUPPRESSION_WITHOUT_REASON, all_rules
from busplan.profile.document import Document, Spot

MARK: Final = "busplan:"
_ADDRESSED: Final = re.compile(r"#\s*busplan:")
_COMMENT: Final = re.compile(r"#\s*busplan:\s*ignore\s*\[(?P<codes>[^\]\n]*)\](?P<reason>[^\n]*)")


class Suppression(NamedTuple):
    """One comment, and the line that it applies to."""

    codes: tuple[str, ...]
    """Rule codes; empty if the comment is not understood."""
    reason: str
    spot: Spot
    of_line: int


def suppressions(document: Document) -> Iterator[Suppression]:
    """Find the suppressions in a valid TOML text."""
    if MARK not in document.text:
        return
    for offset in document.comments:
        if not _ADDRESSED.match(document.text, offset):
            continue
        match = _COMMENT.match(document.text, offset)
        line, column = document.lines.line_and_column(offset)
        written = document.text[offset:].partition("\n")[0].rstrip()
        spot = Spot(line, column, column, column + len(written))
        if match is None:
            yield Suppression((), "", spot, line)
            continue
        alone = not document.text[document.lines.offset(line, 1) : offset].strip()
        codes = tuple(code.strip() for code in match["codes"].split(","))
        yield Suppression(codes, match["reason"].strip(), spot, line + 1 if alone else line)


def suppress(found: Iterable[Violation], document: Document, *, ran: set[str]) -> tuple[list[Violation], list[Finding]]:
    """Remove suppressed problems, and find what is wrong with the suppressions themselves.

    Parameters
    ----------
    found
        All problems of the document.
    document
        The document.
    ran
        Codes of the rules that have run: a suppression of others may have an effect.
    """
    left = list(found)
    own: list[Finding] = []
    for one in suppressions(document):
        if not one.codes:
            way_out = "write # busplan: ignore[CODE] reason"
            own.append(_finding(SUPPRESSION_WITHOUT_EFFECT, one, "the comment suppresses nothing", way_out))
        elif not one.reason:
            way_out = "add why behind the bracket"
            own.append(_finding(SUPPRESSION_WITHOUT_REASON, one, "the suppression says no reason", way_out))
        for code in one.codes:
            hit = [each for each in left if each.rule.code == code and each.spot.line == one.of_line]
            left = [each for each in left if each not in hit]
            if code not in all_rules():
                own.append(_finding(SUPPRESSION_WITHOUT_EFFECT, one, f"{code or 'nothing'} is no code of a rule"))
            elif code in NEVER_SUPPRESSED:
                own.append(_finding(SUPPRESSION_WITHOUT_EFFECT, one, f"{code} cannot be suppressed, it must be mended"))
            elif not hit and code in ran:
                message = f"{code} has nothing to suppress on line {one.of_line}"
                own.append(_finding(SUPPRESSION_WITHOUT_EFFECT, one, message))
    return left, own


def _finding(rule: Rule, one: Suppression, words: str, way_out: str = "") -> Finding:
    return finding_of(rule, RuleProblem("", words, way_out), one.spot, words=words)
