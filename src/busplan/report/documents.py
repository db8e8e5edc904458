"""From results to plain data: what `--format json` and `--format csv` write.

Keys carry their units and are stable between releases; new ones may be added.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from busplan.analysis.capacity import Capacity, CapacityFigures
from busplan.analysis.latency import LatencyResult, Transaction
from busplan.analysis.verdict import Verdict
from busplan.profile.model import Profile
from busplan.report.words import verdict_lines

if TYPE_CHECKING:
    from busplan.analysis.paper import PaperSection

JSON_SCHEMA: Final = 1

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
    phases = row.pop("phases")._asdict()
    return {**row, **{key: int(value) if key.endswith("_bytes") else value for key, value in phases.items()}}


def latency_document(result: LatencyResult) -> Document:
    """Answer of `busplan latency`."""
    return document("latency", profile=result.profile, transactions=latency_rows(result))


def capacity_rows(result: Capacity) -> list[Row]:
    """One row a period and timing model."""
    return [_figures_row(figures) for figures in result.results]


def _figures_row(figures: CapacityFigures) -> Row:
    return {**figures._asdict(), "exceeded": list(figures.exceeded)}


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
        "cheapest_change": change
        and {
            "timing_model": verdict.advised.timing_model,
            "changes": change.changes,
            "fits": change.figures.fits,
            "margin_us": change.figures.margin_us,
            "max_nodes": change.figures.max_nodes,
        },
        "text": " ".join(line.text for line in verdict_lines(verdict, result.profile)),
    }


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
