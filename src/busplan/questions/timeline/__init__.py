"""`busplan.timeline`."""

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import ProfileLike, checked_models, finite, load_profile, whole
from busplan.questions.timeline.events import Schedule, Total, schedule, totals, zoom


class TimelineAnswer(Answer, Schedule):
    """Answer of `timeline`: the `events` inside the window, and of the whole cycle."""

    __slots__ = ()

    @property
    def totals(self) -> tuple[Total, ...]:
        """Totals of the events in the window, by kind."""
        return totals(self)

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.timeline.report import timeline_report

        return timeline_report(self)

    def _repr_svg_(self) -> str:
        from busplan.questions.timeline.svg import timeline_svg

        return timeline_svg(self, title=self._headline())


def timeline(
    profile: ProfileLike,
    *,
    timing_model: str | None = None,
    from_us: float | None = None,
    to_us: float | None = None,
    transaction: tuple[str, int] | None = None,
) -> TimelineAnswer:
    """Show one communication cycle as events, node by node.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name.
    timing_model
        Name of a timing model, such as "standard"; by default the one that decides.
    from_us, to_us
        Start and end of the window, from the start of the cycle [us]; by default the whole cycle.
    transaction
        One transaction of one node with its gaps: ("read", 1).

    Returns
    -------
    TimelineAnswer
        Its `events` have no gaps between them; times are in us.

    Raises
    ------
    BusplanError
        Not a profile, too many nodes, an unknown timing model, or an empty window.

    References
    ----------
    Paper, section III-C and equation (2), Figs. 4, 5 and 7.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.timeline("paper-4ms", transaction=("read", 1))
    >>> [(one.kind, round(one.duration_us, 3)) for one in answer.events][1:4]
    [('request_data', 0.768), ('acknowledge', 0.367), ('execution', 36.733)]
    """
    network = load_profile(profile)
    model = None if timing_model is None else checked_models([timing_model], network)[0]
    plan = schedule(network, model=model)
    window = zoom(
        plan,
        from_us=None if from_us is None else finite(from_us, name="from_us"),
        to_us=None if to_us is None else finite(to_us, name="to_us"),
        transaction=None if transaction is None else _one(transaction),
    )
    return TimelineAnswer(*window)


def _one(transaction: object) -> tuple[str, int]:
    match transaction:
        case (str() as kind, node):
            return kind, whole(node, name="transaction")
    raise BusplanError(f'transaction {transaction!r}: expected one of one node, as ("read", 1)')
