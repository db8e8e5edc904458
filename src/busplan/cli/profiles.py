"""`busplan profiles`."""

from typing import Annotated, Literal

import typer

from busplan.cli.output import emit, emit_document


def profiles_command(
    format_: Annotated[
        Literal["table", "json", "csv"],
        typer.Option("--format", help="Form of the document on standard output."),
    ] = "table",
) -> None:
    """List the shipped profiles: what every command takes by name.

    Each with its number of nodes, its period, the timing model that decides and what it is about. A report: it exits 0.

    Example: busplan profiles
    """
    from busplan.answers import documents
    from busplan.forms import json_and_csv
    from busplan.profile.shipped import load, shipped_names

    rows = documents.profile_rows([load(name).profile for name in shipped_names()])
    if format_ == "table":
        from busplan.answers.profiles import profiles_lines

        emit(profiles_lines(rows))
    elif format_ == "json":
        emit_document(json_and_csv.to_json(documents.document("profiles", profiles=rows)))
    else:
        emit_document(json_and_csv.to_csv(rows))
