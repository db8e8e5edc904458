"""`busplan profiles` for people."""

from collections.abc import Mapping, Sequence
from typing import Any

from busplan.report.lines import BLANK, Line, plural
from busplan.report.verdict_sentences import period


def profiles_lines(rows: Sequence[Mapping[str, Any]]) -> list[Line]:
    """Name, key figures and description of each profile."""
    lines: list[Line] = []
    for row in rows:
        figures = f"{plural(row['nodes'], 'node')} at {period(row['period_us'])}, {row['timing_model']} model decides"
        lines.extend((Line(f"{row['name']}: {figures}", "heading"), Line(row["description"]), BLANK))
    return lines[:-1]
