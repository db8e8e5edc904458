"""What every answer can do: it is frozen, shows itself, and can be pickled."""

import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import pytest

import busplan

ANSWERS: dict[str, Callable[[busplan.Profile], Any]] = {
    "latency": busplan.latency,
    "capacity": busplan.capacity,
    "circle_test": busplan.circle_test,
    "plan": busplan.plan,
    "timeline": busplan.timeline,
    "check": lambda _profile: busplan.check("paper-1ms"),
    "sweep": lambda profile: busplan.sweep(profile, vary={"bus.gap_count": [63, "optimal"], "bus.nodes": "1:3"}),
    "map": busplan.map_,
    "compare": lambda profile: busplan.compare(profile, buses=["ieee1394", "can"]),
    "diff": lambda profile: busplan.diff(profile, "paper-optimal-gap"),
    "explain": lambda profile: busplan.explain(profile, "margin_us"),
    "explain all": busplan.explain,
    "calibrate": lambda profile: busplan.calibrate(profile, "table-1.csv"),
    "report": lambda profile: busplan.report(profile, circle=False),
}


@cache
def answer_of(name: str) -> Any:
    return ANSWERS[name](busplan.load_profile("paper-1ms"))


@pytest.fixture(params=ANSWERS)
def answer(request: pytest.FixtureRequest) -> Any:
    return answer_of(request.param)


def test_nothing_of_an_answer_can_be_set(answer: Any) -> None:
    names = [name for name in dir(answer) if not name.startswith("_")]
    assert {"to_dict", "to_json"} < set(names)
    for name in [*names, "new"]:
        with pytest.raises((AttributeError, TypeError)):
            setattr(answer, name, None)
    with pytest.raises((AttributeError, TypeError)):
        del answer.to_dict


def test_a_changed_document_changes_no_answer(answer: Any) -> None:
    before = answer.to_json()
    document = answer.to_dict()
    for value in document.values():
        if isinstance(value, list | dict):
            value.clear()
    assert answer.to_json() == before
    assert answer.to_dict() != document


def test_an_answer_can_be_pickled(answer: Any) -> None:
    copy = pickle.loads(pickle.dumps(answer))
    assert (type(copy), copy.to_json(), str(copy)) == (type(answer), answer.to_json(), str(answer))


def test_records_are_frozen() -> None:
    found = busplan.capacity("paper-4ms")
    with pytest.raises(AttributeError):
        found.results[0].max_axes = 99  # type: ignore[misc]
    with pytest.raises(ValueError, match="frozen"):
        found.profile.bus.nodes = 99  # type: ignore[misc]


def test_figures_of_one_kind_of_bus_are_plain_numbers() -> None:
    phases = busplan.latency("paper-4ms").transactions[-1].phases
    assert {type(value) for value in phases.values()} <= {int, float}


def test_the_same_question_has_the_same_answer() -> None:
    assert busplan.capacity("paper-4ms") == busplan.capacity("paper-4ms")
    assert busplan.capacity("paper-4ms") != busplan.capacity("paper-1ms")


HEADLINES = {
    "latency": "<LatencyAnswer: paper-1ms: farthest of 2 nodes, 2 hops, gap count 63>",
    # 263.320 us of 500 us by the standard, a bias of 8 * 0.827 us; the paper says 207.117 us.
    "capacity": "<CapacityAnswer: paper-1ms IEEE 1394, 2 nodes, 8 axes, 1 ms FITS>",
    "circle_test": "<CircleTestAnswer: paper-1ms at 1 ms and 10000 mm/min: the circle holds, mean contour error "
    "4.871 um of 6 um, largest contour error 22.085 um of 25 um.>",
    "plan": "<PlanAnswer: paper-1ms with 2 nodes (8 axes) at 1 ms: nothing to change; it fits with a corrected margin "
    "of 230 us +/- 6 us.>",
    "timeline": "<TimelineAnswer: paper-1ms at 1 ms: fits by the standard model; used 270 us of the 500 that the bus "
    "may use, 54 %; free 230 us, +/- 6.>",
    "check": "<CheckAnswer: checked 1 profile: 0 errors, 0 warnings; 1 finding suppressed>",
    "sweep": "<SweepAnswer: paper-1ms: 6 points; 6 shown to fit (standard model), 6 fit by the paper model.>",
    "map": "<MapAnswer: paper-1ms: 57 of 195 settings are shown to fit. This design (8 axes, period 1 ms): fits.>",
    "compare": "<CompareAnswer: paper-1ms at 1 ms: fits on IEEE 1394, its own bus; with assumed values of other "
    "buses, shown to fit on none.>",
    "diff": "<DiffAnswer: paper-1ms (A) fits, paper-optimal-gap (B) fits; B is better in 16 figures: corrected margin, "
    "safe nodes, safe axes, period with enough time and 12 more.>",
    "explain": "<ExplainAnswer: margin_us of paper-1ms at 1 ms, standard model: 236.6798 us>",
    "explain all": "<ExplainAnswer: paper-1ms: 32 assumptions behind its verdict>",
    "calibrate": "<CalibrateAnswer: paper-1ms: T_exec is the median at each payload, of 8 measurements at 8 payloads, "
    "table-1.csv.>",
    "report": "<ReportAnswer: paper-1ms: fits>",
}


@pytest.mark.parametrize("name", ANSWERS)
def test_it_shows_its_verdict(name: str) -> None:
    assert repr(answer_of(name)) == HEADLINES[name]


def test_a_notebook_draws_a_map() -> None:
    found = busplan.map_(busplan.load_profile("paper-4ms", changes={"name": "<b>&x"}))
    drawn = found._repr_svg_() or ""
    assert drawn.startswith("<svg ")
    assert "&lt;b&gt;&amp;x" in drawn
    assert "<b>" not in drawn
    assert found.design is not None
    assert (found.design.state, len(found.cells), found.regions[0].cells) == ("fits", 288, 104)


def test_circles_of_a_map_run_on_any_executor_and_are_counted() -> None:
    along: dict[str, Any] = {"x": {"axes": [4, 8]}, "y": {"cycle.period_us": [1000, 4000]}, "circle": True}
    done: list[tuple[int, int]] = []
    with ThreadPoolExecutor(2) as executor:
        found = busplan.map_("paper-4ms", **along, executor=executor, progress=lambda *parts: done.append(parts))
    assert found == busplan.map_("paper-4ms", **along)
    assert done[-1] == (4, 4)
