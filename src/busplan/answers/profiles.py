"""`busplan profiles` for people."""

from collections.abc import Mapping, Sequence
from typing import Any

from busplan.answers.verdict_sentences import period
from busplan.forms.lines import BLANK, Line, plural


def profiles_lines(rows: Sequence[Mapping[str, Any]]) -> list[Line]:
    """Name, key figures and description of each profile."""
    lines: list[Line] = []
    for row in rows:
        figures = f"{plural(row['nodes'], 'node')} at {period(row['period_us'])}, {row['timing_model']} model decides"
        lines.extend((Line(f"{row['name']}: {figures}", "heading"), Line(row["description"]), BLANK))
    return lines[:-1]
