"""A timeline as plain data: what `--format json` and `--format csv` write."""

from busplan.analysis.network import bus_of
from busplan.analysis.timeline.schedule import Schedule, totals
from busplan.answers.documents import Document, Row, document, safety_row
from busplan.answers.verdict_sentences import warnings
from busplan.drawings.timeline.kinds import kind_of


def event_rows(plan: Schedule) -> list[Row]:
    """One row an event of the window."""
    return [
        {
            "kind": event.kind,
            "node": event.node,
            "transaction": event.transaction,
            "packet": event.packet,
            "start_us": event.start_us,
            "end_us": event.end_us,
            "duration_us": event.duration_us,
            "equation": kind_of(plan.profile, event.kind).reference,
        }
        for event in plan.events
    ]


def timeline_rows(plan: Schedule) -> list[Row]:
    """Rows for CSV: profile and model in front."""
    head = {"profile": plan.profile.name, "timing_model": plan.figures.timing_model}
    return [{**head, **row} for row in event_rows(plan)]


def timeline_document(plan: Schedule) -> Document:
    """Answer of `busplan timeline`: the figures are those of the whole cycle, events and totals those of the window."""
    figures = plan.figures
    return document(
        "timeline",
        profile=plan.profile.name,
        timing_model=figures.timing_model,
        period_us=figures.period_us,
        nodes=figures.nodes,
        **{key: getattr(figures, key) for key in bus_of(plan.profile).facts},
        required_us=figures.required_us,
        available_us=figures.available_us,
        margin_us=figures.margin_us,
        exceeded=list(figures.exceeded),
        fits=figures.fits,
        **safety_row(figures, plan.profile),
        warnings=warnings(plan.profile, nodes=figures.nodes, most=0),
        from_us=plan.from_us,
        to_us=plan.to_us,
        events=event_rows(plan),
        totals=[one._asdict() for one in totals(plan)],
    )
