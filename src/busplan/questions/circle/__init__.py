"""`busplan.circle_test`."""

from collections.abc import Iterator

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.charts import Drawing
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Periods, ProfileLike, load_network, one_or_several, whole
from busplan.questions.circle.figures import CircleTest


class CircleTestAnswer(Answer, CircleTest):
    """Answer of `circle_test`: `results` and `runs`, one for each period.

    Figures of a simulation that did not run are None, as is the run of a cycle that does not fit the bus.
    """

    __slots__ = ()
    # Traces are arrays, which have no single truth.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.circle.report import circle_report

        return circle_report(self)

    def trace_csv(self, *, every: int = 10) -> Iterator[str]:
        """The simulated steps of each period as CSV: time [us], positions and contour error [mm].

        Parameters
        ----------
        every
            One of so many steps is a row [1].

        Returns
        -------
        Iterator of str
            The file's text in blocks of many lines.

        Raises
        ------
        BusplanError
            `every` is no whole number from 1 on.
        """
        from busplan.forms.csv_rows import csv_blocks
        from busplan.questions.circle.contour import TRACE_COLUMNS, trace_records

        return csv_blocks(trace_records(self, every=whole(every, name="every")), columns=TRACE_COLUMNS)

    def drawing(self) -> Drawing:
        """The magnified circle, its error over time and the ranked error sources.

        Raises
        ------
        BusplanError
            No period fits the bus, so nothing was simulated.
        """
        from busplan.questions.circle.plot import test_drawing

        if not any(self.runs):
            raise BusplanError("there is nothing to draw: no period fits the bus")
        return test_drawing(self)


def circle_test(
    profile: ProfileLike,
    *,
    period_us: Periods | None = None,
    contributions: bool = False,
    progress: Progress | None = None,
) -> CircleTestAnswer:
    """Tell whether the circle is still round: simulate both axes at the communication period.

    Parameters
    ----------
    profile
        The network, its servo and its circle: a `Profile`, a path or a shipped name.
    period_us
        Communication period T_s [us], or n of them; by default the profile's own.
    contributions
        If True, remove each error source in turn, and rank them.
    progress
        Called from time to time with the steps simulated and the steps known to be needed.

    Returns
    -------
    CircleTestAnswer
        Its `results` and `runs` have n entries. Errors are in mm, margins in deg and dB.

    Raises
    ------
    BusplanError
        Not a profile, a feed that the drive cannot reach, or a circle too
        short for its ramps.

    References
    ----------
    ISO 230-4 for the measures; the paper's section IV-B for the test.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.circle_test("paper-4ms")
    >>> answer.passed, round(answer.results[0].max_contour_error_mm, 6)
    (True, 0.018967)
    >>> answer.runs[0].trace(every=10).contour_error_mm.shape
    (48656,)
    """
    from busplan.questions.circle import roundness

    test = roundness.circle_test(
        load_network(profile),
        periods_us=None if period_us is None else one_or_several(period_us, name="period_us"),
        with_contributions=contributions,
        progress=progress,
    )
    return CircleTestAnswer(*test)
