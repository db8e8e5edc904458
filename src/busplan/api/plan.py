"""`busplan.plan`."""

from dataclasses import dataclass
from typing import Literal

from busplan.analysis.planning import options as analysis
from busplan.analysis.planning.best_values import MAX_CIRCLES
from busplan.analysis.planning.options import Impossible, Option, Plan
from busplan.answers.plan import plan_report
from busplan.api.answer import Answer
from busplan.api.inputs import ProfileLike, finite, load_profile, plain, whole
from busplan.buses.bus import Value
from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.sections.profile import Profile


@dataclass(frozen=True, slots=True, repr=False)
class PlanAnswer(Answer):
    """Answer of `plan`.

    Parameters
    ----------
    profile
        The profile as it was read.
    goal
        The profile with what was asked for.
    wanted
        What was asked for and is not in the profile yet, by dotted key.
    options
        Ways to set the network, each computed with it in place.
    impossible
        Settings without a value that would do, with the reason.
    with_circle
        Whether the circle test was run.
    """

    profile: Profile
    goal: Profile
    wanted: dict[str, Value]
    options: tuple[Option, ...]
    impossible: tuple[Impossible, ...]
    with_circle: bool

    @property
    def recommended(self) -> Option | None:
        """The option to take, with its `profile`; None when there is no plan for the goal."""
        return self._found.recommended

    @property
    def recommended_changes(self) -> dict[str, Value] | None:
        """What turns the profile as it was read into the recommended one; None when there is no plan."""
        option = self.recommended
        return None if option is None else self._found.all_changes(option)

    def _report(self) -> Report:
        return plan_report(self._found, with_circle=self.with_circle)

    @property
    def _found(self) -> Plan:
        return Plan(self.profile, self.goal, self.wanted, self.options, self.impossible)


def plan(
    profile: ProfileLike,
    *,
    nodes: int | None = None,
    axes: int | None = None,
    period_us: float | None = None,
    gap_count: int | Literal["optimal"] | None = None,
    with_circle: bool = True,
    max_circles: int = MAX_CIRCLES,
) -> PlanAnswer:
    """Tell what to set: gap count, period, slice ratio, payload, and how many nodes would do.

    Parameters
    ----------
    profile
        The network: a `Profile`, a path or a shipped name. It is not changed.
    nodes
        Goal: so many distributed nodes [1]; without it, and without `axes`, the profile's own.
    axes
        Goal: so many axes, on the nodes they need [1]; instead of `nodes`.
    period_us
        Communication period T_s, which is then kept [us].
    gap_count
        Gap count, which is then kept: 0 to 63, or "optimal" [1].
    with_circle
        Run the circle test, where the profile has a section for it.
    max_circles
        How many periods in a row are tried for the circle before the search takes longer strides [1].

    Returns
    -------
    PlanAnswer
        The options, and the one to take: the cheapest after which the goal fits under both timing models with a safe
        gap count, and passes the circle. Times are in us.

    Raises
    ------
    BusplanError
        No profile, or a goal that no profile can have. That there is no plan is an answer.

    References
    ----------
    Paper, equations (1)-(11).

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.plan("paper-1ms", axes=16, with_circle=False)
    >>> answer.recommended_changes
    {'bus.nodes': 4, 'bus.gap_count': 10}
    >>> busplan.capacity(answer.recommended.profile).verdicts[0].models_agree
    True
    """
    network = load_profile(profile)
    if nodes is not None and axes is not None:
        raise BusplanError(f"nodes {nodes} and axes {axes}: give one of them")
    if axes is not None:
        nodes = analysis.nodes_for_axes(network, whole(axes, name="axes"))
    period = None if period_us is None else finite(period_us, name="period_us")
    asked = {"bus.nodes": nodes, "cycle.period_us": period, "bus.gap_count": gap_count}
    with_circle = with_circle and network.asks_for_circle
    tries = whole(max_circles, name="max_circles")
    check = None
    if with_circle:
        from busplan.analysis.circle.check import CircleCheck

        check = CircleCheck()
    found = analysis.plan(
        network,
        wanted={key: plain(value) for key, value in asked.items() if value is not None},
        circle=check,
        max_circles=tries,
    )
    return PlanAnswer(*found, with_circle=with_circle)
