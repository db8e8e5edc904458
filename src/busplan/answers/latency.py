"""`busplan latency` for people."""

from collections.abc import Sequence
from itertools import groupby

from busplan.analysis.latency import LatencyResult, Transaction, with_payload
from busplan.analysis.network import bus_of, network_of
from busplan.answers.verdict_sentences import execution_line, warnings
from busplan.buses.bus import Bus
from busplan.buses.figure import REQUIRED
from busplan.forms.lines import BLANK, GridRow, Line, figure_row, grid
from busplan.sections.profile import Profile


def latency_table_rows(bus: Bus) -> tuple[GridRow, ...]:
    """Rows of the table: each phase of a transaction, all of them in us."""
    figures = (*bus.term_figures, REQUIRED) if bus.latency_table_figures is None else bus.latency_table_figures
    return tuple(figure_row(figure)._replace(unit="") for figure in figures)


def latency_lines(result: LatencyResult, profile: Profile) -> list[Line]:
    """Phases of each transaction, the models side by side; one table for each payload."""
    bus = bus_of(profile)
    rows = latency_table_rows(bus)
    lines: list[Line] = []
    for _, group in groupby(_numbered(result.transactions), key=lambda pair: pair[0]):
        lines.extend((*grid("phase, us", [_column(one) for _, one in group], rows), BLANK))
    network = network_of(profile)
    lines.append(Line(f"{result.profile}: {bus.latency_subject(network)}."))
    lines.extend(execution_line(profile))
    lines.extend(Line(f"Warning: {words}.", "warning") for words in _over(result, profile))
    lines.extend(Line(warning, "warning") for warning in warnings(profile, nodes=network.nodes, most=0))
    return lines


def _numbered(transactions: Sequence[Transaction]) -> list[tuple[int, Transaction]]:
    """Each transaction with the number of its table: one that is there already begins a new one."""
    found: list[tuple[int, Transaction]] = []
    seen: set[tuple[str, str]] = set()
    number = 0
    for one in transactions:
        key = (one.timing_model, one.transaction)
        if key in seen:
            number, seen = number + 1, set()
        seen.add(key)
        found.append((number, one))
    return found


def _column(one: Transaction) -> tuple[str, object]:
    payload = "" if one.payload_bytes is None else f" {one.payload_bytes} B"
    return f"{one.transaction}{payload}\n{one.timing_model}", one.phases


def _over(result: LatencyResult, profile: Profile) -> list[str]:
    """The limits of the bus that the profile breaks with each of the payloads."""
    sizes = sorted({one.payload_bytes for one in result.transactions if one.payload_bytes is not None})
    networks = [network_of(with_payload(profile, size)) for size in sizes] or [network_of(profile)]
    broken = (limit.words(network) for network in networks for limit in bus_of(profile).broken(network))
    return list(dict.fromkeys(broken))
