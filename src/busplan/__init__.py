"""busplan: does this motion network fit its period, and how many axes can it carry?

Each function takes a profile (a `Profile`, a path or a shipped name) and gives a frozen answer: figures as typed
attributes, the report as text, the document of `--format json` by `to_dict()`. Errors are `BusplanError`s.

Examples
--------
>>> import busplan
>>> busplan.capacity("paper-4ms")
<CapacityAnswer: paper-4ms IEEE 1394, 2 nodes, 8 axes, 4 ms FITS>
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "1.0.0"

__all__ = [
    "BusplanError",
    "CalibrateAnswer",
    "CapacityAnswer",
    "CheckAnswer",
    "CircleTestAnswer",
    "CompareAnswer",
    "DiffAnswer",
    "EmulateAnswer",
    "EvidenceAnswer",
    "ExplainAnswer",
    "ExploreAnswer",
    "ImportAnswer",
    "LatencyAnswer",
    "MapAnswer",
    "MeasuredAnswer",
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
    "emulate",
    "evidence",
    "explain",
    "explore",
    "import_profile",
    "latency",
    "load_profile",
    "map_",
    "measured",
    "plan",
    "report",
    "sweep",
    "timeline",
]

if TYPE_CHECKING:
    from busplan.errors import BusplanError
    from busplan.gate.check import CheckAnswer, check
    from busplan.questions.base.arguments import load_profile
    from busplan.questions.calibrate import CalibrateAnswer, calibrate
    from busplan.questions.capacity import CapacityAnswer, capacity
    from busplan.questions.circle import CircleTestAnswer, circle_test
    from busplan.questions.compare import CompareAnswer, compare
    from busplan.questions.diff import DiffAnswer, diff
    from busplan.questions.emulate import EmulateAnswer, emulate
    from busplan.questions.evidence import EvidenceAnswer, evidence
    from busplan.questions.explain import ExplainAnswer, explain
    from busplan.questions.explore import ExploreAnswer, explore
    from busplan.questions.import_ import ImportAnswer, import_profile
    from busplan.questions.latency import LatencyAnswer, latency
    from busplan.questions.map import MapAnswer, map_
    from busplan.questions.measured import MeasuredAnswer, measured
    from busplan.questions.plan import PlanAnswer, plan
    from busplan.questions.report import ReportAnswer, report
    from busplan.questions.sweep import SweepAnswer, sweep
    from busplan.questions.timeline import TimelineAnswer, timeline
    from busplan.sections.profile import Profile
else:
    # Loaded at first use, because the command line imports this package, too. Type checkers do not see this, so that
    # they report unknown names.
    _HOMES = {
        "BusplanError": "busplan.errors",
        "Profile": "busplan.sections.profile",
        "load_profile": "busplan.questions.base.arguments",
        "check": "busplan.gate.check",
        "CheckAnswer": "busplan.gate.check",
        "import_profile": "busplan.questions.import_",
        "ImportAnswer": "busplan.questions.import_",
    }
    """Module of each name that the rule below does not find."""

    def __getattr__(name: str) -> object:
        if name not in __all__:
            did_you_mean = import_module("busplan.english").did_you_mean
            # A function for a function, a class for a class.
            alike = [one for one in __all__ if one.islower() == name.islower()]
            words = filter(None, (f"module {__name__!r} has no attribute {name!r}", did_you_mean(name, alike)))
            raise AttributeError("; ".join(words))
        # `circle_test` and `CircleTestAnswer` are in module `circle`, `map_` and `MapAnswer` in `map`.
        question = name.removesuffix("Answer").lower().replace("_", "").removesuffix("test")
        home = _HOMES.get(name, f"busplan.questions.{question}")
        globals()[name] = value = getattr(import_module(home), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
