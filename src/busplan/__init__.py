"""busplan: does this motion network fit its period, and how many axes can it carry?

Each function takes a profile (a `Profile`, a path or a shipped name) and gives a frozen answer: figures as typed
attributes, the report as text, the document of `--format json` by `to_dict()`. Errors are `BusplanError`s.

Examples
--------
>>> import busplan
>>> busplan.capacity("paper-4ms")
<CapacityAnswer: paper-4ms IEEE 1394, 2 nodes, 8 axes, 4 ms FITS>
"""

TYPE_CHECKING = False
"""That of `typing`, which takes long to load: until `busplan.__main__.main` runs, Ctrl-C shows Python's traceback."""
__version__ = "1.0.0"

__all__ = [
    "BusplanError",
    "CalibrateAnswer",
    "CanFigures",
    "CanMessageFigures",
    "CapacityAnswer",
    "CheckAnswer",
    "CircleTestAnswer",
    "CompareAnswer",
    "DiffAnswer",
    "EmulateAnswer",
    "EthercatFigures",
    "EvidenceAnswer",
    "ExplainAnswer",
    "ExploreAnswer",
    "Ieee1394Figures",
    "ImportAnswer",
    "LatencyAnswer",
    "MapAnswer",
    "MeasuredAnswer",
    "PlanAnswer",
    "PolledFigures",
    "Profile",
    "RecordedAnswer",
    "RecordedTimelineAnswer",
    "ReportAnswer",
    "Sercos2Figures",
    "Sercos3Figures",
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
    "recorded",
    "report",
    "sweep",
    "timeline",
]

if TYPE_CHECKING:
    from busplan.buses.can.equations import CanFigures, CanMessageFigures
    from busplan.buses.ethercat.equations import EthercatFigures
    from busplan.buses.ieee1394.figures import Ieee1394Figures
    from busplan.buses.polled.cycle import PolledFigures
    from busplan.buses.sercos.sercos2 import Sercos2Figures
    from busplan.buses.sercos.sercos3 import Sercos3Figures
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
    from busplan.questions.recorded import RecordedAnswer, recorded
    from busplan.questions.report import ReportAnswer, report
    from busplan.questions.sweep import SweepAnswer, sweep
    from busplan.questions.timeline import RecordedTimelineAnswer, TimelineAnswer, timeline
    from busplan.sections.profile import Profile
else:
    # Loaded at first use, because the command line imports this package, too. Type checkers do not see this, so that
    # they report unknown names.
    _HOMES = {
        "BusplanError": "busplan.errors",
        "Profile": "busplan.sections.profile",
        "load_profile": "busplan.questions.base.arguments",
        "CanFigures": "busplan.buses.can.equations",
        "CanMessageFigures": "busplan.buses.can.equations",
        "EthercatFigures": "busplan.buses.ethercat.equations",
        "Ieee1394Figures": "busplan.buses.ieee1394.figures",
        "PolledFigures": "busplan.buses.polled.cycle",
        "Sercos2Figures": "busplan.buses.sercos.sercos2",
        "Sercos3Figures": "busplan.buses.sercos.sercos3",
        "check": "busplan.gate.check",
        "CheckAnswer": "busplan.gate.check",
        "import_profile": "busplan.questions.import_",
        "ImportAnswer": "busplan.questions.import_",
        "RecordedTimelineAnswer": "busplan.questions.timeline",
    }
    """Module of each name that the rule below does not find."""

    def __getattr__(name: str) -> object:
        from importlib import import_module  # noqa: PLC0415 - as for TYPE_CHECKING

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
