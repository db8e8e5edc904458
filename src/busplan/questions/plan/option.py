"""One way to set a network, computed with it in place."""

from typing import NamedTuple

from busplan.buses.parts import Value
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.figures import CapacityFigures, figures
from busplan.questions.fit.network import bus_of, model_names
from busplan.questions.plan.machine import Changes
from busplan.questions.plan.search import Search
from busplan.sections.profile import Profile


class Option(NamedTuple):
    """One way to set the network, computed with it in place."""

    title: str
    changes: dict[str, Value]
    """Keys that the option changes in the goal, with their new values, the dearest change first."""
    profile: Profile
    """The goal with the changes."""
    deciding: CapacityFigures
    """Capacity under the timing model that decides."""
    others: tuple[CapacityFigures, ...]
    """Capacity under the other timing models."""
    passes: bool
    """Whether every constraint holds: shown to fit, safe, within [limits], and a circle that passes if it was run."""
    held_by: str | None = None
    """The constraint that it breaks, or that keeps its value from being better; None if there is none."""
    circle_failures: tuple[str, ...] | None = None
    """Failures of the circle; None if it was not run."""
    proven: bool = True
    """Whether no smaller change exists; False if the search was cut short."""
    recommended: bool = False

    @property
    def circle_passed(self) -> bool | None:
        """Whether the circle holds its tolerances; None if it was not run, or holds what always judges and has none."""
        if not self.circle_failures and not self.profile.tolerance.judges_contour:
            return None
        return None if self.circle_failures is None else not self.circle_failures


class Impossible(NamedTuple):
    """Something that has no suitable value."""

    title: str
    reason: str
    proven: bool = True
    """Whether no value exists; False if the search was cut short."""


def option(search: Search, title: str, changes: Changes, *, held_by: str | None = None) -> Option:
    """Put changes into the goal of a search and compute its figures.

    Parameters
    ----------
    search
        The search.
    title
        What the option is called.
    changes
        New values by dotted key.
    held_by
        As in `Option`.
    """
    changed = search.profile(changes)
    model = bus_of(changed).deciding_model
    deciding = figures(changed, model=model)
    is_run = search.runs_circle and deciding.verdict == FITS and not deciding.circle_refused_by
    return Option(
        title=title,
        changes=dict(changes),
        profile=changed,
        deciding=deciding,
        others=tuple(figures(changed, model=one) for one in model_names(changed) if one != model),
        passes=search.passes(changes),
        held_by=held_by,
        circle_failures=search.circle_failures(changes) if is_run else None,
        proven=search.proven,
    )
