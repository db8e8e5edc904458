"""`busplan.plan`."""

from collections.abc import Iterable
from typing import Literal

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import ProfileLike, finite, items, load_profile, plain, whole
from busplan.questions.circle.check import CircleCheck
from busplan.questions.plan import planning as analysis
from busplan.questions.plan.machine import nodes_for_axes
from busplan.questions.plan.planning import Plan
from busplan.questions.plan.search import MAX_CIRCLES


class PlanAnswer(Answer, Plan):
    """Answer of `plan`: the steps of the search with their figures, and the recommended one with its `profile`."""

    __slots__ = ()

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.plan.report import plan_report

        return plan_report(self)


def plan(
    profile: ProfileLike,
    *,
    nodes: int | None = None,
    axes: int | None = None,
    period_us: float | None = None,
    gap_count: int | Literal["optimal"] | None = None,
    reserve: float | None = None,
    free: Iterable[str] | None = None,
    circle: bool = True,
    max_circles: int = MAX_CIRCLES,
) -> PlanAnswer:
    """Tell what to set, with all changes together, for a number of nodes or axes.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name. It is not changed.
    nodes
        Goal: number of distributed nodes [1]; without it and `axes`, the profile's own.
    axes
        Goal: number of axes, on as few nodes as they need [1]; instead of `nodes`.
    period_us
        Communication period T_s to keep [us].
    gap_count
        Gap count to keep, 0 to 63, or "optimal" [1].
    reserve
        Share of the slice that must stay free, 0..0.99, instead of the profile's limits.reserve [1].
    free
        Names of what may be changed, of step (of the circle, where it does not divide the period), gap_count,
        slice_ratio, responses, payload, period and nodes; by default step, gap count, slice ratio to 0.9, period.
    circle
        Run the circle test, if the profile has a section for it.
    max_circles
        Number of consecutive periods to test with the circle before the strides double [1].

    Returns
    -------
    PlanAnswer
        The steps of the search, and the recommended one: the least change of the dearest freedom with all cheaper ones
        free, after which the goal is shown to fit with a safe gap count, within [limits], and passes the circle. Times
        are in us.

    Raises
    ------
    BusplanError
        Not a profile, a goal that no profile can have, or an unknown freedom. "No plan" is an answer, not an error.

    References
    ----------
    Paper, equations (1)-(11).

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.plan("paper-1ms", axes=16, circle=False)
    >>> answer.recommended_changes
    {'bus.nodes': 4, 'bus.gap_count': 10}
    >>> busplan.capacity(answer.recommended.profile).verdicts[0].models_agree
    True
    """
    network = load_profile(profile)
    if nodes is not None and axes is not None:
        raise BusplanError(f"nodes {nodes} and axes {axes}: give one of them")
    if axes is not None:
        nodes = nodes_for_axes(network, whole(axes, name="axes"))
    period = None if period_us is None else finite(period_us, name="period_us")
    least = None if reserve is None else finite(reserve, name="reserve")
    asked = {
        "bus.nodes": nodes,
        "cycle.period_us": period,
        "bus.gap_count": gap_count,
        "limits.reserve": least,
    }
    with_circle = circle and network.asks_for_circle
    tries = whole(max_circles, name="max_circles")
    found = analysis.plan(
        network,
        wanted={key: plain(value) for key, value in asked.items() if value is not None},
        free=None if free is None else [str(one) for one in items(free, name="free")],
        circle=CircleCheck() if with_circle else None,
        max_circles=tries,
    )
    return PlanAnswer(*found)
