"""What is asked of a sweep, checked."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from busplan.buses.figure import Figure, by_key
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.questions.circle.figures import CIRCLE_FIGURES
from busplan.questions.fit.figures import COUNTS
from busplan.questions.fit.network import bus_of
from busplan.questions.sweep.blocks import figure_names
from busplan.questions.sweep.circles import CIRCLE_COLUMNS, require_few
from busplan.questions.sweep.grid import Grid, Values, checked_grid, grid_models
from busplan.questions.sweep.seeds_run import SEED, SUMMARY_COLUMNS, SUMMARY_FIGURES, without_seed
from busplan.sections.profile import Profile


class Sweep(NamedTuple):
    """A table with a row for each point of a grid and each timing model."""

    profile: Profile
    """The network, with its changes."""
    grid: Grid
    """Points of the rows."""
    timing_models: tuple[str, ...]
    columns: tuple[str, ...]
    seeds: Values | None = None
    """Seeds that each row is over; None without a summary."""
    changes: KeyChanges = NO_CHANGES

    @property
    def tests_each(self) -> int:
        """Circle tests of a point, where there are any."""
        return 1 if self.seeds is None else self.seeds.size

    @property
    def tests(self) -> int:
        """All circle tests, where there are any."""
        return self.grid.points * self.tests_each

    def test_points(self) -> Iterator[dict[str, object]]:
        """Values of the varied keys of each circle test, in the order of the grid; seeds change fastest."""
        return (self.grid if self.seeds is None else Grid({**self.grid.axes, SEED: self.seeds})).each_point()


class Names(NamedTuple):
    """Names of options in messages."""

    vary: str = "--vary"
    timing: str = "--timing"
    circle: str = "--circle"
    summary: str = "--summary"
    force: str = "--force"


def checked_sweep(
    profile: Profile,
    axes: Mapping[str, Values],
    *,
    timing_models: Sequence[str] | None,
    circle: bool,
    summary: bool,
    force: bool,
    names: Names,
) -> Sweep:
    """Check what is asked of a sweep.

    Parameters
    ----------
    profile
        The network.
    axes
        Values by dotted key.
    timing_models
        Names of timing models; by default all that can express every value.
    circle, summary, force
        Run circle tests, summarise them over seeds, and run any number of them.
    names
        Names of these in messages.

    Returns
    -------
    Sweep
        With all columns.

    Raises
    ------
    BusplanError
        As `checked_grid`, `without_seed`, `grid_models` and `require_few`.
    """
    grid = checked_grid(profile, axes, with_circle=circle, option=names.vary, circle_option=names.circle)
    grid, seeds = without_seed(grid, option=names.summary) if summary else (grid, None)
    models = grid_models(profile, grid, timing_models, name=names.timing)
    of_circle = (SUMMARY_COLUMNS if summary else CIRCLE_COLUMNS) if circle else ()
    sweep = Sweep(profile, grid, models, (*grid.axes, *figure_names(profile), *of_circle), seeds)
    if circle and not force:
        require_few(grid, seeds=sweep.tests_each, option=names.circle, consent=names.force)
    return sweep


def column_figures(profile: Profile) -> dict[str, Figure]:
    """The registered figures of a sweep's columns, those of groups with the name of the group."""
    found = by_key((*CIRCLE_FIGURES, *SUMMARY_FIGURES, *bus_of(profile).capacity_figures))
    groups = {
        f"group.{one.name}.{key}": found[key]._replace(label=f"{found[key].label} of {one.name}")
        for one in profile.group
        for key in COUNTS
    }
    return {**found, **groups}
