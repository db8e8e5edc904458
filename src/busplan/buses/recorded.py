"""What a recording of a machine's bus says beside its plan."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final, Literal, NamedTuple

from busplan.sourced import Sourced

CLOCK_TOLERANCE: Final = Sourced(
    100e-6,
    unit="1",
    grade="recalled",
    source="IEEE 802.3, clock of a 100 Mbit/s port, 100 ppm; taken for the clock of a recorder, too",
    meaning="largest error of the clocks that a period is made and recorded by, as a share of it",
)

_FIRST_DAY_NS: Final = 10 * 365 * 86400 * 1_000_000_000
_LAST_DAY_NS: Final = 1 << 63
_ROUNDING: Final = 1e-9
"""Share of a figure that is rounding."""
SURE: Final = 3.29 / 2
"""Expanded uncertainties (k = 2) from its plan on which a figure is outside it: k = 3.29, 99.9 % of a normal error."""
Sense = Literal["equal", "at most", "at least", "shown"]
"""How a recorded figure is within its plan; shown: it has none."""
RecordedVerdict = Literal["within", "not shown", "outside"]
"""Whether a figure is within its plan, beside it by no more than the doubt allows or hidden, or surely outside."""


class RecordedFigure(NamedTuple):
    """A figure as planned and as recorded, both in `unit`."""

    quantity: str
    unit: Literal["us", "bytes", "1", "share", "kbit/s"]
    """A share is 0..1."""
    planned: float | None
    recorded: float | None
    """None where the recording does not show it."""
    uncertainty: float | None
    """Expanded uncertainty (k = 2) of the difference; None where it is not known, or where nothing is planned."""
    sense: Sense
    events: int
    """Number of events that it is taken from [1]."""
    key: str = ""
    """Dotted key of the profile that plans it."""
    note: str = ""
    is_mean: bool = False
    """Whether it is the mean of its events, whatever the quantile."""
    hidden: str = ""
    """Why the recording cannot show it, though something is planned; empty where it can."""

    @property
    def residual(self) -> float | None:
        """Recorded less planned."""
        return None if self.planned is None or self.recorded is None else self.recorded - self.planned

    @property
    def beyond(self) -> float | None:
        """How far it is beside its plan, on the side that counts; negative within; None where nothing is planned."""
        if self.residual is None or self.sense == "shown":
            return None
        return {"equal": abs(self.residual), "at most": self.residual, "at least": -self.residual}[self.sense]

    @property
    def verdict(self) -> RecordedVerdict | None:
        """How it stands to its plan; None where nothing is planned.

        A worst case that was recorded within the plan is within it; beyond by less than a doubt of 99.9 % it is not
        shown. A mean, and what is to be equal, is within up to U.
        """
        if self.hidden:
            return "not shown"
        if self.beyond is None:
            return None
        doubt, rounding = self.uncertainty or 0.0, _ROUNDING * abs(self.planned or 0.0)
        if self.beyond <= rounding + (doubt if self.is_mean or self.sense == "equal" else 0.0):
            return "within"
        return "outside" if self.beyond > SURE * doubt + rounding else "not shown"


class Recorded(NamedTuple):
    """A recording beside the plan."""

    figures: tuple[RecordedFigure, ...]
    remarks: tuple[str, ...]
    """Sentences on what the recording has beside that, and what it does not show."""
    edits: Mapping[str, object]
    """New value by dotted key of what was measured; None removes a key."""
    day: str
    """Day of the first stamp in UTC, as 2026-11-23; empty where stamps do not say it."""
    shows_nothing: tuple[str, ...] = ()
    """Why the recording as a whole shows no machine within its plan, a sentence each; empty where it can."""


def day_of(time_ns: int) -> str:
    """Day of a stamp, nanoseconds since 1970; empty of a clock that counts from its own start.

    Examples
    --------
    >>> day_of(1_700_000_000_000_000_000), day_of(5_000_000_000)
    ('2023-11-14', '')
    """
    if not _FIRST_DAY_NS <= time_ns < _LAST_DAY_NS:
        return ""
    return datetime.fromtimestamp(time_ns // 1_000_000_000, tz=UTC).date().isoformat()
