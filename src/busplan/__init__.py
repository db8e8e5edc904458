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
    "CapacityAnswer",
    "CheckAnswer",
    "CircleTestAnswer",
    "LatencyAnswer",
    "PlanAnswer",
    "Profile",
    "SweepAnswer",
    "TimelineAnswer",
    "TradeOffAnswer",
    "__version__",
    "capacity",
    "check",
    "circle_test",
    "latency",
    "load_profile",
    "plan",
    "sweep",
    "timeline",
    "trade_off",
]

if TYPE_CHECKING:
    from busplan.api.capacity import CapacityAnswer, capacity
    from busplan.api.check import CheckAnswer, check
    from busplan.api.circle import CircleTestAnswer, circle_test
    from busplan.api.inputs import load_profile
    from busplan.api.latency import LatencyAnswer, latency
    from busplan.api.plan import PlanAnswer, plan
    from busplan.api.sweep import SweepAnswer, sweep
    from busplan.api.timeline import TimelineAnswer, timeline
    from busplan.api.trade_off import TradeOffAnswer, trade_off
    from busplan.errors import BusplanError
    from busplan.sections.profile import Profile
else:
    # Loaded at first use, because the command line imports this package, too. Hidden from type checkers, so that they
    # report unknown names.
    _HOMES = {
        "BusplanError": "busplan.errors",
        "Profile": "busplan.sections.profile",
        "load_profile": "busplan.api.inputs",
        "CapacityAnswer": "busplan.api.capacity",
        "capacity": "busplan.api.capacity",
        "CheckAnswer": "busplan.api.check",
        "check": "busplan.api.check",
        "CircleTestAnswer": "busplan.api.circle",
        "circle_test": "busplan.api.circle",
        "LatencyAnswer": "busplan.api.latency",
        "latency": "busplan.api.latency",
        "PlanAnswer": "busplan.api.plan",
        "plan": "busplan.api.plan",
        "SweepAnswer": "busplan.api.sweep",
        "sweep": "busplan.api.sweep",
        "TimelineAnswer": "busplan.api.timeline",
        "timeline": "busplan.api.timeline",
        "TradeOffAnswer": "busplan.api.trade_off",
        "trade_off": "busplan.api.trade_off",
    }

    def __getattr__(name: str) -> object:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value = getattr(import_module(_HOMES[name]), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
