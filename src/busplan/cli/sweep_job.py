"""The checked options of a sweep."""

from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, get_args

from busplan.forms import Form, Picture, RowsForm
from busplan.profile.changes import KeyChanges

if TYPE_CHECKING:
    from busplan.analysis.sweep.grid import Grid, Values
    from busplan.sections.profile import Profile

SweepForm = Literal[Form, RowsForm]
ROWS_FORMS: Final = get_args(RowsForm)
TOP_FORMS: Final = tuple(form for form in get_args(Form) if form not in ROWS_FORMS)
"""Forms with the top rows, for people."""


class SweepJob(NamedTuple):
    """The checked options of a sweep."""

    profile: "Profile"
    changes: KeyChanges
    """KeyChanges of the profile, applied."""
    grid: "Grid"
    """Of the points of the rows."""
    seeds: "Values | None"
    """Seeds that each row is over; None without --summary."""
    timing_models: tuple[str, ...]
    columns: tuple[str, ...]
    form: SweepForm
    output: Path | None
    top: int
    is_whole: bool
    """If True, a narrow terminal leaves out no column of the top rows."""
    sort_by: str | None
    ascending: bool
    plot: Path | None
    plot_form: Picture | None
    figure: str | None
    """Column of the picture; None for the default one."""
    jobs: int | None
    """Processes for circle tests, where there is no cluster; None without circle tests."""
    force: bool
    """If True, allow any number of circle tests."""
    cluster: str | None
    """Address of a Dask scheduler whose workers run the circle tests."""
    resume: bool
    """If True, go on with the parts of a sweep that did not end."""

    @property
    def tests(self) -> int | None:
        """Seeds of each row; None without --summary."""
        return None if self.seeds is None else self.seeds.size
