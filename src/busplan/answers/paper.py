"""`busplan paper` for people."""

from collections.abc import Sequence

from busplan.buses.published import Comparison, PaperSection
from busplan.forms.lines import BLANK, Line, table


def paper_lines(sections: Sequence[PaperSection]) -> list[Line]:
    """One table a section: published figures down, the ways to compute them across."""
    lines: list[Line] = []
    for section in sections:
        lines.extend((Line(section.title, "heading"), Line(section.note), *_table(section), BLANK))
    return lines[:-1]


def _table(section: PaperSection) -> list[Line]:
    methods = list(dict.fromkeys(one.method for one in section.comparisons))
    rows: dict[str, dict[str, Comparison]] = {}
    for one in section.comparisons:
        rows.setdefault(one.quantity, {})[one.method] = one
    return table(
        ["figure", "unit", "published", *(heading for method in methods for heading in (method, "residual", "%"))],
        (_row(quantity, by_method, methods) for quantity, by_method in rows.items()),
        left=2,
    )


def _row(quantity: str, by_method: dict[str, Comparison], methods: Sequence[str]) -> list[str]:
    first = next(iter(by_method.values()))
    published = "-" if first.published is None else f"{first.published:.5g}"
    return [quantity, first.unit, published, *(cell for method in methods for cell in _compared(by_method.get(method)))]


def _compared(one: Comparison | None) -> tuple[str, str, str]:
    if one is None:
        return "", "", ""
    # Contour errors are micrometres: they need more digits than microseconds do.
    digits = {"mm": 6, "1": 4}.get(one.unit, 3)
    computed = f"{one.computed:.{digits}f}"
    if one.residual is None or one.relative_residual is None:
        return computed, "-", "-"
    return computed, f"{one.residual:+.{max(digits, 4)}f}", f"{one.relative_residual * 100:+.1f}"
