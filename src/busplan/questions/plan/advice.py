"""The change that mends a profile: `capacity` and `check` give the same one, that of `plan`."""

from typing import Final, NamedTuple

from busplan.buses.parts import Value
from busplan.profile.toml import override
from busplan.questions.circle.check import failures_within, rests_on
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.figures import CapacityFigures, FitFigures, figures
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.fit.node_limit import safe_nodes
from busplan.questions.plan.constraints import with_nodes
from busplan.questions.plan.freedoms import freed
from busplan.questions.plan.search import Search
from busplan.sections.base import MAX_COUNT
from busplan.sections.profile import Profile

UNTESTED_CIRCLE: Final = "this changes the circle, which is not simulated here"
"""Words for a change whose circle was not tested."""


class Change(NamedTuple):
    """A change of a profile, and its effect."""

    changes: dict[str, Value]
    """New value by dotted key, the dearest change first."""
    nodes: int
    """Nodes that the change is made for."""
    figures: FitFigures
    """Whether it fits after it, under the model that decides."""
    safe_nodes: int | None
    """Most nodes that are shown to fit after it; None where a person is not told of it: without further nodes, or where
    there is room without a change."""
    safe_axes: int | None
    circle_is_untested: bool
    """Whether the change alters the circle, which was not simulated."""


class Cure(NamedTuple):
    """Change after which a profile holds every constraint."""

    changes: dict[str, Value] | None
    """New value by dotted key, the dearest change first; empty if nothing is to change, None if no change is enough."""
    why: str = ""
    """Reason that no change is enough."""
    circle_failures: tuple[str, ...] | None = ()
    """Limits that the circle breaks after it; None where the change alters the circle, which was not simulated."""


def changeable(profile: Profile) -> tuple[str, ...]:
    """Default freedoms of a plan, in words, the cheapest first."""
    return tuple(freedom.label for freedom in freed(profile, None))


def cure(profile: Profile, *, circle_steps: int | None = None) -> Cure:
    """Find the least change after which a profile holds every constraint but its circle.

    At most one circle is simulated: the one after the change, if the change alters it.

    Parameters
    ----------
    profile
        The network.
    circle_steps
        Most simulated steps of each axis of that circle; None for no simulation.
    """
    search, levels = Search(profile), freed(profile, None)
    least = search.least(levels)
    if least is None:
        return Cure(None, search.binding(levels).why)
    changes, after = dict(least), search.profile(least)
    if not profile.asks_for_circle or rests_on(after) == rests_on(profile):
        return Cure(changes)
    failures = None if circle_steps is None else failures_within(after, most_steps=circle_steps)
    return Cure(changes, circle_failures=failures)


def advice(profile: Profile, now: CapacityFigures) -> tuple[Change | None, str]:
    """Find the least change that meets every constraint of a plan or, where all are met, makes room for another node.

    No circle is simulated.

    Parameters
    ----------
    profile
        The network.
    now
        Its figures under the model that decides.

    Returns
    -------
    tuple
        The change, and the reason where there is none; where groups differ, none is looked for and the reason is empty.
    """
    own = cure(profile)
    if own.changes is None or own.changes:
        return _change(profile, own, nodes=now.nodes), own.why
    if now.safe_nodes is None:
        return None, ""  # nobody said which of the groups is to grow
    nodes = now.safe_nodes + 1
    if nodes > MAX_COUNT:
        return None, f"{MAX_COUNT} nodes are the most of a profile"
    more = cure(override(profile, dict(with_nodes(nodes))))
    has_room = now.verdict == FITS and now.safe and not now.circle_refused_by and now.safe_nodes > now.nodes
    return _change(profile, more, nodes=nodes, counts=not has_room), more.why


def _change(profile: Profile, cure: Cure, *, nodes: int, counts: bool = False) -> Change | None:
    if cure.changes is None:
        return None
    after = override(profile, dict(cure.changes))
    network = network_of(after)
    fit = figures(network, model=bus_of(after).deciding_model)
    most = safe_nodes(network)[0] if counts else None
    axes = None if most is None else most * after.alike_nodes[0].node.axes
    return Change(cure.changes, nodes, fit, most, axes, circle_is_untested=cure.circle_failures is None)
