"""From results to plain data: what `--format json` and `--format csv` write.

Keys carry their units and are stable between releases; new ones may be added.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

from busplan.analysis.capacity.figures import Capacity, CapacityFigures
from busplan.analysis.capacity.verdict import Verdict
from busplan.analysis.latency import LatencyResult, Transaction
from busplan.analysis.network import bus_of
from busplan.answers.verdict_sentences import verdict_lines, warnings
from busplan.sections.profile import Profile

if TYPE_CHECKING:
    from busplan.analysis.circle.roundness import CircleTest
    from busplan.buses.published import PaperSection

JSON_SCHEMA: Final = 1

TRACE_COLUMNS: Final = (
    "period_us",
    "time_us",
    "command_x_mm",
    "command_y_mm",
    "x_mm",
    "y_mm",
    "contour_error_mm",
)

_TRACE_BLOCK: Final = 4096
"""Rows of a trace that are turned into Python's numbers together."""

Document = dict[str, Any]
Row = dict[str, Any]


def document(command: str, **content: Any) -> Document:
    """Put a command's answer into the frame that all JSON documents share."""
    return {"schema": JSON_SCHEMA, "command": command, **content}


def latency_rows(result: LatencyResult) -> list[Row]:
    """One row a transaction, phases flat beside what they belong to."""
    return [_transaction_row(transaction) for transaction in result.transactions]


def _transaction_row(transaction: Transaction) -> Row:
    row = transaction._asdict()
    phases = row.pop("phases")
    return {**row, **{key: int(value) if key.endswith("_bytes") else value for key, value in phases.items()}}


def latency_document(result: LatencyResult) -> Document:
    """Answer of `busplan latency`."""
    return document("latency", profile=result.profile, transactions=latency_rows(result))


def with_profile(name: str, rows: Sequence[Row]) -> list[Row]:
    """Rows for CSV: the profile's name in front, so that the tables of several runs can be joined."""
    return [{"profile": name, **row} for row in rows]


def capacity_rows(result: Capacity) -> list[Row]:
    """One row a period and timing model."""
    return [_figures_row(figures) for figures in result.results]


def _figures_row(figures: CapacityFigures) -> Row:
    return {**figures.by_key(), "exceeded": list(figures.exceeded)}


def capacity_document(result: Capacity, verdicts: tuple[Verdict, ...]) -> Document:
    """Answer of `busplan capacity`."""
    return document(
        "capacity",
        profile=result.profile.name,
        results=capacity_rows(result),
        verdicts=[_verdict(verdict, result) for verdict in verdicts],
    )


def _verdict(verdict: Verdict, result: Capacity) -> Document:
    change = verdict.change
    return {
        "period_us": verdict.period_us,
        "timing_model": verdict.deciding.timing_model,
        "fits": verdict.deciding.fits,
        "models_agree": verdict.models_agree,
        **safety_row(verdict.deciding, result.profile),
        "cheapest_change": change
        and {
            "changes": change.changes,
            "nodes": change.nodes,
            "fits": change.figures.fits,
            "margin_us": change.figures.margin_us,
        },
        "warnings": warnings(result.profile, nodes=verdict.deciding.nodes, most=verdict.deciding.max_nodes),
        "text": " ".join(line.text for line in verdict_lines(verdict, result.profile)),
    }


def safety_row(figures: CapacityFigures, profile: Profile) -> Row:
    """Whether the bus is set safely, under the name that its kind has for it."""
    safety = bus_of(profile).safety_figure
    return {} if safety is None else {safety.key: figures.safe}


def profile_rows(profiles: Sequence[Profile]) -> list[Row]:
    """One row a profile: what it is called and what it stands for."""
    return [
        {
            "name": profile.name,
            "nodes": profile.bus.nodes,
            "period_us": profile.cycle.period_us,
            "timing_model": profile.bus.timing_model,
            "description": " ".join(profile.description.split()),
        }
        for profile in profiles
    ]


def circle_rows(test: "CircleTest", *, with_contributions: bool) -> list[Row]:
    """One flat row a period: the centre in two columns, failures by name, what each source takes by its name."""
    sources = sorted({one.source for result in test.results for one in result.contributions or ()})
    rows = []
    for result in test.results:
        row = result._asdict()
        offset = row.pop("centre_offset_mm") or (None, None)
        row |= {"centre_offset_x_mm": offset[0], "centre_offset_y_mm": offset[1]}
        row["failures"] = [failure.name for failure in result.failures]
        removed = {one.source: one.removed_mm for one in row.pop("contributions") or ()}
        if with_contributions:
            row |= {f"removed_{source}_mm": removed.get(source) for source in sources}
        rows.append(row)
    return rows


def circle_document(test: "CircleTest", *, with_contributions: bool) -> Document:
    """Answer of `busplan circle-test`."""
    results = []
    for result in test.results:
        row = result._asdict()
        row["failures"] = [failure.document() for failure in result.failures]
        row["centre_offset_mm"] = result.centre_offset_mm and list(result.centre_offset_mm)
        ranked = row.pop("contributions")
        if with_contributions:
            row["contributions"] = None if ranked is None else [one._asdict() for one in ranked]
        results.append(row)
    return document("circle-test", profile=test.profile.name, results=results)


def trace_rows(test: "CircleTest", *, every: int) -> Iterator[Row]:
    """One row for every n-th step of each simulated period."""
    for result, run in zip(test.results, test.runs, strict=True):
        if run is None:
            continue
        trace = run.trace(every=every)
        columns = (
            trace.time_us,
            trace.command_x_mm,
            trace.command_y_mm,
            trace.x_mm,
            trace.y_mm,
            trace.contour_error_mm,
        )
        for start in range(0, len(trace.time_us), _TRACE_BLOCK):
            # Python's own floats take four times the memory of numpy's.
            block = [column[start : start + _TRACE_BLOCK].tolist() for column in columns]
            for values in zip(*block, strict=True):
                yield dict(zip(TRACE_COLUMNS, (result.period_us, *values), strict=True))


def paper_rows(sections: "Sequence[PaperSection]") -> list[Row]:
    """One row a published figure and way to compute it."""
    return [
        {
            **comparison._asdict(),
            "residual": comparison.residual,
            "relative_residual": comparison.relative_residual,
        }
        for section in sections
        for comparison in section.comparisons
    ]


def paper_document(sections: "Sequence[PaperSection]") -> Document:
    """Answer of `busplan paper`."""
    return document(
        "paper",
        notes={section.title: section.note for section in sections},
        figures=paper_rows(sections),
    )
