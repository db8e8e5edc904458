"""`busplan latency` for people."""

from collections.abc import Sequence
from typing import Final

from busplan.analysis.latency import LatencyResult, Transaction
from busplan.analysis.quantities import FIGURES
from busplan.buses.ieee1394.constants import MAX_HOPS
from busplan.profile.model import Profile
from busplan.report.lines import BLANK, GridRow, Line, count, grid, plural, us
from busplan.report.words import execution_line, warnings

LATENCY_ROWS: Final = (
    GridRow("request packet, bytes", "", "request_bytes", count),
    GridRow("response packet, bytes", "", "response_bytes", count),
    GridRow("arbitration, each", "", "arbitration_us", us),
    GridRow("data, request", "", "request_data_us", us),
    GridRow("data, response", "", "response_data_us", us),
    GridRow("acknowledge, each", "", "acknowledge_us", us),
    GridRow("request T_req", "", "request_us", us),
    GridRow("response T_resp", "", "response_us", us),
    GridRow("T1+T2", "", "request_and_acknowledge_us", us),
    GridRow("execution T_exec = T3", "", "execution_us", us),
    GridRow("T4+T5", "", "response_and_acknowledge_us", us),
    GridRow("latency T_lant", "", "latency_us", us),
    GridRow("subaction gap", "", "subaction_gap_us", us),
    GridRow("arbitration reset gap", "", "arbitration_reset_gap_us", us),
    GridRow("gaps T_sum", "", "gaps_us", us),
    GridRow("T_lant + T_sum", "", "latency_with_gaps_us", us),
)


def latency_lines(result: LatencyResult, profile: Profile) -> list[Line]:
    """Phases of each transaction, read and write and the models side by side; one table for each payload."""
    models = len({one.timing_model for one in result.transactions})
    size = 2 * models
    lines: list[Line] = []
    for at in range(0, len(result.transactions), size):
        lines.extend((*_grid(result.transactions[at : at + size]), BLANK))
    first = result.transactions[0]
    lines.append(
        Line(
            f"{result.profile}: farthest of {plural(first.nodes, 'node')}, {plural(first.hops, 'hop')}, "
            f"gap count {first.gap_count}."
        )
    )
    lines.extend(execution_line(profile))
    over = sorted(
        {one.payload_bytes for one in result.transactions if one.payload_bytes > profile.bus.max_payload_bytes}
    )
    if over:
        limit = f"{profile.bus.max_payload_bytes} bytes of {profile.bus.speed}"
        lines.append(Line(f"Warning: over the {limit}: {', '.join(map(str, over))}.", "warning"))
    if first.hops > MAX_HOPS:
        lines.append(Line(f"Warning: {first.hops} hops are over the {MAX_HOPS:g} of one bus.", "warning"))
    lines.extend(Line(warning, "warning") for warning in warnings(profile, nodes=first.nodes, most=0))
    return lines


def _grid(transactions: Sequence[Transaction]) -> list[Line]:
    columns = [(f"{one.transaction} {one.payload_bytes} B\n{one.timing_model}", one.phases) for one in transactions]
    return grid("phase, us", columns, LATENCY_ROWS, figures=FIGURES["latency"])
