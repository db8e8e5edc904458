"""`busplan capacity` for people."""

from collections.abc import Sequence
from typing import Final

from busplan.analysis.capacity import Capacity, CapacityFigures
from busplan.analysis.verdict import Verdict
from busplan.report.lines import BLANK, GridRow, Line, count, grid, percent, plural, us, yes
from busplan.report.words import verdict_lines

CAPACITY_ROWS: Final = (
    GridRow("available alpha T_s", "(1)", "us", "available_us", us),
    GridRow("required N T_cs", "(2)", "us", "required_us", us),
    GridRow("  arbitration", "(4)", "us", "cycle_arbitration_us", us),
    GridRow("  data", "(5)", "us", "cycle_data_us", us),
    GridRow("  acknowledge", "(6) (9)", "us", "cycle_acknowledge_us", us),
    GridRow("  execution", "measured", "us", "cycle_execution_us", us),
    GridRow("  gaps", "(10)", "us", "cycle_gaps_us", us),
    GridRow("  synchronous packet CTS", "measured", "us", "sync_us", us),
    GridRow("  non-periodic T_npd", "profile", "us", "nonperiodic_us", us),
    GridRow("margin", "(1) (2)", "us", "margin_us", us),
    GridRow("utilisation", "(1) (2)", "%", "utilisation", percent),
    GridRow("time slice T_cs, given", "(1)", "us", "time_slice_us", us),
    GridRow("time slice T_cs, needed", "(2)", "us", "required_time_slice_us", us),
    GridRow("read latency T_lant", "(3)", "us", "read_latency_us", us),
    GridRow("write latency T_lant", "(3)", "us", "write_latency_us", us),
    GridRow("gaps T_sum, each transaction", "(10)", "us", "gaps_us", us),
    GridRow("smallest period", "(1) (2)", "us", "min_period_us", us),
    GridRow("smallest slice ratio alpha", "(1) (2)", "1", "min_slice_ratio", lambda value: f"{value:.4f}"),
    GridRow("nodes N as published", "(11)", "nodes", "nodes_eq11", lambda value: f"{value:.2f}"),
    GridRow("most nodes", "(1) (2)", "nodes", "max_nodes", count),
    GridRow("most axes", "(1) (2)", "axes", "max_axes", count),
    GridRow("smallest safe gap count", "table", "1", "safe_gap_count", count),
    GridRow("limited by", "", "", "limited_by", str),
    GridRow("fits", "", "", "fits", yes),
)


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
    return grid(heading, [(one.timing_model, one) for one in figures], CAPACITY_ROWS)
