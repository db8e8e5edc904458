"""A sweep as asked for: its keys, values and columns, checked."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from busplan.buses.figure import Figure, by_key
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.questions.circle.figures import CIRCLE_FIGURES
from busplan.questions.fit.figures import COUNTS
from busplan.questions.fit.network import bus_of
from busplan.questions.sweep.blocks import figure_names, word_figures
from busplan.questions.sweep.circles import CIRCLE_COLUMNS, require_few
from busplan.questions.sweep.grid import Grid, Values, checked_grid, grid_models
from busplan.questions.sweep.seeds_run import SEED, SUMMARY_COLUMNS, SUMMARY_FIGURES, without_seed
from busplan.questions.sweep.values import axis_values
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
    circle: bool = False
    """If True, the circle test of each point is run."""

    @property
    def numbers(self) -> tuple[str, ...]:
        """Columns in numbers."""
        words = {*word_figures(self.profile), *(key for key, axis in self.grid.axes.items() if axis.has_words)}
        return tuple(name for name in self.columns if name not in words)

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


def checked_sweep(
    profile: Profile,
    vary: Mapping[str, str | Iterable[object]],
    *,
    timing_models: Sequence[str] | None,
    circle: bool,
    summary: bool,
    force: bool,
    changes: KeyChanges = NO_CHANGES,
) -> Sweep:
    """Check what is asked of a sweep.

    Parameters
    ----------
    profile
        The network, with its changes.
    vary
        Values by dotted key, as `sweep` takes them.
    timing_models
        Names of timing models; by default all that can express every value.
    circle, summary, force
        Run circle tests, summarise them over seeds, and run any number of them.
    changes
        The changes of the profile, for the answer to name them.

    Returns
    -------
    Sweep
        With all columns.

    Raises
    ------
    BusplanError
        As `axis_values`, `checked_grid`, `without_seed`, `grid_models` and `require_few`.
    """
    axes = {key: axis_values(profile, key, given, name="vary") for key, given in vary.items()}
    grid = checked_grid(profile, axes, with_circle=circle, option="vary", circle_option="circle=True")
    grid, seeds = without_seed(grid, option="summary=True") if summary else (grid, None)
    models = grid_models(profile, grid, timing_models, name="timing_model")
    of_circle = (SUMMARY_COLUMNS if summary else CIRCLE_COLUMNS) if circle else ()
    sweep = Sweep(profile, grid, models, (*grid.axes, *figure_names(profile), *of_circle), seeds, changes, circle)
    if circle and not force:
        require_few(grid, seeds=sweep.tests_each, option="circle=True", consent="force=True")
    return sweep


def column_figures(profile: Profile) -> dict[str, Figure]:
    """The registered figures of a sweep's columns, those of groups with the name of the group."""
    figures = by_key((*CIRCLE_FIGURES, *SUMMARY_FIGURES, *bus_of(profile).figures.capacity))
    groups = {
        f"group.{group.name}.{key}": figures[key]._replace(label=f"{figures[key].label} of {group.name}")
        for group in profile.group
        for key in COUNTS
    }
    return {**figures, **groups}
