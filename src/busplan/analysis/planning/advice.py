"""What to change in a profile: the one answer of `capacity` and of `check`, which is that of `plan`."""

from typing import NamedTuple

from busplan.analysis.capacity.certainty import FITS
from busplan.analysis.capacity.figures import CapacityFigures, figures
from busplan.analysis.circle.check import MOST_STEPS, CircleCheck
from busplan.analysis.network import bus_of
from busplan.analysis.planning.freedoms import freed
from busplan.analysis.planning.machine import with_nodes
from busplan.analysis.planning.search import Search
from busplan.buses.parts import Value
from busplan.profile.toml import override
from busplan.sections.base import MAX_COUNT
from busplan.sections.profile import Profile


class Change(NamedTuple):
    """A change of a profile, and its effect."""

    changes: dict[str, Value]
    """New value by dotted key, the dearest change first."""
    nodes: int
    """Nodes that the change is made for."""
    figures: CapacityFigures
    """The capacity after it, under the model that decides."""


class Cure(NamedTuple):
    """What to change for a profile to hold every constraint."""

    changes: dict[str, Value] | None
    """New value by dotted key, the dearest change first; empty if nothing is to change, None if no change is enough."""
    why: str = ""
    """What stands in the way, if no change is enough."""


def changeable(profile: Profile) -> tuple[str, ...]:
    """What may be changed unless a user says otherwise, in words, the cheapest first."""
    return tuple(one.label for one in freed(profile, None))


def cure(profile: Profile, *, circle: CircleCheck | None) -> Cure:
    """Find the least change after which a profile holds every constraint.

    Parameters
    ----------
    profile
        The network.
    circle
        Runs the circle test; None for none.
    """
    search, levels = Search(profile, circle=circle), freed(profile, None)
    found = search.least(levels)
    return Cure(None, search.binding(levels).why) if found is None else Cure(dict(found))


def advice(profile: Profile, now: CapacityFigures) -> tuple[Change | None, str]:
    """Find the least change after which a profile holds every constraint, or, where it does, has room for a node more.

    The circle of a network that is shown to fit stays as it is, and is not run: `circle-test` is for it. A change that
    gives it another one is advised only if that passes.

    Parameters
    ----------
    profile
        The network.
    now
        Its figures under the model that decides.

    Returns
    -------
    tuple
        The change, None if there is none; and if so, what stands in the way.
    """
    fits = now.verdict == FITS and now.safe
    circle = CircleCheck(most_steps=MOST_STEPS, own=profile, is_taken=fits)
    own = cure(profile, circle=circle)
    if own.changes is None or own.changes:
        return _change(profile, own, nodes=now.nodes), own.why
    if now.safe_nodes is None:
        return None, ""  # nodes differ, and nobody asked for more of which
    nodes = now.safe_nodes + 1
    if nodes > MAX_COUNT:
        return None, f"{MAX_COUNT} nodes are the most of a profile"
    more = cure(override(profile, dict(with_nodes(nodes))), circle=circle)
    return _change(profile, more, nodes=nodes), more.why


def _change(profile: Profile, found: Cure, *, nodes: int) -> Change | None:
    if found.changes is None:
        return None
    after = override(profile, dict(found.changes))
    return Change(found.changes, nodes, figures(after, model=bus_of(after).deciding_model))
