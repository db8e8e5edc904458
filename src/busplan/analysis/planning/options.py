"""Find what to set for a number of nodes: the best value of each setting, and the recommended change.

Every option is put into the profile and computed again.
"""

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from busplan.analysis.capacity.certainty import FITS
from busplan.analysis.capacity.cycle import broken_limits
from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.capacity.node_limit import safe_nodes
from busplan.analysis.network import bus_of, model_names, network_of
from busplan.analysis.planning.best_values import (
    MAX_CIRCLES,
    FindCircleFailures,
    largest_payload,
    smallest_period,
    smallest_ratio,
)
from busplan.analysis.planning.cures import changes_to_fit, safe_required_us
from busplan.buses.bus import Setting, Value
from busplan.profile.keys import flat
from busplan.profile.toml import override
from busplan.sections.base import MAX_TIME_US
from busplan.sections.profile import Profile

Changes = dict[str, Value]


class Option(NamedTuple):
    """One way to set the network, computed with it in place."""

    title: str
    changes: Changes
    """Keys that the option changes in the goal, with their new values."""
    profile: Profile
    """The goal with the changes."""
    deciding: CapacityFigures
    """Capacity under the timing model that decides."""
    others: tuple[CapacityFigures, ...]
    """Capacity under the other timing models."""
    bounded_by: str | None = None
    """Limit that keeps the value from being better; None if the option chooses no value."""
    circle_failures: tuple[str, ...] | None = None
    """Failures of the circle; None if it was not run."""
    proven: bool = True
    """Whether no better value exists; False if the search was cut short."""
    recommended: bool = False

    @property
    def circle_passed(self) -> bool | None:
        """Whether the circle holds its tolerances; None if it was not run, or holds what always judges and has none."""
        if not self.circle_failures and not self.profile.tolerance.judges_contour:
            return None
        return None if self.circle_failures is None else not self.circle_failures

    @property
    def is_plan(self) -> bool:
        """Whether it is shown to fit, the bus is safe, and the circle passes if it was run."""
        return self.deciding.verdict == FITS and self.deciding.safe and not self.circle_failures


class Impossible(NamedTuple):
    """A setting that has no suitable value."""

    title: str
    reason: str
    proven: bool = True
    """Whether no value exists; False if the search was cut short."""


class Plan(NamedTuple):
    """Answer of `plan`."""

    profile: Profile
    """The original profile."""
    goal: Profile
    """The profile with the wanted values."""
    wanted: Changes
    """Wanted values that differ from the profile, by dotted key."""
    options: tuple[Option, ...]
    impossible: tuple[Impossible, ...]

    @property
    def recommended(self) -> Option | None:
        """The recommended option; None if there is no plan for the goal."""
        return next((option for option in self.options if option.recommended), None)

    def all_changes(self, option: Option) -> Changes:
        """All changes from the original profile to an option."""
        return {**self.wanted, **option.changes}


def plan(
    profile: Profile,
    *,
    wanted: Mapping[str, Value] | None = None,
    circle: FindCircleFailures | None = None,
    max_circles: int = MAX_CIRCLES,
) -> Plan:
    """Find what to set.

    The recommended option is the first, in the order of `cures` (nothing, a setting of the bus, slice ratio, both,
    period, period and a setting; with them what the limits of the bus demand), after which the goal is shown to fit on
    a bus that is set safely, and passes the circle test. It changes nothing that was asked for, and never the number of
    nodes.

    Parameters
    ----------
    profile
        The network.
    wanted
        Wanted values by dotted key: {"bus.nodes": 6}.
    circle
        Function that runs the circle test; None for none.
    max_circles
        Number of consecutive periods to test before the strides double [1].

    Returns
    -------
    Plan
        The options, the settings without a suitable value, and the recommendation.

    Raises
    ------
    BusplanError
        A value that the profile's schema refuses.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> found = plan(load("paper-1ms").profile, wanted={"bus.nodes": 4})
    >>> found.recommended.is_plan, round(found.recommended.deciding.margin_us, 1)
    (True, 106.1)
    """
    asked = dict(wanted or {})
    goal = override(profile, dict(asked))
    planner = _Planner(goal, circle=circle, max_circles=max_circles)
    found = list(planner.options())
    options = [one for one in found if isinstance(one, Option)]
    recommended = planner.recommended(keep={"bus.nodes", *dict(flat(asked))})
    if recommended is not None:
        same = next((number for number, one in enumerate(options) if one.changes == recommended.changes), None)
        if same is None:
            options.append(recommended)
        else:
            options[same] = options[same]._replace(recommended=True)
    return Plan(
        profile=profile,
        goal=goal,
        wanted=_differing(profile, asked),
        options=tuple(options),
        impossible=tuple(one for one in found if isinstance(one, Impossible)),
    )


def nodes_for_axes(profile: Profile, axes: int) -> int:
    """Number of nodes for a number of axes, with the profile's axes per node."""
    return -(-axes // int(profile.alike_nodes[0].node.axes))


def _differing(profile: Profile, changes: Changes) -> Changes:
    """The changes that differ from the profile."""
    return {key: value for key, value in changes.items() if override(profile, {key: value}) != profile}


_CHEAPEST: Final = "cheapest that is shown to fit"
"""Title of the recommendation where it is none of the other options."""


class _Planner:
    """Makes the options of one goal."""

    def __init__(self, goal: Profile, *, circle: FindCircleFailures | None, max_circles: int) -> None:
        self.goal = goal
        self.model = bus_of(goal).deciding_model
        self.circle = circle
        self.max_circles = max_circles

    def options(self) -> Iterator[Option | Impossible]:
        """The best value of each setting."""
        goal = self.goal
        yield self.option("as it is", {})
        settings = bus_of(goal).settings(network_of(goal))
        for setting in settings:
            title = f"best {setting.label}"
            yield (
                Impossible(title, setting.reason)
                if setting.best is None
                else self.option(title, self.best(setting), bounded_by=setting.bound)
            )
        yield self.period("smallest period", {})
        for setting in settings:
            if setting.values:
                yield self.period(f"smallest period, best {setting.label}", self.best(setting))
        yield self.ratio("smallest slice ratio")
        yield self.payload("largest payload")
        yield self.nodes("most nodes", goal)
        for setting in settings:
            wanted = setting.best if setting.follows is None else setting.follows
            if setting.best is not None and wanted is not None and _differing(goal, {setting.key: wanted}):
                title = f"most nodes, best {setting.label}"
                yield self.nodes(title, override(goal, {setting.key: wanted}), setting=setting)

    @staticmethod
    def best(setting: Setting) -> Changes:
        """The change to the best value of a setting; empty if it has that value."""
        return {} if setting.best is None or not setting.values else {setting.key: setting.best}

    def recommended(self, *, keep: set[str]) -> Option | None:
        """The cheapest change that makes a plan, of those that leave some keys alone."""
        for change in changes_to_fit(self.goal):
            changes = dict(change.changes)
            if keep & set(changes):
                continue
            bounded_by, proven = None, True
            if "cycle.period_us" in changes:
                del changes["cycle.period_us"]
                found = smallest_period(
                    override(self.goal, dict(changes)),
                    circle=self.circle,
                    max_circles=self.max_circles,
                )
                if found.period_us is None:
                    continue
                changes["cycle.period_us"] = found.period_us
                bounded_by, proven = found.bounded_by, found.proven
            option = self.option(_CHEAPEST, changes, bounded_by=bounded_by, proven=proven)
            if option.is_plan:
                return option._replace(recommended=True)
        return None

    def option(self, title: str, changes: Changes, *, bounded_by: str | None = None, proven: bool = True) -> Option:
        """Put changes into the goal and compute its figures."""
        changed = override(self.goal, dict(changes))
        deciding = figures(changed, model=self.model)
        others = (model for model in model_names(changed) if model != self.model)
        return Option(
            title=title,
            changes=changes,
            profile=changed,
            deciding=deciding,
            others=tuple(figures(changed, model=model) for model in others),
            bounded_by=bounded_by,
            circle_failures=self.circle(changed) if self.circle and deciding.verdict == FITS else None,
            proven=proven,
        )

    def fitting(self, title: str, changes: Changes, *, bounded_by: str, proven: bool = True) -> Option | Impossible:
        """An option, unless it breaks a limit of the bus."""
        broken = broken_limits(override(self.goal, dict(changes)))
        if broken:
            return Impossible(title, f"the {bus_of(self.goal).limits_of}'s limit of {' and '.join(broken)} is broken")
        return self.option(title, changes, bounded_by=bounded_by, proven=proven)

    def period(self, title: str, changes: Changes) -> Option | Impossible:
        changed = override(self.goal, dict(changes))
        if broken_limits(changed):
            return self.fitting(title, changes, bounded_by="time")
        found = smallest_period(changed, circle=self.circle, max_circles=self.max_circles)
        if found.period_us is None:
            too_long = f"it would be over {MAX_TIME_US / 1e6:g} s"
            reason = "no period passes the circle" if found.bounded_by == "circle" else too_long
            return Impossible(title, reason, found.proven)
        changes = {**changes, "cycle.period_us": found.period_us}
        return self.fitting(title, changes, bounded_by=found.bounded_by, proven=found.proven)

    def ratio(self, title: str) -> Option | Impossible:
        ratio = smallest_ratio(self.goal)
        if ratio > 1:
            needed_us = safe_required_us(self.goal)
            return Impossible(title, f"the cycle needs {needed_us:.3f} us to be shown to fit, over the period")
        return self.fitting(title, {"cycle.slice_ratio": ratio}, bounded_by="time")

    def payload(self, title: str) -> Option | Impossible:
        if self.goal.alike_nodes[0].payload.follows_axes:
            return Impossible(title, "the payload follows the axes of a node")
        size, bounded_by = largest_payload(self.goal)
        if not size:
            reason = (
                "the execution table holds no whole step of the payload"
                if bounded_by == "execution"
                else "not even the smallest fits"
            )
            return Impossible(title, reason)
        changes: Changes = {"payload.read_bytes": size, "payload.write_bytes": size}
        return self.fitting(title, changes, bounded_by=bounded_by)

    def nodes(self, title: str, profile: Profile, *, setting: Setting | None = None) -> Option | Impossible:
        nodes, bounded_by = safe_nodes(profile)
        if not nodes:
            reason = "no node fits" if bounded_by == "time" else f"limited by {bounded_by}"
            return Impossible(title, reason)
        changes: Changes = {"bus.nodes": nodes}
        if setting is not None:
            settings = bus_of(profile).settings(network_of(profile).with_nodes(nodes))
            changes |= {one.key: one.best for one in settings if one.key == setting.key and one.best is not None}
        return self.fitting(title, changes, bounded_by=bounded_by)
