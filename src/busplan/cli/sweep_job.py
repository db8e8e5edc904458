"""What a sweep is asked for, each value checked."""

from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, get_args

from busplan.forms import Form

if TYPE_CHECKING:
    from busplan.analysis.sweep.grid import Grid
    from busplan.sections.profile import Profile

RowsForm = Literal["csv", "json", "jsonl"]
"""Forms of every row as text, written as it comes."""
SweepForm = Literal[Form, RowsForm]
ROWS_FORMS: Final = get_args(RowsForm)
TOP_FORMS: Final = tuple(form for form in get_args(Form) if form not in ROWS_FORMS)
"""Forms of the rows at the top, for people."""


class SweepJob(NamedTuple):
    """What is asked for, each value checked."""

    profile: "Profile"
    grid: "Grid"
    timing_models: tuple[str, ...]
    columns: tuple[str, ...]
    form: SweepForm
    output: Path | None
    top: int
    sort_by: str | None
    ascending: bool
    plot: Path | None
    plot_format: str | None
    figure: str
    jobs: int | None
    """Processes for circle tests; None without them."""
    force: bool
    """Whether their number does not matter."""
