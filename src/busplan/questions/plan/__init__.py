"""`busplan.plan`."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.profile.changes import KeyChange, KeyChanges
from busplan.profile.keys import flat
from busplan.profile.write import whole as as_whole
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import (
    ProfileLike,
    finite,
    from_numpy,
    items,
    load_profile,
    values_by_key,
    whole,
    with_cycle,
)
from busplan.questions.circle.check import CircleCheck
from busplan.questions.plan import planning as analysis
from busplan.questions.plan.constraints import nodes_for_axes
from busplan.questions.plan.planning import Plan
from busplan.questions.plan.search import MAX_CIRCLES
from busplan.questions.plan.smallest_period import needed_settings
from busplan.sections.profile import Profile

__all__ = ["PlanAnswer", "needed_settings", "plan"]


class PlanAnswer(Answer, Plan):
    """Answer of `plan`: the steps of the search with their figures, and the recommended one with its `profile`."""

    __slots__ = ()

    @property
    def recommended_words(self) -> str:
        """The recommended changes as in a profile: "bus.nodes = 4, bus.gap_count = 10"; empty without any."""
        from busplan.questions.plan.report import settings

        changes = {key: as_whole(value) for key, value in (self.recommended_changes or {}).items()}
        written: dict[str, Any] = dict(flat(changes))
        return settings(self.profile, written)

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
    wanted: Mapping[str, object] | KeyChanges | None = None,
    free: Iterable[str] | None = None,
    circle: bool = True,
    max_circles: int = MAX_CIRCLES,
    progress: Progress | None = None,
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
    wanted
        Other values to keep by dotted key, in the key's unit: {"payload.read_bytes": 16}. `KeyChanges` have options
        besides, which errors name.
    free
        Names of what may be changed, of step (of the circle, where it does not divide the period), gap_count,
        slice_ratio, responses, payload, period and nodes; by default step, gap count, slice ratio to 0.9, period.
    circle
        Run the circle test, if the profile has a section for it.
    max_circles
        Number of consecutive periods to test with the circle before the strides double [1].
    progress
        Called from time to time with the parts of circle tests that are done, and those expected [1].

    Returns
    -------
    PlanAnswer
        The steps of the search, and the recommended one: the least change of the dearest freedom with all cheaper ones
        free, after which the goal is shown to fit with a safe gap count, within [limits], and passes the circle. Times
        are in us.

    Raises
    ------
    BusplanError
        Not a profile, a goal that no profile can have or that is given twice, or an unknown freedom. "No plan" is an
        answer, not an error.

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
    if nodes is not None or axes is not None:
        with_cycle(network, question=f"a plan for {'nodes' if axes is None else 'axes'}")
    if nodes is not None and axes is not None:
        raise BusplanError(f"nodes {nodes} and axes {axes}: give one of them")
    own = {
        "bus.nodes": nodes,
        "cycle.period_us": None if period_us is None else finite(period_us, name="period_us"),
        "bus.gap_count": gap_count,
        "limits.reserve": None if reserve is None else finite(reserve, name="reserve"),
    }
    kept = _changes({key: from_numpy(value) for key, value in own.items() if value is not None})
    kept += wanted.each if isinstance(wanted, KeyChanges) else _changes(values_by_key(wanted, name="wanted"))
    if axes is not None:
        kept = (_nodes(network, whole(axes, name="axes"), kept), *kept)
    changes = KeyChanges(kept)
    goal = changes.applied(network)
    tries = whole(max_circles, name="max_circles")
    result = analysis.plan(
        network,
        wanted=changes.values,
        free=None if free is None else [str(name) for name in items(free, name="free")],
        circle=CircleCheck(progress=progress, expected=tries) if circle and goal.asks_for_circle else None,
        max_circles=tries,
    )
    return PlanAnswer(*result)


def _changes(values: Mapping[str, object]) -> tuple[KeyChange, ...]:
    return tuple(KeyChange(key, value, key, str(value)) for key, value in values.items())


def _nodes(network: Profile, axes: int, kept: Sequence[KeyChange]) -> KeyChange:
    """The number of nodes that some axes need, with the axes of each node that are kept."""
    of_nodes = KeyChanges(tuple(change for change in kept if change.key in {"node", "node.axes"}))
    nodes = nodes_for_axes(of_nodes.applied(network), axes)
    return KeyChange("bus.nodes", nodes, "axes", str(axes), f", nodes {nodes}")
