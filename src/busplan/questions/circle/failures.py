"""Failures of a circle test: the bus, stability, the turn, margins and tolerances, each with its message."""

from collections.abc import Iterator
from math import inf
from string import Formatter
from typing import Any, Final, NamedTuple

from busplan.buses.network import Network
from busplan.elementwise import existing
from busplan.questions.fit.certainty import FITS, TIME
from busplan.questions.fit.figures import CycleFigures, limits_behind
from busplan.sections.machine import CONTOUR_MEASURES
from busplan.sections.profile import Profile
from busplan.servo.circle import FULL_TURN_DEG, CircleRun
from busplan.servo.runnable import LONGEST_SETTLING_US

MARGINS: Final = {"min_phase_margin_deg": "deg", "min_gain_margin_db": "dB"}
"""Units of the smallest allowed margins of the loop, by key. They have defaults, so they are always judged."""
STABILITY: Final = ("stability", *MARGINS)
"""Failures of the loop itself."""
_WITHOUT_TURN: Final = "circular_deviation_without_turn"
_NEXT_SYNC_HINT: Final = (
    ' (servo.update = "next_sync" puts one period inside the loop; "on_arrival" is for nodes that apply a command when '
    "it comes)"
)


class Stated(NamedTuple):
    """A number in the message of a failure."""

    value: float
    """Value in the unit of its key."""
    key: str
    """Key of the figure of the circle test, or of the tolerance."""
    unit: str
    """Unit in which the value is written."""
    decimals: int | None
    """Decimals; None for all."""

    def __str__(self) -> str:
        number = self.value * 1e3 if self.unit == "um" else self.value
        return f"{number:g} {self.unit}" if self.decimals is None else f"{number:.{self.decimals}f} {self.unit}"


class _Message(NamedTuple):
    """Template of a failure's message; {beyond} is the distance between {value} and {limit}."""

    words: str
    unit: str = "um"
    decimals: int = 3
    key: str = ""
    """Key of the figure that fails; empty if it is the name of the failure, less a min_."""
    limit_key: str = ""
    """Key of the limit; empty if it is the name of the failure."""
    limit_decimals: int | None = None
    limit_unit: str = ""
    """Unit of the limit; empty if it is that of the figure."""


_FAILURES: Final[dict[str, _Message]] = {
    "required_us": _Message(
        "the cycle does not fit the bus: it needs {value} of {limit}", "us", limit_key="available_us", limit_decimals=3
    ),
    "safe_required_us": _Message(
        "the cycle is not shown to fit the bus: with bias, uncertainty and reserve it needs {value} of {limit}",
        "us",
        limit_key="available_us",
        limit_decimals=3,
    ),
    "stability": _Message("the position loop is unstable"),
    "circle_not_followed": _Message(
        "the table did not follow the circle (not the whole turn, or an error above the radius): "
        "it covered {value} of {limit} around the centre",
        "deg",
        0,
        key="covered_deg",
        limit_decimals=0,
    ),
    "min_phase_margin_deg": _Message("the phase margin of {value} is {beyond} under its {limit}", "deg", 2),
    "min_gain_margin_db": _Message("the gain margin of {value} is {beyond} under its {limit}", "dB", 2),
    "mean_contour_error_mm": _Message("the mean contour error of {value} is {beyond} over its {limit}"),
    "max_contour_error_mm": _Message("the largest contour error of {value} is {beyond} over its {limit}"),
    "not_settled": _Message(
        "the loops and their friction take more than {limit} to settle, so that the turn is not measured",
        "s",
        limit_decimals=0,
    ),
    _WITHOUT_TURN: _Message(
        "the circular deviation G is measured on a whole turn, and the path is a trapezoid: "
        'set circle.path = "iso230-4", or remove tolerance.circular_deviation_mm = {limit}',
        limit_unit="mm",
    ),
    "circular_deviation_mm": _Message("the circular deviation G of {value} is {beyond} over its {limit}"),
}
_TIME_FAILURES: Final = ("required_us", "safe_required_us")


class Failure(NamedTuple):
    """A failure of the test: a tolerance or a limit of the bus that is not held, or instability."""

    name: str
    """Key of the tolerance or of the limit, or a word for another failure."""
    value: float | None
    limit: float | None
    limit_words: str = ""
    """Message of a broken limit of the bus; empty for other failures."""
    is_default: bool = False
    """Whether the limit is the default of its key, not set in the profile."""
    more: str = ""
    """Hint at the end of the message."""

    @property
    def is_of_bus(self) -> bool:
        """Whether a limit of the bus fails, not the circle."""
        return bool(self.limit_words) or self.name in _TIME_FAILURES

    def document(self) -> dict[str, Any]:
        """The failure as in the JSON document. A value that does not exist is null, and the text says why."""
        numbers = {"value": self.value, "limit": self.limit, "limit_is_default": self.is_default}
        return {"name": self.name, **numbers, "text": self.text}

    @property
    def text(self) -> str:
        """Message on what does not hold, and by how much."""
        return "".join(map(str, self.parts()))

    def parts(self) -> Iterator[str | Stated]:
        """Words and numbers of the message."""
        if self.limit_words:
            yield self.limit_words
            return
        key = _WITHOUT_TURN if self.name == CONTOUR_MEASURES[-1] and self.value is None else self.name
        message, value, limit = _FAILURES[key], self.value or 0.0, self.limit or 0.0
        limit_key = message.limit_key or self.name
        numbers = {
            "value": Stated(value, message.key or self.name.removeprefix("min_"), message.unit, message.decimals),
            "limit": Stated(limit, limit_key, message.limit_unit or message.unit, message.limit_decimals),
            "beyond": Stated(abs(value - limit), limit_key, message.unit, message.decimals),
        }
        for words, field, _, _ in Formatter().parse(message.words):
            yield words
            if field is not None:
                yield numbers[field]
            if field == "limit" and self.is_default:
                yield " (default)"
        yield self.more


def tightest_margins(run: CircleRun) -> tuple[float | None, float | None, float | None]:
    """Smallest phase margin [deg] and gain margin [dB] of both axes, and the crossover of the former [Hz].

    The two margins may come from different axes. If either loop is unstable, all are None.
    """
    axes = (run.margins_x, run.margins_y)
    if not all(axis.stable for axis in axes):
        return None, None, None
    gains = [axis.gain_margin_db for axis in axes if axis.gain_margin_db is not None]
    phase = min(axes, key=lambda axis: inf if axis.phase_margin_deg is None else axis.phase_margin_deg)
    return phase.phase_margin_deg, min(gains, default=None), phase.crossover_hz


def bus_failures(network: Network, fit: CycleFigures) -> tuple[Failure, ...]:
    """Limits of the bus that a cycle breaks, or that it is not shown to keep."""
    broken = limits_behind(fit, network)
    of_time: tuple[Failure, ...] = ()
    if TIME in fit.exceeded:
        of_time = (Failure("required_us", fit.required_us, fit.available_us),)
    elif not broken and fit.verdict != FITS:
        of_time = (Failure("safe_required_us", fit.safe_required_us, fit.available_us),)
    return (
        *(
            Failure(limit.key, existing(limit.value(network)), existing(limit.most(network)), limit.words(network))
            for limit in broken
        ),
        *of_time,
    )


def circle_failures(profile: Profile, run: CircleRun, *, settled: bool) -> tuple[Failure, ...]:
    """Failures of a simulated circle: stability first, then settling, the turn, the margins and the contour."""
    tolerance = profile.tolerance
    hint = _NEXT_SYNC_HINT if profile.servo.loop == "host" and profile.servo.update == "next_sync" else ""
    if not (run.margins_x.stable and run.margins_y.stable):
        return (Failure("stability", None, None, more=hint),)
    low = [
        Failure(name, value, limit, is_default=name not in tolerance.model_fields_set)
        for name, value in zip(MARGINS, tightest_margins(run), strict=False)
        if value is not None and value < (limit := getattr(tolerance, name))
    ]
    if low:
        low[-1] = low[-1]._replace(more=hint)
    measured = ((name, getattr(run.contour, name), getattr(tolerance, name)) for name in CONTOUR_MEASURES if settled)
    contour = (
        Failure(name, value, limit)
        for name, value, limit in measured
        if limit is not None and (value is None or value > limit)
    )
    return (
        *(() if settled else (Failure("not_settled", None, LONGEST_SETTLING_US / 1e6),)),
        # A table that stands still on the circle has no radial error, so the turn itself is judged, too, once the loops
        # have settled.
        *(() if run.follows or not settled else (Failure("circle_not_followed", run.covered_deg, FULL_TURN_DEG),)),
        *low,
        *contour,
    )
