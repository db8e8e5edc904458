"""Find what to set for a goal: the steps of the search, what the machine could reach, and what stands in the way."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from busplan.buses.parts import Value
from busplan.profile.keys import flat
from busplan.profile.toml import override
from busplan.questions.plan.constraints import Need
from busplan.questions.plan.freedoms import PERIOD, Freedom, freed
from busplan.questions.plan.options import Impossible, Option, Relaxation, frontier, option, relaxations
from busplan.questions.plan.search import MAX_CIRCLES, FindCircleFailures, Search
from busplan.sections.profile import Profile

AS_IT_IS: Final = "as it is"


class Plan(NamedTuple):
    """Answer of `plan`."""

    profile: Profile
    """The original profile."""
    goal: Profile
    """The profile with the wanted values."""
    wanted: dict[str, Value]
    """Wanted values that differ from the profile, by dotted key."""
    free: tuple[str, ...]
    """Names of the freedoms, the cheapest first."""
    options: tuple[Option, ...]
    impossible: tuple[Impossible, ...]
    binding: Need | None
    """The constraint that stands in the way; None if there is a plan."""
    relaxations: tuple[Relaxation, ...]
    """Relaxations that would each make a plan possible, with their changes; empty if there is a plan."""
    with_circle: bool
    """Whether the circle test was run."""

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


def plan(
    profile: Profile,
    *,
    wanted: Mapping[str, Any] | None = None,
    free: Sequence[str] | None = None,
    circle: FindCircleFailures | None = None,
    max_circles: int = MAX_CIRCLES,
) -> Plan:
    """Find what to set.

    The recommended option is the least change of the dearest freedom with all cheaper ones free, after which the goal
    is shown to fit on a bus that is set safely, within [limits], and passes the circle. It changes nothing that was
    asked for.

    Parameters
    ----------
    profile
        The network.
    wanted
        Wanted values by dotted key: {"bus.nodes": 6}.
    free
        Names of what may be changed; None for the registers of the bus, the slice ratio and the period.
    circle
        Function that runs the circle test; None for none.
    max_circles
        Number of periods in a row to test before the strides double [1].

    Returns
    -------
    Plan
        The steps of the search, what the network could reach, and the recommendation.

    Raises
    ------
    BusplanError
        A value that the profile's schema refuses, or a freedom that the network has not.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> answer = plan(load("paper-1ms").profile, wanted={"bus.nodes": 4})
    >>> answer.recommended.changes, round(answer.recommended.deciding.margin_us, 1)
    ({'bus.gap_count': 10}, 106.1)
    """
    asked = dict(wanted or {})
    goal = override(profile, dict(asked))
    kept = [*dict(flat(asked))]
    levels = freed(goal, free, asked=kept)
    search = Search(goal, circle=circle, kept=kept, max_circles=max_circles)
    steps = [*_steps(search, levels)]
    offers = [*steps, *(frontier(goal, search, levels) if goal.has_cycle else ())]
    has_plan = any(isinstance(step, Option) and step.recommended for step in steps)
    return Plan(
        profile=profile,
        goal=goal,
        wanted={key: value for key, value in asked.items() if _differs(profile, goal, key)},
        free=tuple(level.name for level in levels),
        options=tuple(offer for offer in offers if isinstance(offer, Option)),
        impossible=tuple(offer for offer in offers if isinstance(offer, Impossible)),
        binding=None if has_plan else search.binding(levels),
        relaxations=()
        if has_plan
        else tuple(relaxations(goal, levels, kept=kept, circle=circle, max_circles=max_circles)),
        with_circle=circle is not None,
    )


def _differs(profile: Profile, goal: Profile, key: str) -> bool:
    """Whether two profiles differ in a key, or in one of a section; other changes may be needed for either alone."""
    own, asked = (dict(flat(side.model_dump())) for side in (profile, goal))
    keys = [name for name in {**own, **asked} if name == key or name.startswith(f"{key}.")]
    return any(own.get(key) != asked.get(key) for key in keys)


def _steps(search: Search, levels: Sequence[Freedom]) -> Iterator[Option | Impossible]:
    """Nothing freed, then one freedom more each time, until one is enough."""
    said = ""
    for number in range(len(levels) + 1):
        freed_now = levels[:number]
        title = AS_IT_IS if not number else f"{'+ ' if number > 1 else ''}{freed_now[-1].label}"
        changes = search.least(freed_now)
        if changes is not None:
            yield option(search, title, changes)._replace(recommended=True)
            return
        binding = search.binding(freed_now)
        if not number or search.is_bounded(freed_now):
            yield option(search, title, search.furthest({}, freed_now), held_by=binding.key)
        elif binding.why != said:
            yield Impossible(", ".join(freedom.label for freedom in freed_now), binding.why, search.proven)
            said = binding.why
