"""Every figure that an answer shows in a cell or beside its name is a value of its key in the document."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import pytest

import busplan
from busplan.forms.blocks import Report, Sentence, ShownValue, Table

ROUGH = {"circle.radius_mm": 25.0, "circle.ramp_periods": 20, "tolerance.max_contour_error_mm": 0.001}
SPREAD = [(4, 50.0 if index % 4 else 90.0 + index, "write") for index in range(60)]


@cache
def evidence() -> busplan.EvidenceAnswer:
    return busplan.evidence("ieee1394")


ANSWERS: Mapping[str, tuple[Callable[[], Any], int]] = {
    # Tables of 44 figures, two periods under two models.
    "capacity": (lambda: busplan.capacity("paper-1ms", period_us=[4000.0, 600.0]), 100),
    "sensitivity": (lambda: busplan.capacity("paper-1ms", sensitivity=True), 50),
    "latency": (lambda: busplan.latency("paper-1ms", payload_bytes=[4, 16]), 2 * 4 * 21 - 1),
    "circle": (
        lambda: busplan.circle_test(
            busplan.load_profile("paper-4ms", changes=ROUGH), period_us=[4000.0, 100.0], contributions=True
        ),
        2 * 18,
    ),
    "timeline": (lambda: busplan.timeline(busplan.load_profile("paper-4ms", changes={"cycle.period_us": 300.0})), 15),
    "calibrate": (lambda: busplan.calibrate("paper-two-node", SPREAD, source="m.csv"), 6),
    "evidence": (evidence, 100),
    "report": (lambda: busplan.report("paper-4ms", circle=False), 200),
}


def values_by_key(document: Any, found: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """All values of a document by their key; a record of one figure says which one it is."""
    if isinstance(document, dict):
        for key, value in document.items():
            found.setdefault(key, []).append(value)
            values_by_key(value, found)
        for name in ("figure", "key"):
            if isinstance(document.get(name), str):
                found.setdefault(document[name], []).extend(document.values())
    elif isinstance(document, list | tuple):
        for value in document:
            values_by_key(value, found)
    return found


def outside_sentences(blocks: object, values_in: Callable[[object], Iterator[ShownValue]]) -> Iterator[ShownValue]:
    """The figures in cells and beside their names; other sentences also count things, and say what is short."""
    if isinstance(blocks, Table):
        yield from values_in(blocks.rows)
    elif isinstance(blocks, ShownValue):
        yield blocks
    elif isinstance(blocks, tuple) and not isinstance(blocks, Sentence):
        for block in blocks:
            yield from outside_sentences(block, values_in)


@pytest.mark.parametrize("name", ANSWERS)
def test_every_figure_is_one_of_the_document(name: str, values_in: Callable[[object], Iterator[ShownValue]]) -> None:
    ask, least = ANSWERS[name]
    report: Report = ask().report()
    by_key = values_by_key(report.document, {})
    shown = [value for value in outside_sentences(tuple(report.blocks), values_in) if value.key in by_key]
    assert [value for value in shown if value.value not in by_key[value.key]] == []
    assert len(shown) > least


def test_every_comparison_of_the_evidence_stands_once(values_in: Callable[[object], Iterator[ShownValue]]) -> None:
    answer = evidence()
    shown = [value.value for value in values_in(tuple(answer.report().blocks)) if value.key == "computed"]
    assert Counter(shown) == Counter(row["computed"] for row in answer.to_dict()["figures"])
