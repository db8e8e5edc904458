"""`busplan capacity` for people."""

from collections.abc import Sequence
from typing import Final

from busplan.analysis.capacity.figures import Capacity, CapacityFigures
from busplan.analysis.capacity.verdict import Verdict
from busplan.analysis.quantities import FIGURES
from busplan.report.lines import BLANK, GridRow, Line, count, grid, percent, plural, us, yes
from busplan.report.words import verdict_lines

CAPACITY_ROWS: Final = (
    GridRow("available alpha T_s", "us", "available_us", us),
    GridRow("required N T_cs", "us", "required_us", us),
    GridRow("  arbitration", "us", "cycle_arbitration_us", us),
    GridRow("  data", "us", "cycle_data_us", us),
    GridRow("  acknowledge", "us", "cycle_acknowledge_us", us),
    GridRow("  execution", "us", "cycle_execution_us", us),
    GridRow("  gaps", "us", "cycle_gaps_us", us),
    GridRow("  synchronous packet CTS", "us", "sync_us", us),
    GridRow("  non-periodic T_npd", "us", "nonperiodic_us", us),
    GridRow("margin", "us", "margin_us", us),
    GridRow("utilisation", "%", "utilisation", percent),
    GridRow("time slice T_cs, given", "us", "time_slice_us", us),
    GridRow("time slice T_cs, needed", "us", "required_time_slice_us", us),
    GridRow("read latency T_lant", "us", "read_latency_us", us),
    GridRow("write latency T_lant", "us", "write_latency_us", us),
    GridRow("gaps T_sum, each transaction", "us", "gaps_us", us),
    GridRow("smallest period", "us", "min_period_us", us),
    GridRow("smallest slice ratio alpha", "1", "min_slice_ratio", lambda value: f"{value:.4f}"),
    GridRow("nodes N as published", "nodes", "nodes_eq11", lambda value: f"{value:.2f}"),
    GridRow("most nodes", "nodes", "max_nodes", count),
    GridRow("most axes", "axes", "max_axes", count),
    GridRow("smallest safe gap count", "1", "safe_gap_count", count),
    GridRow("limited by", "", "limited_by", str),
    GridRow("fits", "", "fits", yes),
)
"""How each figure is called and written."""


def capacity_lines(result: Capacity, verdicts: Sequence[Verdict]) -> list[Line]:
    """Verdict and figures of each period, the models side by side."""
    lines: list[Line] = []
    for figures, verdict in zip(result.periods, verdicts, strict=True):
        if lines:
            lines.append(BLANK)
        lines.extend((*verdict_lines(verdict, result.profile), BLANK, *_grid(figures)))
    return lines


def _grid(figures: Sequence[CapacityFigures]) -> list[Line]:
    first = figures[0]
    nodes = f"{plural(first.nodes, 'node')}, {plural(first.axes, 'axis')}"
    heading = f"{nodes}\n{plural(first.hops, 'hop')}, gap count {first.gap_count}"
    return grid(heading, [(one.timing_model, one) for one in figures], CAPACITY_ROWS, figures=FIGURES["capacity"])
