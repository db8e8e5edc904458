"""`busplan latency`."""

from typing import Annotated

import typer

from busplan.cli.options import (
    NO_CHANGES,
    Changes,
    FormatOption,
    ProfileArgument,
    TimingOption,
    load_changed,
    parse_sizes,
    takes_bus_options,
    timing_models,
)
from busplan.cli.output import emit, emit_document


@takes_bus_options
def latency_command(
    profile: ProfileArgument,
    payload: Annotated[
        str | None,
        typer.Option(
            "--payload",
            metavar="BYTES[,BYTES...]",
            help="Payload of both read and write in bytes, or several between commas, as 4,16,32.  "
            "[default: the profile's payload.read_bytes and payload.write_bytes]",
            show_default=False,
        ),
    ] = None,
    changes: Changes = NO_CHANGES,
    timing: TimingOption = "both",
    format_: FormatOption = "table",
) -> None:
    """Show where the microseconds of one read and one write go, phase by phase, under both timing models.

    The transaction is that of the farthest node. Times are in us, sizes in bytes; each row names the paper's
    equation that it comes from. A report: it exits 0 whatever the figures are.

    Example: busplan latency paper-two-node --payload 4,16,1024
    """
    from busplan.analysis.latency import latency

    plan = load_changed(profile, changes)
    result = latency(
        plan,
        payloads_bytes=None if payload is None else parse_sizes(payload, option="--payload"),
        timing_models=timing_models(timing, plan),
    )
    if format_ == "table":
        from busplan.answers.latency import latency_lines

        emit(latency_lines(result, plan))
        return
    from busplan.answers import documents
    from busplan.forms import json_and_csv

    emit_document(
        json_and_csv.to_json(documents.latency_document(result))
        if format_ == "json"
        else json_and_csv.to_csv(documents.with_profile(plan.name, documents.latency_rows(result)))
    )
