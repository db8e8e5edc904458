"""A recorded figure beside its plan: within, outside, or in between, where nobody can tell; and where it shows."""

from typing import Any

import numpy as np
import pytest

from busplan.buses.rule import RecordedFigure, day_of
from busplan.recordings.statistics import Events

PLAN = RecordedFigure("figure", "us", 10.0, None, 2.0, "at most", 100)


@pytest.mark.parametrize(
    ("changes", "verdicts"),
    # U is 2, and 3.29 of its half are a surplus that errors have in one of a thousand.
    [
        ({}, {9.0: "within", 10.0: "within", 10.5: "not shown", 13.28: "not shown", 13.3: "outside"}),
        ({"is_mean": True}, {11.99: "within", 12.01: "not shown", 13.28: "not shown", 13.3: "outside"}),
        ({"sense": "equal"}, {8.01: "within", 7.99: "not shown", 6.72: "not shown", 6.7: "outside", 13.3: "outside"}),
        ({"sense": "at least"}, {15.0: "within", 10.0: "within", 9.5: "not shown", 6.7: "outside"}),
        ({"uncertainty": None}, {10.0: "within", 10.0001: "outside"}),
        ({"sense": "shown"}, {99.0: None}),
        ({"planned": None}, {99.0: None}),
        ({"hidden": "dropped"}, {9.0: "not shown"}),
    ],
)
def test_a_verdict_is_that_of_the_surplus_and_its_doubt(changes: dict[str, Any], verdicts: dict[float, str]) -> None:
    figures = {us: PLAN._replace(**changes, recorded=us) for us in verdicts}
    assert {us: figure.verdict for us, figure in figures.items()} == verdicts


@pytest.mark.parametrize(
    ("figure", "values", "first", "worst"),
    # Events by their order in time: the first beyond what may be error, and the farthest.
    [
        (PLAN._replace(recorded=15.0), [9, 12, 14, 15, 15], (0.3, 13), (0.4, 14)),
        (PLAN._replace(recorded=12.0), [9, 11, 12], (0.2, 12), (0.3, 13)),
        (PLAN._replace(recorded=10.0), [9, 10, 8], (None, None), (0.2, 12)),
        (PLAN._replace(sense="at least", recorded=5.0), [12, 5, 6], (0.2, 12), (0.2, 12)),
        (PLAN._replace(sense="equal", recorded=5.0), [12, 5, 4], (0.2, 12), (0.3, 13)),
        # A mean of many may be outside though no event is: the worst stands for them.
        (PLAN._replace(is_mean=True, recorded=13.5), [13, 13.2], (0.2, 12), (0.2, 12)),
        # What is counted counts from the first on.
        (PLAN._replace(unit="1", planned=2.0, uncertainty=None, recorded=3.0), [1, 1, 1], (0.1, 11), (0.1, 11)),
        (PLAN._replace(recorded=15.0), [], (None, None), (None, None)),
    ],
)
def test_a_figure_has_the_moments_of_its_first_and_its_worst_event(
    figure: RecordedFigure, values: list[float], first: tuple[float, int], worst: tuple[float, int]
) -> None:
    places = np.arange(1, len(values) + 1)[::-1]
    found = figure.located(Events(np.array(values, dtype=float)[::-1], places / 10, 10 + places))
    assert (found.first_s, found.first_frame) == first
    assert (found.worst_s, found.worst_frame) == worst
    assert found.first_words == ("" if first[1] is None else f"first at {first[0]:.6f} s, frame {first[1]}")
    assert found.worst_words == (
        "" if worst in (first, (None, None)) else f"worst at {worst[0]:.6f} s, frame {worst[1]}"
    )


def test_a_stamp_has_a_day_where_its_clock_counts_from_1970() -> None:
    year_ns = 365 * 86_400 * 10**9
    days = [day_of(time_ns) for time_ns in (10 * year_ns - 1, 10 * year_ns, 2**63 - 1, 2**63)]
    assert days == ["", "1979-12-30", "2262-04-11", ""]
