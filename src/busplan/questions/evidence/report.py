"""Answers of `busplan evidence`, and of `busplan paper`, the paper's part of it."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from busplan.buses import kind_named
from busplan.forms.blocks import (
    Block,
    Cell,
    Chapter,
    JsonDocument,
    Record,
    Report,
    Sentence,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
)
from busplan.questions.evidence import KindEvidence
from busplan.questions.evidence.rows import Comparison, EvidenceSection
from busplan.questions.words.documents import document, parts_by
from busplan.questions.words.sentences import evidence_sentence

_DIGITS: Final = 5
"""Significant digits of a published figure or a quotient of two."""
_DECIMALS: Final = {"mm": 6, "1": 4, "bytes": 0, "bits": 0}
"""Decimals by unit; contour errors in mm are micrometres, so that they need six."""
_MICROSECOND_DECIMALS: Final = 3
_RESIDUAL_DECIMALS: Final = 4


def paper_report(sections: Sequence[EvidenceSection]) -> Report:
    """Report of `paper`: one row for each published figure, one group of columns for each method.

    Parameters
    ----------
    sections
        The published tables and passages.
    """
    return Report(
        Sentence(("Published figures beside computed ones",)),
        lambda: tuple(_sections(sections)),
        partial(paper_document, sections),
        lambda: paper_records(sections),
    )


def paper_records(sections: Sequence[EvidenceSection]) -> list[Record]:
    """One row for each published figure and method."""
    return [
        {
            **comparison._asdict(),
            "residual": comparison.residual,
            "relative_residual": comparison.relative_residual,
        }
        for section in sections
        for comparison in section.comparisons
    ]


def paper_document(sections: Sequence[EvidenceSection]) -> JsonDocument:
    """Document of `busplan paper --format json`."""
    return document(
        "paper",
        notes={section.title: section.note for section in sections},
        figures=paper_records(sections),
    )


def evidence_report(kinds: Sequence[KindEvidence]) -> Report:
    """Report of `evidence`: kind by kind, and which have none.

    Parameters
    ----------
    kinds
        What is known of each kind.
    """
    return Report(
        Sentence(("What others have published or measured, beside computed figures",)),
        lambda: tuple(_kinds(kinds)),
        partial(evidence_document, kinds),
        lambda: evidence_records(kinds),
    )


def evidence_records(kinds: Sequence[KindEvidence]) -> list[Record]:
    """One row for each figure and method, with its kind in front."""
    return [
        {"kind": one.kind, "data": section.data, **record}
        for one in kinds
        for section in one.sections
        for record in paper_records([section])
    ]


def evidence_document(kinds: Sequence[KindEvidence]) -> JsonDocument:
    """Document of `busplan evidence --format json`."""
    return document(
        "evidence",
        kinds=[one.kind for one in kinds],
        without=[one.kind for one in kinds if not one.sections],
        set_by=[{"kind": one.kind, **part} for one in kinds for part in parts_by(one.tested.set_by)],
        tested=[{"kind": one.kind, **part} for one in kinds for part in parts_by(one.tested.parts)],
        not_tested=[{"kind": one.kind, "part": part} for one in kinds for part in one.tested.untested],
        notes={section.title: section.note for one in kinds for section in one.sections},
        figures=evidence_records(kinds),
    )


def _kinds(kinds: Sequence[KindEvidence]) -> Iterator[Block]:
    for one in kinds:
        yield from evidence_sentence(kind_named(one.kind))
        yield from _sections(one.sections)


def _sections(sections: Sequence[EvidenceSection]) -> Iterator[Chapter]:
    for section in sections:
        yield Chapter(Sentence((section.title,)), (Sentence((section.note,)), _table(section.comparisons)))


def _table(comparisons: Sequence[Comparison]) -> Table:
    methods = list(dict.fromkeys(one.method for one in comparisons))
    is_weighed = any(one.uncertainty is not None for one in comparisons)
    rows: dict[str, dict[str, Comparison]] = {}
    for one in comparisons:
        rows.setdefault(one.quantity, {})[one.method] = one
    columns = (
        *(
            TableColumn("figure", kind="words", wraps=True),
            TableColumn("unit", kind="words"),
            TableColumn("published"),
            TableColumn("grade", kind="words"),
        ),
        *(
            column
            for method in methods
            for column in (
                TableColumn(method),
                *((TableColumn("U"),) if is_weighed else ()),
                TableColumn("residual"),
                TableColumn("", "%", rank=1),
            )
        ),
    )
    each = (_row(by_method, methods, is_weighed=is_weighed) for by_method in rows.values())
    return Table(columns, tuple(each), heads=3)


def _row(by_method: dict[str, Comparison], methods: Sequence[str], *, is_weighed: bool) -> TableRow:
    first = next(iter(by_method.values()))
    published = ShownValue(first.published, "published", first.unit, digits=_DIGITS)
    compared = (cell for method in methods for cell in _compared(by_method.get(method), is_weighed=is_weighed))
    return TableRow((first.quantity, first.unit, published, first.grade or "", *compared))


def _compared(one: Comparison | None, *, is_weighed: bool) -> tuple[Cell, ...]:
    if one is None:
        return ("",) * (3 + is_weighed)
    decimals = _DECIMALS.get(one.unit, _MICROSECOND_DECIMALS)
    doubt = ShownValue(one.uncertainty, "uncertainty", one.unit, decimals, fixed=True)
    # Smaller values are rounding of the printed figure.
    return (
        ShownValue(one.computed, "computed", one.unit, decimals, fixed=True),
        *((doubt,) if is_weighed else ()),
        ShownValue(one.residual, "residual", one.unit, max(decimals, _RESIDUAL_DECIMALS), signed=True, fixed=True),
        ShownValue(one.relative_residual, "relative_residual", "%", 1, signed=True, fixed=True),
    )
