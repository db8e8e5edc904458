"""`busplan.plan`."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

from busplan.buses.network import Network
from busplan.buses.parts import Value
from busplan.errors import ArgumentError
from busplan.forms.blocks import Report
from busplan.forms.numbers import sentence_text
from busplan.profile.changes import KeyChange, KeyChanges
from busplan.profile.edit import whole
from busplan.profile.kinds import flat
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import (
    ProfileLike,
    finite,
    from_numpy,
    items,
    load_profile,
    require_cycle,
    values_by_key,
    whole_number,
    with_its_constants,
)
from busplan.questions.base.sentences import change_meanings
from busplan.questions.fit.cure import (
    Changes,
    Freedom,
    PlanStep,
    freed,
    freedoms,
    nodes_for_axes,
    search,
    settings_to_be_carried,
    stands_in_the_way,
)
from busplan.questions.fit.figures import FitFigures, Judged, after_reset, capacity_figures, figures
from busplan.questions.fit.needs import Need, most_asking
from busplan.questions.fit.network import PERIOD, changed, model_names, network_of, warnings_of
from busplan.sections.profile import Profile
from busplan.sourced import constants_changed


@dataclass(frozen=True)
class Option(Judged):
    """A step of the search: what was changed so far, and what it gives."""

    title: str
    changes: dict[str, Value]
    """Keys that change in the goal, with their new values, the dearest change first."""
    profile: Profile
    """The goal with the changes."""
    figures: FitFigures
    """Capacity under the timing model that decides."""
    others: tuple[FitFigures, ...]
    """Figures under the other timing models."""
    held_by: str | None
    """Key of the constraint that it breaks most; None where all hold."""
    recommended: bool


@dataclass(frozen=True)
class Relaxation:
    """A further freedom that would be enough, and what to set then."""

    relaxed: str
    """Name of the freedom."""
    label: str
    """The freedom in words."""
    changes: dict[str, Value]
    """Changes to make then: keys of the goal with new values."""


@dataclass(frozen=True, slots=True, repr=False)
class PlanAnswer(Answer):
    """Answer of `plan`: the steps of the search with their figures, and the recommended one with its `profile`.

    Parameters
    ----------
    profile
        The original profile.
    goal
        The profile with the wanted values.
    wanted
        Wanted values that differ from the profile, by dotted key.
    free
        The freedoms, the cheapest first.
    options
        The steps of the search: as it is, and one thing more each time; the last one is recommended if it holds.
    binding
        The constraint that stands in the way; None if there is a plan.
    relaxations
        Further freedoms that would each make a plan possible; empty if there is a plan.
    after_reset
        Figures of the recommended option after a bus reset, where it does not fit then.
    warnings
        Warnings for the recommended option, or for the goal, that hold whatever the verdict.
    meanings
        What a change means on the machine, by key, for keys that do not say so.
    """

    profile: Profile
    goal: Profile
    wanted: dict[str, Value]
    free: tuple[Freedom, ...]
    options: tuple[Option, ...]
    binding: Need | None
    relaxations: tuple[Relaxation, ...]
    after_reset: FitFigures | None
    warnings: tuple[str, ...]
    meanings: Mapping[str, str]

    @property
    def recommended(self) -> Option | None:
        """The recommended option; None if there is no plan for the goal."""
        return next((option for option in self.options if option.recommended), None)

    @property
    def period_is_kept(self) -> bool | None:
        """Whether the recommended option leaves the period of the goal as it is; None without a plan."""
        return None if self.recommended is None else PERIOD not in self.recommended.changes

    @property
    def recommended_changes(self) -> dict[str, Value] | None:
        """Changes from the original profile to the recommended one; None without a plan."""
        return None if self.recommended is None else self.all_changes(self.recommended)

    def all_changes(self, option: Option) -> dict[str, Value]:
        """All changes from the original profile to an option."""
        return {**self.wanted, **option.changes}

    @property
    def recommended_words(self) -> str:
        """The recommended changes as in a profile: "bus.nodes = 4, bus.gap_count = 10"; empty without any."""
        from busplan.questions.plan.report import settings

        changes = {key: whole(value) for key, value in (self.recommended_changes or {}).items()}
        written: dict[str, Any] = dict(flat(changes))
        return sentence_text(settings(self.meanings, written)) if written else ""

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.plan.report import plan_report

        return plan_report(self)


def needed_settings(profile: Profile) -> Changes:
    """The cheapest setting of the bus with which some slice carries a machine, where none does now; else empty."""
    return settings_to_be_carried(network_of(profile))


@with_its_constants
def plan(
    profile: ProfileLike,
    *,
    nodes: int | None = None,
    axes: int | None = None,
    period_us: float | None = None,
    changes: Mapping[str, object] | KeyChanges | None = None,
    free: Iterable[str] | None = None,
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
    changes
        Other values to keep by dotted key, in the key's unit: {"payload.read_bytes": 16}. `KeyChanges` have options
        besides, which errors name.
    free
        Names of what may be changed, as gap_count, slice_ratio, responses, payload, period and nodes, or their keys; by
        default all but payload and nodes.

    Returns
    -------
    PlanAnswer
        The steps of the search, one thing changed at a time in the order of cost, and the recommended one: the goal is
        shown to fit, on a bus that is set safely, within [limits]. Times are in us.

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
    >>> answer = busplan.plan("paper-1ms", axes=16)
    >>> answer.recommended_changes
    {'bus.nodes': 4, 'bus.gap_count': 10}
    >>> busplan.capacity(answer.recommended.profile).verdicts[0].models_agree
    True
    """
    loaded = load_profile(profile)
    if nodes is not None or axes is not None:
        require_cycle(loaded, question=f"a plan for {'nodes' if axes is None else 'axes'}")
    if nodes is not None and axes is not None:
        raise ArgumentError(f"nodes {nodes} and axes {axes}: give one of them")
    given = {
        "bus.nodes": nodes,
        "cycle.period_us": None if period_us is None else finite(period_us, name="period_us"),
    }
    kept = _changes({key: from_numpy(value) for key, value in given.items() if value is not None})
    kept += changes.entries if isinstance(changes, KeyChanges) else _changes(values_by_key(changes, name="changes"))
    if constants := KeyChanges(kept).constants:
        loaded, kept = KeyChanges(constants).applied(loaded), KeyChanges(kept).of_profile.entries
    with constants_changed(loaded.constants):
        if axes is not None:
            kept = (_nodes(loaded, whole_number(axes, name="axes"), kept), *kept)
        names = None if free is None else [str(name) for name in items(free, name="free")]
        return _plan(loaded, KeyChanges(kept), names)


def _plan(profile: Profile, wanted: KeyChanges, names: Sequence[str] | None) -> PlanAnswer:
    goal = network_of(wanted.applied(profile))
    given: dict[str, Any] = dict(wanted.values)
    kept = [*dict(flat(given))]
    levels = freed(goal, names, kept=kept)
    steps = search(goal, levels, kept=kept)
    networks = [changed(goal, step.changes) for step in steps]
    options = tuple(map(_option, networks, steps, count()))
    recommended = options[-1] if options[-1].recommended else None
    return PlanAnswer(
        profile=profile,
        goal=goal.profile,
        wanted={key: value for key, value in given.items() if _differs(profile, goal.profile, key)},
        free=levels,
        options=options,
        binding=None if recommended else stands_in_the_way(goal, steps[-1]),
        relaxations=() if recommended else tuple(_relaxations(goal, levels, kept)),
        after_reset=None if recommended is None else after_reset(networks[-1], recommended.figures),
        warnings=warnings_of(goal if recommended is None else networks[-1]),
        meanings=change_meanings(goal.bus),
    )


def _option(after: Network, step: PlanStep, number: int) -> Option:
    model, ratio = after.bus.deciding_model, float(after.profile.cycle.slice_ratio)
    label = "as it is" if step.freedom is None else step.freedom.label
    return Option(
        title=f"+ {label}" if number > 1 else label,
        changes=dict(step.changes),
        profile=after.profile,
        figures=capacity_figures(after, model=model),
        others=tuple(figures(after, model=other) for other in model_names(after) if other != model),
        held_by=most_asking(step.unmet, ratio=ratio).key if step.unmet else None,
        recommended=not step.unmet,
    )


def _relaxations(goal: Network, levels: Sequence[Freedom], kept: Sequence[str]) -> Iterator[Relaxation]:
    """Further freedoms that would each be enough, kept values included."""
    names = {level.name for level in levels}
    for freedom in freedoms(goal):
        if freedom.name not in names:
            still_kept = set(kept) - set(freedom.keys)
            more = [level for level in freedoms(goal) if level.name in {*names, freedom.name}]
            *_, last = search(goal, more, kept=still_kept)
            if not last.unmet:
                yield Relaxation(freedom.name, freedom.label, dict(last.changes))


def _differs(profile: Profile, goal: Profile, key: str) -> bool:
    """Whether two profiles differ in a key, or in one of a section; other changes may be needed for either alone."""
    before, after = (dict(flat(side.model_dump())) for side in (profile, goal))
    names = (name for name in {**before, **after} if name == key or name.startswith(f"{key}."))
    return any(before.get(name) != after.get(name) for name in names)


def _changes(values: Mapping[str, object]) -> tuple[KeyChange, ...]:
    return tuple(KeyChange(key, value, key, str(value)) for key, value in values.items())


def _nodes(profile: Profile, axes: int, kept: Sequence[KeyChange]) -> KeyChange:
    """The number of nodes that some axes need, with the axes of each node that are kept."""
    of_nodes = KeyChanges(tuple(change for change in kept if change.key in {"node", "node.axes"}))
    nodes = nodes_for_axes(of_nodes.applied(profile), axes)
    return KeyChange("bus.nodes", nodes, "axes", str(axes), f", nodes {nodes}")
