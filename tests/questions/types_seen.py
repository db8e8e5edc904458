"""What a type checker knows of the interface: mypy reads this module in strict mode, and nothing runs it."""

from typing import Any, assert_type

from numpy.typing import NDArray

import busplan
from busplan.gate.report import Located
from busplan.questions.compare import MachineOnKind, NotOnKind
from busplan.questions.diff import KeyDifference
from busplan.questions.explain.derivation import Step
from busplan.questions.fit.figures import CapacityFigures, FitFigures
from busplan.questions.map import Cell
from busplan.questions.plan import Option


def types_through_the_lazy_names() -> None:
    assert_type(busplan.load_profile("paper-4ms"), busplan.Profile)
    assert_type(busplan.load_profile("paper-4ms").cycle.period_us, float)
    assert_type(busplan.capacity("paper-4ms"), busplan.CapacityAnswer)
    assert_type(busplan.capacity("paper-4ms").results, tuple[CapacityFigures, ...])
    assert_type(busplan.capacity("paper-4ms").results[0].max_axes, int | None)
    assert_type(busplan.capacity("paper-4ms").results[0].binding_term, str)
    assert_type(busplan.capacity("paper-4ms").figures, tuple[FitFigures, ...])
    assert_type(busplan.capacity("paper-4ms").verdicts[0].deciding.margin_us, float)
    assert_type(busplan.capacity("paper-4ms").to_dict(), dict[str, Any])
    assert_type(busplan.latency("paper-4ms").transactions[0].phases["latency_us"], float | None)
    assert_type(busplan.timeline("paper-4ms").events[0].start_us, float)
    assert_type(busplan.plan("paper-4ms").recommended, Option | None)
    assert_type(busplan.check("paper-4ms", circle=False).findings, tuple[Located, ...])
    assert_type(busplan.sweep("paper-4ms", vary={"bus.nodes": [1]})["max_axes"], NDArray[Any])
    assert_type(busplan.map_("paper-4ms").design, Cell | None)
    assert_type(busplan.compare("paper-4ms").kinds, tuple[MachineOnKind | NotOnKind, ...])
    assert_type(busplan.diff("paper-4ms", "paper-1ms").keys, tuple[KeyDifference, ...])
    assert_type(busplan.explain("paper-4ms", "margin_us").derivations[0].steps, tuple[Step, ...])
    assert_type(busplan.calibrate("paper-two-node", [(4, 48.7)]).payloads[0].execution_us, float)
    assert_type(busplan.calibrate("paper-two-node", {"payload_bytes": [4], "latency_us": [48.7]}).source, str)
    assert_type(busplan.report("sercos2-servo-8", circle=False).html, str)
    assert_type(busplan.report([busplan.load_profile("dvrk"), "dvrk"], circle=False), busplan.ReportAnswer)
    assert_type(busplan.capacity("paper-4ms", period_us=500, timing_model="paper"), busplan.CapacityAnswer)
    assert_type(busplan.circle_test("paper-4ms", period_us=[100]).results[0].max_contour_error_mm, float | None)


def types_that_are_refused() -> None:
    busplan.capacity(4)  # type: ignore[arg-type]
    busplan.capacity("paper-4ms", [4000.0])  # type: ignore[call-arg]
    busplan.capacity("paper-4ms", timing_model=[1])  # type: ignore[list-item]
    busplan.diff("paper-4ms", 5)  # type: ignore[arg-type]
    busplan.calibrate("paper-4ms", 5)  # type: ignore[arg-type]
    busplan.capacity("paper-4ms").profile = busplan.load_profile("paper-1ms")  # type: ignore[misc]
