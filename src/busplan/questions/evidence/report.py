"""Report of `evidence`, and of `paper`, its part on the paper."""

from collections.abc import Iterator, Sequence
from typing import Final

from busplan.forms import blocks
from busplan.questions.base.sentences import checked_against, document, parts_by
from busplan.questions.evidence import Comparison, KindEvidence

_DIGITS: Final = 5
"""Significant digits of a published figure or a quotient of two."""
_DECIMALS: Final = {"mm": 6, "1": 4, "bytes": 0, "bits": 0}
"""Decimals by unit. Contour errors in mm are micrometres, so they need six."""
_MICROSECOND_DECIMALS: Final = 3
_RESIDUAL_DECIMALS: Final = 4


def evidence_report(kinds: Sequence[KindEvidence], *, paper: bool = False) -> blocks.Report:
    """Report of `evidence`, kind by kind; the report of `paper` has only the tables of its one kind."""
    records = _records(kinds, paper=paper)
    title = "Published figures and" if paper else "Published or measured figures and"
    return blocks.Report(
        blocks.Sentence((f"{title} computed {'ones' if paper else 'figures'}",)),
        tuple(_blocks(kinds, paper=paper)),
        _document(kinds, records, paper=paper),
        records,
    )


def _records(kinds: Sequence[KindEvidence], *, paper: bool) -> list[blocks.Record]:
    """Rows of each figure and method; those of `evidence` begin with kind and data file."""
    return [
        {
            **({} if paper else {"kind": kind.kind, "data": section.data}),
            **comparison._asdict(),
            "residual": comparison.residual,
            "relative_residual": comparison.relative_residual,
        }
        for kind in kinds
        for section in kind.sections
        for comparison in section.comparisons
    ]


def _document(kinds: Sequence[KindEvidence], records: list[blocks.Record], *, paper: bool) -> blocks.JsonDocument:
    parts: blocks.JsonDocument = {
        "kinds": [kind.kind for kind in kinds],
        "without": [kind.kind for kind in kinds if not kind.sections],
        "set_by": [{"kind": kind.kind, **part} for kind in kinds for part in parts_by(kind.tested.set_by)],
        "tested": [{"kind": kind.kind, **part} for kind in kinds for part in parts_by(kind.tested.parts)],
        "not_tested": [{"kind": kind.kind, "part": part} for kind in kinds for part in kind.tested.untested],
    }
    return document(
        "paper" if paper else "evidence",
        **({} if paper else parts),
        notes={section.title: section.note for kind in kinds for section in kind.sections},
        figures=records,
    )


def _blocks(kinds: Sequence[KindEvidence], *, paper: bool) -> Iterator[blocks.Block]:
    for kind in kinds:
        if not paper:
            yield blocks.Sentence(
                (f"{kind.title} (kind {kind.kind}): checked against {checked_against(kind.tested)}.",)
            )
        chapters = tuple(
            blocks.Chapter(
                blocks.Sentence((section.title,)), (blocks.Sentence((section.note,)), _table(section.comparisons))
            )
            for section in kind.sections
        )
        if chapters:
            yield blocks.Detail(chapters, "each figure", () if len(kinds) > 1 else (_summary(kind),))


def _summary(kind: KindEvidence) -> blocks.Table:
    """Table of the deviations of each section's computed figures from the published ones, by method."""
    rows = []
    for section in kind.sections:
        by_method: dict[str, list[Comparison]] = {}
        for comparison in section.comparisons:
            by_method.setdefault(comparison.method, []).append(comparison)
        for number, (method, of_method) in enumerate(by_method.items()):
            shares = [one.relative_residual for one in of_method if one.relative_residual is not None]
            ends = (
                blocks.ShownValue(end, "relative_residual", "%", 1, signed=True, fixed=True)
                for end in ((min(shares), max(shares)) if shares else (None, None))
            )
            title = section.title if number == 0 else ""
            rows.append(blocks.TableRow((title, method, str(len(of_method)), *ends)))
    columns = (
        blocks.TableColumn("published", kind="words", wraps=True),
        blocks.TableColumn("computed by", kind="words", wraps=True),
        blocks.TableColumn("figures"),
        blocks.TableColumn("least", "%", group="residual"),
        blocks.TableColumn("most", "%", group="residual"),
    )
    return blocks.Table(columns, tuple(rows), blocks.Sentence(("Deviation of computed from published figures",)))


def _table(comparisons: Sequence[Comparison]) -> blocks.Table:
    methods = list(dict.fromkeys(comparison.method for comparison in comparisons))
    is_weighed = any(comparison.uncertainty is not None for comparison in comparisons)
    rows: dict[str, dict[str, Comparison]] = {}
    for comparison in comparisons:
        rows.setdefault(comparison.quantity, {})[comparison.method] = comparison
    columns = (
        blocks.TableColumn("figure", kind="words", wraps=True),
        blocks.TableColumn("unit", kind="words"),
        blocks.TableColumn("published"),
        blocks.TableColumn("grade", kind="words"),
        *(
            column
            for method in methods
            for column in (
                blocks.TableColumn(method),
                *((blocks.TableColumn("U"),) if is_weighed else ()),
                blocks.TableColumn("residual"),
                blocks.TableColumn("", "%", rank=1),
            )
        ),
    )
    table_rows = (_row(by_method, methods, is_weighed=is_weighed) for by_method in rows.values())
    return blocks.Table(columns, tuple(table_rows), heads=3)


def _row(by_method: dict[str, Comparison], methods: Sequence[str], *, is_weighed: bool) -> blocks.TableRow:
    first = next(iter(by_method.values()))
    published = blocks.ShownValue(first.published, "published", first.unit, digits=_DIGITS)
    compared = (cell for method in methods for cell in _compared(by_method.get(method), is_weighed=is_weighed))
    return blocks.TableRow((first.quantity, first.unit, published, first.grade or "", *compared))


def _compared(comparison: Comparison | None, *, is_weighed: bool) -> tuple[blocks.Cell, ...]:
    if comparison is None:
        return ("",) * (3 + is_weighed)
    decimals = _DECIMALS.get(comparison.unit, _MICROSECOND_DECIMALS)
    doubt = blocks.ShownValue(comparison.uncertainty, "uncertainty", comparison.unit, decimals, fixed=True)
    # Smaller values are rounding of the printed figure.
    return (
        blocks.ShownValue(comparison.computed, "computed", comparison.unit, decimals, fixed=True),
        *((doubt,) if is_weighed else ()),
        blocks.ShownValue(
            comparison.residual, "residual", comparison.unit, max(decimals, _RESIDUAL_DECIMALS), signed=True, fixed=True
        ),
        blocks.ShownValue(comparison.relative_residual, "relative_residual", "%", 1, signed=True, fixed=True),
    )
