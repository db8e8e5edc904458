"""What a sweep is asked for, each value checked."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    from busplan.analysis.sweep.grid import Grid
    from busplan.sections.profile import Profile

SweepFormat = Literal["table", "csv", "json", "jsonl", "npz"]


class SweepJob(NamedTuple):
    """What is asked for, each value checked."""

    profile: "Profile"
    grid: "Grid"
    timing_models: tuple[str, ...]
    columns: tuple[str, ...]
    format_: SweepFormat
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
