"""Results as tables for people. Every row names the equation it comes from."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from rich import box
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from busplan.analysis.capacity import Capacity, CapacityFigures
from busplan.analysis.latency import LatencyResult, Transaction
from busplan.analysis.paper import Comparison, PaperSection
from busplan.analysis.verdict import Verdict
from busplan.report.words import Line, Tone, us, verdict_lines

_STYLES: Final[dict[Tone, str]] = {"good": "bold green", "bad": "bold red", "warning": "yellow", "plain": ""}


@dataclass(frozen=True, slots=True)
class _Row:
    """One line of a table: how it is called, where it comes from, and how its value is written."""

    label: str
    equation: str
    unit: str
    key: str
    write: Callable[[Any], str] = us


def _count(value: float) -> str:
    return f"{value:.0f}"


def _percent(value: float) -> str:
    return f"{value * 100:.2f}"


def _yes(value: object) -> str:
    return "yes" if value else "no"


_LATENCY_ROWS: Final = (
    _Row("request packet, bytes", "", "", "request_bytes", _count),
    _Row("response packet, bytes", "", "", "response_bytes", _count),
    _Row("arbitration, each", "(4)", "", "arbitration_us"),
    _Row("data, request", "(5)", "", "request_data_us"),
    _Row("data, response", "(5)", "", "response_data_us"),
    _Row("acknowledge, each", "(6) (9)", "", "acknowledge_us"),
    _Row("request T_req", "(7)", "", "request_us"),
    _Row("response T_resp", "(8)", "", "response_us"),
    _Row("T1+T2", "(13)", "", "request_and_acknowledge_us"),
    _Row("execution T_exec = T3", "measured", "", "execution_us"),
    _Row("T4+T5", "(14)", "", "response_and_acknowledge_us"),
    _Row("latency T_lant", "(3) (12)", "", "latency_us"),
    _Row("subaction gap", "(10)", "", "subaction_gap_us"),
    _Row("arbitration reset gap", "(10)", "", "arbitration_reset_gap_us"),
    _Row("gaps T_sum", "(10)", "", "gaps_us"),
    _Row("T_lant + T_sum", "(3) (10)", "", "latency_with_gaps_us"),
)

_CAPACITY_ROWS: Final = (
    _Row("available alpha T_s", "(1)", "us", "available_us"),
    _Row("required N T_cs", "(2)", "us", "required_us"),
    _Row("  arbitration", "(4)", "us", "cycle_arbitration_us"),
    _Row("  data", "(5)", "us", "cycle_data_us"),
    _Row("  acknowledge", "(6) (9)", "us", "cycle_acknowledge_us"),
    _Row("  execution", "measured", "us", "cycle_execution_us"),
    _Row("  gaps", "(10)", "us", "cycle_gaps_us"),
    _Row("  synchronous packet CTS", "measured", "us", "sync_us"),
    _Row("  non-periodic T_npd", "profile", "us", "nonperiodic_us"),
    _Row("margin", "(1) (2)", "us", "margin_us"),
    _Row("utilisation", "(1) (2)", "%", "utilisation", _percent),
    _Row("time slice T_cs, given", "(1)", "us", "time_slice_us"),
    _Row("time slice T_cs, needed", "(2)", "us", "required_time_slice_us"),
    _Row("read latency T_lant", "(3)", "us", "read_latency_us"),
    _Row("write latency T_lant", "(3)", "us", "write_latency_us"),
    _Row("gaps T_sum, each transaction", "(10)", "us", "gaps_us"),
    _Row("smallest period", "(1) (2)", "us", "min_period_us"),
    _Row("smallest slice ratio alpha", "(1) (2)", "1", "min_slice_ratio", lambda value: f"{value:.4f}"),
    _Row("nodes N as published", "(11)", "nodes", "nodes_eq11", lambda value: f"{value:.2f}"),
    _Row("most nodes", "(1) (2)", "nodes", "max_nodes", _count),
    _Row("most axes", "(1) (2)", "axes", "max_axes", _count),
    _Row("limited by", "", "", "limited_by", str),
    _Row("fits", "", "", "fits", _yes),
)


def _table(text_headings: Sequence[str], number_headings: Sequence[str]) -> Table:
    """An empty table that keeps its width: a figure that was cut would be a wrong one."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, padding=(0, 1, 0, 0))
    for heading in text_headings:
        table.add_column(heading, no_wrap=True)
    for heading in number_headings:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _grid(first_heading: str, columns: Sequence[tuple[str, object]], rows: Sequence[_Row]) -> Table:
    """Rows down, one column of values for each object."""
    has_units = any(row.unit for row in rows)
    table = _table([first_heading, "eq", *(["unit"] if has_units else [])], [heading for heading, _ in columns])
    for row in rows:
        values = (row.write(getattr(owner, row.key)) for _, owner in columns)
        table.add_row(row.label, row.equation, *([row.unit] if has_units else []), *values)
    return table


def _lines(lines: Iterable[Line]) -> list[RenderableType]:
    return [Text(line.text, style=_STYLES[line.tone]) for line in lines]


def latency_table(result: LatencyResult, *, max_payload_bytes: int) -> list[RenderableType]:
    """Phases of each transaction, read and write and the models side by side; one table a payload list entry."""
    models = len({transaction.timing_model for transaction in result.transactions})
    size = 2 * models
    groups = [result.transactions[at : at + size] for at in range(0, len(result.transactions), size)]
    parts: list[RenderableType] = []
    for group in groups:
        parts.extend((_latency_grid(group), Text()))
    first = result.transactions[0]
    parts.append(
        Text(
            f"{result.profile}: farthest of {first.nodes} node{'s' * (first.nodes != 1)}, {first.hops} "
            f"hop{'s' * (first.hops != 1)}, gap count {first.gap_count}.",
            overflow="fold",
        )
    )
    over = sorted({one.payload_bytes for one in result.transactions if one.payload_bytes > max_payload_bytes})
    if over:
        text = f"Warning: over the speed's limit of {max_payload_bytes} bytes: {', '.join(map(str, over))}."
        parts.append(Text(text, style=_STYLES["warning"]))
    return parts


def _latency_grid(transactions: Sequence[Transaction]) -> Table:
    columns = [(f"{one.transaction} {one.payload_bytes} B\n{one.timing_model}", one.phases) for one in transactions]
    return _grid("phase, us", columns, _LATENCY_ROWS)


def capacity_table(result: Capacity, verdicts: Sequence[Verdict]) -> list[RenderableType]:
    """Verdict and figures of each period, the models side by side."""
    parts: list[RenderableType] = []
    for figures, verdict in zip(result.periods, verdicts, strict=True):
        if parts:
            parts.append(Text())
        parts.extend(_lines(verdict_lines(verdict, result.profile)))
        parts.extend((Text(), _capacity_grid(figures)))
    return parts


def _capacity_grid(figures: Sequence[CapacityFigures]) -> Table:
    first = figures[0]
    heading = (
        f"{first.nodes} node{'s' * (first.nodes != 1)}, {first.axes} axes\n{first.hops} "
        f"hop{'s' * (first.hops != 1)}, gap count {first.gap_count}"
    )
    return _grid(heading, [(f"\n{one.timing_model}", one) for one in figures], _CAPACITY_ROWS)


def paper_tables(sections: Sequence[PaperSection]) -> list[RenderableType]:
    """One table a section: published figures down, the ways to compute them across."""
    parts: list[RenderableType] = []
    for section in sections:
        parts.extend((Text(section.title, style="bold"), Text(section.note), _paper_table(section), Text()))
    return parts[:-1]


def _paper_table(section: PaperSection) -> Table:
    methods = list(dict.fromkeys(one.method for one in section.comparisons))
    table = _table(
        ["figure", "unit"],
        ["published", *(heading for method in methods for heading in (method, "residual", "%"))],
    )
    rows: dict[str, dict[str, Comparison]] = {}
    for one in section.comparisons:
        rows.setdefault(one.quantity, {})[one.method] = one
    for quantity, by_method in rows.items():
        first = next(iter(by_method.values()))
        cells = (cell for method in methods for cell in _compared(by_method.get(method)))
        table.add_row(quantity, first.unit, "-" if first.published is None else f"{first.published:.4g}", *cells)
    return table


def _compared(one: Comparison | None) -> tuple[str, str, str]:
    if one is None:
        return "", "", ""
    if one.residual is None or one.relative_residual is None:
        return us(one.computed), "-", "-"
    return us(one.computed), f"{one.residual:+.4f}", f"{one.relative_residual * 100:+.1f}"


def profiles_table(rows: Sequence[dict[str, Any]]) -> list[RenderableType]:
    """Names of profiles with their descriptions."""
    table = _table(["profile"], [])
    table.add_column("description")
    for row in rows:
        table.add_row(Text(row["name"]), Text(row["description"]))
    return [table]
