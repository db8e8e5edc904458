"""The columns of a sweep, and their figures."""

from busplan.analysis.capacity.figures import COUNTS
from busplan.analysis.circle.figures import CIRCLE_FIGURES
from busplan.analysis.network import bus_of
from busplan.analysis.sweep.circles import CIRCLE_COLUMNS
from busplan.analysis.sweep.seeds import SUMMARY_COLUMNS, SUMMARY_FIGURES
from busplan.buses.figure import Figure, by_key
from busplan.sections.profile import Profile


def circle_columns(*, circle: bool, summary: bool) -> tuple[str, ...]:
    """Columns of circle tests: of each point's own, or of all its seeds."""
    return (SUMMARY_COLUMNS if summary else CIRCLE_COLUMNS) if circle else ()


def column_figures(profile: Profile) -> dict[str, Figure]:
    """The registered figures of a sweep's columns, those of groups with the name of the group."""
    found = by_key((*CIRCLE_FIGURES, *SUMMARY_FIGURES, *bus_of(profile).capacity_figures))
    groups = {
        f"group.{one.name}.{key}": found[key]._replace(label=f"{found[key].label} of {one.name}")
        for one in profile.group
        for key in COUNTS
    }
    return {**found, **groups}
