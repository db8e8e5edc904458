"""A sweep as asked for: its keys, values and columns, checked."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from busplan.buses.figure import Figure, by_key
from busplan.buses.network import Network
from busplan.errors import BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.questions.circle import CIRCLE_FIGURES
from busplan.questions.fit.figures import COUNTS
from busplan.questions.fit.network import varied_nodes
from busplan.questions.sweep.circles import CIRCLE_COLUMNS, require_few
from busplan.questions.sweep.grid import Array, Grid, axis_values, checked_grid, grid_models
from busplan.questions.sweep.seeds_run import SEED, SUMMARY_COLUMNS, SUMMARY_FIGURES, without_seed
from busplan.questions.sweep.table import figure_names
from busplan.sections.profile import Profile


class Sweep(NamedTuple):
    """A table with a row for each point of a grid and each timing model, as it is asked for."""

    network: Network
    """The network, with its changes."""
    grid: Grid
    """Points of the rows."""
    timing_models: tuple[str, ...]
    group: str
    """Group whose nodes vary for the most nodes and axes of the whole; empty where all nodes are alike."""
    circle: bool = False
    """If True, the circle test of each point is run."""
    seeds: Array | None = None
    """Seeds that each row is over; None without a summary."""
    changes: KeyChanges = NO_CHANGES

    @property
    def profile(self) -> Profile:
        """The profile of the network."""
        profile: Profile = self.network.profile
        return profile

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns: the varied keys, the figures of `capacity`, and those of circle tests."""
        of_circle = CIRCLE_COLUMNS if self.seeds is None else SUMMARY_COLUMNS
        return (*self.grid.axes, *figure_names(self.network), *(of_circle if self.circle else ()))

    @property
    def numbers(self) -> tuple[str, ...]:
        """Columns in numbers."""
        figures, axes = column_figures(self.network), self.grid.axes
        is_word = {
            name: axes[name].dtype == object if name in axes else "word" in figures[name].sort for name in self.columns
        }
        return tuple(name for name in self.columns if not is_word[name])

    def require_columns(self, columns: Iterable[str], *, name: str) -> None:
        """Refuse columns that do not exist.

        Parameters
        ----------
        columns
            Their names.
        name
            Name of the argument in messages.
        """
        for column in columns:
            if column not in self.columns:
                raise BusplanError(f"{name} {column}: no such column; there are {', '.join(self.columns)}")

    def require_number(self, column: str | None, *, name: str) -> None:
        """Refuse a column that does not exist or is not numeric; None is none."""
        if column is not None and column not in self.numbers:
            raise BusplanError(f"{name} {column}: expected a column in numbers: {', '.join(self.numbers)}")

    @property
    def tests(self) -> Grid:
        """Points of the circle tests, where there are any; seeds change fastest."""
        return self.grid if self.seeds is None else Grid({**self.grid.axes, SEED: self.seeds})


def checked_sweep(
    network: Network,
    vary: Mapping[str, str | Iterable[object]],
    *,
    timing_models: Sequence[str] | None,
    group: str | None,
    circle: bool,
    summary: bool,
    force: bool,
    changes: KeyChanges = NO_CHANGES,
) -> Sweep:
    """Check what is asked of a sweep.

    Parameters
    ----------
    network
        The network, with its changes.
    vary
        Values by dotted key, as `sweep` takes them.
    timing_models
        Names of timing models; by default all that can express every value.
    group
        Name of the group whose nodes vary for the most nodes and axes; by default that with the most axes.
    circle, summary, force
        Run circle tests, summarise them over seeds, and run any number of them.
    changes
        The changes of the profile, for the answer to name them.

    Raises
    ------
    BusplanError
        No such group; as `axis_values`, `checked_grid`, `without_seed`, `grid_models` and `require_few`.
    """
    if summary and not circle:
        raise BusplanError("summary: goes with circle")
    profile = network.profile
    names = [own.name for own in profile.group]
    if group is not None and group not in names:
        known = f"the groups {', '.join(names)}" if names else "no groups"
        raise BusplanError(f"group {group}: {profile.name} has {known}")
    axes = {key: axis_values(profile, key, given, name="vary") for key, given in vary.items()}
    grid = checked_grid(profile, axes, with_circle=circle)
    grid, seeds = without_seed(grid) if summary else (grid, None)
    models = grid_models(network, grid, timing_models)
    varied = group or (varied_nodes(profile).name if names else "")
    if circle and not force:
        require_few(grid, seeds=1 if seeds is None else seeds.size)
    return Sweep(network, grid, models, varied, circle, seeds, changes)


def column_figures(network: Network) -> dict[str, Figure]:
    """The registered figures of a sweep's columns, those of groups with the name of the group."""
    figures = by_key((*CIRCLE_FIGURES, *SUMMARY_FIGURES, *network.bus.figures.capacity))
    groups = {
        f"group.{group.name}.{key}": figures[key]._replace(label=f"{figures[key].label} of {group.name}")
        for group in network.profile.group
        for key in COUNTS
    }
    return {**figures, **groups}
