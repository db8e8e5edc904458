"""busplan: does this motion network fit its period, and how many axes can it carry?

Each function takes a profile (a `Profile`, a path or a shipped name) and gives a frozen answer: figures as typed
attributes, the report as text, the document of `--format json` by `to_dict()`. Errors are `BusplanError`s.

Examples
--------
>>> import busplan
>>> busplan.capacity("paper-4ms")  # doctest: +ELLIPSIS
<CapacityAnswer: paper-4ms at 4 ms: fits. Margin 1730.064 us +/- 6.311 us of 2000.000 us, less a bias of 6.616 us...>
"""

from importlib import import_module
from typing import TYPE_CHECKING
from warnings import warn

__version__ = "0.1.0"

__all__ = [
    "BusplanError",
    "CalibrateAnswer",
    "CapacityAnswer",
    "CheckAnswer",
    "CircleTestAnswer",
    "CompareAnswer",
    "DiffAnswer",
    "EvidenceAnswer",
    "ExplainAnswer",
    "LatencyAnswer",
    "MapAnswer",
    "PlanAnswer",
    "Profile",
    "ReportAnswer",
    "SweepAnswer",
    "TimelineAnswer",
    "__version__",
    "calibrate",
    "capacity",
    "check",
    "circle_test",
    "compare",
    "diff",
    "evidence",
    "explain",
    "latency",
    "load_profile",
    "map_",
    "plan",
    "report",
    "sweep",
    "timeline",
]

if TYPE_CHECKING:
    from busplan.api.calibrate import CalibrateAnswer, calibrate
    from busplan.api.capacity import CapacityAnswer, capacity
    from busplan.api.check import CheckAnswer, check
    from busplan.api.circle import CircleTestAnswer, circle_test
    from busplan.api.compare import CompareAnswer, compare
    from busplan.api.diff import DiffAnswer, diff
    from busplan.api.evidence import EvidenceAnswer, evidence
    from busplan.api.explain import ExplainAnswer, explain
    from busplan.api.inputs import load_profile
    from busplan.api.latency import LatencyAnswer, latency
    from busplan.api.map import MapAnswer, map_
    from busplan.api.map import TradeOffAnswer as TradeOffAnswer
    from busplan.api.map import trade_off as trade_off
    from busplan.api.plan import PlanAnswer, plan
    from busplan.api.report import ReportAnswer, report
    from busplan.api.sweep import SweepAnswer, sweep
    from busplan.api.timeline import TimelineAnswer, timeline
    from busplan.errors import BusplanError
    from busplan.sections.profile import Profile
else:
    # Loaded at first use, because the command line imports this package, too. Hidden from type checkers, so that they
    # report unknown names.
    _HOMES = {
        "BusplanError": "busplan.errors",
        "Profile": "busplan.sections.profile",
        "load_profile": "busplan.api.inputs",
        "CalibrateAnswer": "busplan.api.calibrate",
        "calibrate": "busplan.api.calibrate",
        "CapacityAnswer": "busplan.api.capacity",
        "capacity": "busplan.api.capacity",
        "CheckAnswer": "busplan.api.check",
        "check": "busplan.api.check",
        "CircleTestAnswer": "busplan.api.circle",
        "circle_test": "busplan.api.circle",
        "CompareAnswer": "busplan.api.compare",
        "compare": "busplan.api.compare",
        "DiffAnswer": "busplan.api.diff",
        "diff": "busplan.api.diff",
        "EvidenceAnswer": "busplan.api.evidence",
        "evidence": "busplan.api.evidence",
        "ExplainAnswer": "busplan.api.explain",
        "explain": "busplan.api.explain",
        "LatencyAnswer": "busplan.api.latency",
        "latency": "busplan.api.latency",
        "MapAnswer": "busplan.api.map",
        "map_": "busplan.api.map",
        "PlanAnswer": "busplan.api.plan",
        "plan": "busplan.api.plan",
        "ReportAnswer": "busplan.api.report",
        "report": "busplan.api.report",
        "SweepAnswer": "busplan.api.sweep",
        "sweep": "busplan.api.sweep",
        "TimelineAnswer": "busplan.api.timeline",
        "timeline": "busplan.api.timeline",
    }
    _RENAMED = {"trade_off": "map_", "TradeOffAnswer": "MapAnswer"}
    """New name by old name, for one release."""

    def __getattr__(name: str) -> object:
        if name in _RENAMED:
            warn(
                f"busplan.{name} is now called busplan.{_RENAMED[name]}; the old name goes with the next release",
                DeprecationWarning,
                stacklevel=2,
            )
            name = _RENAMED[name]
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value = getattr(import_module(_HOMES[name]), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
