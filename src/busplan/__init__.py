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
    }
    """Where a name is that is neither a question nor its answer."""

    def __getattr__(name: str) -> object:
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        # `circle_test` and `CircleTestAnswer` are in module `circle`, `map_` and `MapAnswer` in `map`.
        question = name.removesuffix("Answer").lower().replace("_", "").removesuffix("test")
        home = _HOMES.get(name, f"busplan.api.{question}")
        globals()[name] = value = getattr(import_module(home), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
