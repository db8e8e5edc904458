"""What a type checker knows of the interface: mypy reads this module in strict mode, and it runs."""

from typing import Any, assert_type

from numpy.typing import NDArray

import busplan
from busplan.analysis.capacity.figures import CapacityFigures
from busplan.analysis.map.cells import Cell
from busplan.analysis.planning.option import Option
from busplan.rules.report import Located


def test_the_types_are_seen_through_the_lazy_names() -> None:
    assert_type(busplan.load_profile("paper-4ms"), busplan.Profile)
    assert_type(busplan.load_profile("paper-4ms").cycle.period_us, float)
    assert_type(busplan.capacity("paper-4ms"), busplan.CapacityAnswer)
    assert_type(busplan.capacity("paper-4ms").results, tuple[CapacityFigures, ...])
    assert_type(busplan.capacity("paper-4ms").results[0].max_axes, int | None)
    assert_type(busplan.capacity("paper-4ms").results[0].binding_term, str)
    assert_type(busplan.capacity("paper-4ms").to_dict(), dict[str, Any])
    assert_type(busplan.latency("paper-4ms").transactions[0].phases.latency_us, Any)
    assert_type(busplan.timeline("paper-4ms").events[0].start_us, float)
    assert_type(busplan.plan("paper-4ms", with_circle=False).recommended, Option | None)
    assert_type(busplan.check("paper-4ms", with_circle=False).findings, tuple[Located, ...])
    assert_type(busplan.sweep("paper-4ms", vary={"bus.nodes": [1]})["max_axes"], NDArray[Any])
    assert_type(busplan.trade_off("paper-4ms").own, Cell | None)
    assert_type(busplan.circle_test("paper-4ms", periods_us=[100]).results[0].max_contour_error_mm, float | None)


def test_other_types_are_seen_too() -> None:
    def never() -> None:
        busplan.capacity(4)  # type: ignore[arg-type]
        busplan.capacity("paper-4ms", [4000.0])  # type: ignore[call-arg]
        busplan.capacity("paper-4ms", timing_models=[1])  # type: ignore[list-item]
        busplan.capacity("paper-4ms").profile = busplan.load_profile("paper-1ms")  # type: ignore[misc]

    assert callable(never)
