"""`busplan capacity` for people."""

from collections.abc import Sequence

from busplan.analysis.capacity.figures import Capacity, CapacityFigures
from busplan.analysis.capacity.verdict import Verdict
from busplan.analysis.network import bus_of, network_of
from busplan.answers.verdict_sentences import verdict_lines
from busplan.buses import figure
from busplan.buses.bus import Bus
from busplan.forms.lines import BLANK, GridRow, Line, figure_row, grid, plural
from busplan.sections.profile import Profile


def capacity_table_rows(bus: Bus) -> tuple[GridRow, ...]:
    """Rows of the table: the cycle and its terms, the slice, what the kind of bus adds, and what would fit."""
    return (
        *map(figure_row, (figure.AVAILABLE, figure.REQUIRED)),
        *(figure_row(term, level=1) for term in bus.term_figures),
        *map(figure_row, (figure.MARGIN, figure.UTILISATION, figure.TIME_SLICE, figure.REQUIRED_TIME_SLICE)),
        *map(figure_row, bus.table_figures),
        *map(figure_row, (figure.MIN_PERIOD, figure.MIN_SLICE_RATIO, figure.MAX_NODES, figure.MAX_AXES)),
        *map(figure_row, (figure.LIMITED_BY, figure.FITS)),
    )


def capacity_lines(result: Capacity, verdicts: Sequence[Verdict]) -> list[Line]:
    """Verdict and figures of each period, the models side by side."""
    lines: list[Line] = []
    for figures, verdict in zip(result.periods, verdicts, strict=True):
        if lines:
            lines.append(BLANK)
        lines.extend((*verdict_lines(verdict, result.profile), BLANK, *_grid(result.profile, figures)))
    return lines


def _grid(profile: Profile, figures: Sequence[CapacityFigures]) -> list[Line]:
    first, bus = figures[0], bus_of(profile)
    setup = ", ".join(bus.setup_words(network_of(profile)))
    heading = f"{plural(first.nodes, 'node')}, {plural(first.axes, 'axis')}\n{setup}"
    return grid(heading, [(one.timing_model, one) for one in figures], capacity_table_rows(bus))
