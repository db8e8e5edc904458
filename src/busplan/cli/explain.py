"""`busplan explain`."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from busplan.cli.options import (
    ALL_MODELS,
    NO_CHANGES,
    Changes,
    PeriodsOption,
    ProfileArgument,
    load_changed,
    periods_us,
    takes_bus_options,
    timing_models,
)
from busplan.cli.output import emit, emit_document
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from busplan.analysis.derivation.explain import Explanation
    from busplan.sections.profile import Profile

ExplainFormat = Literal["text", "json", "markdown"]


def complete_figure(incomplete: str) -> list[str]:
    """Figures that begin as typed, for the shell's completion."""
    from busplan.analysis.register import figures_of
    from busplan.buses import kind_named, kind_names

    registers = (figures_of(kind_named(kind)) for kind in kind_names())
    names = (
        name for one in registers for command, keys in one.items() for key in keys for name in (key, f"{command}.{key}")
    )
    return [name for name in dict.fromkeys(names) if name.startswith(incomplete)]


@takes_bus_options
def explain_command(
    profile: ProfileArgument,
    figure: Annotated[
        str | None,
        typer.Argument(
            help="A key of the JSON of latency, capacity or circle-test, as required_us; circle-test.required_us where "
            "several have it and the first is not meant.  [default: a list of all of them]",
            autocompletion=complete_figure,
            show_default=False,
        ),
    ] = None,
    period: PeriodsOption = None,
    changes: Changes = NO_CHANGES,
    timing: Annotated[
        str | None,
        typer.Option(
            "--timing",
            metavar="MODEL|both",
            help="Timing model; a circle test has only the one that decides.  "
            "[default: the profile's bus.timing_model]",
            show_default=False,
        ),
    ] = None,
    transaction: Annotated[
        str | None,
        typer.Option(
            "--transaction",
            metavar="NAME|both",
            help="Which transaction, for a figure of latency, as read or write.  [default: both]",
        ),
    ] = None,
    format_: Annotated[
        ExplainFormat, typer.Option("--format", help="Form of the document on standard output.")
    ] = "text",
) -> None:
    """Show where a figure comes from: every step in symbols and in numbers, and what it starts from.

    Each step names its equation. Each constant has its source and how well it is known: published, derived, recalled,
    measured, calibrated or assumed; "given" is what the profile sets. The lines are what the program itself computed.
    A figure of the circle test runs the test. Each figure has its unit. A report: it exits 0 whatever the figures are.

    Example: busplan explain paper-4ms required_us
    """
    plan = load_changed(profile, changes)
    if figure is None:
        _refuse_without_figure({"--period": period, "--timing": timing, "--transaction": transaction})
        _list(plan, format_)
        return
    from busplan.analysis.derivation.explain import explain
    from busplan.cli.progress import progress_bar

    with progress_bar("circle test") as progress:
        found = explain(
            plan,
            figure,
            periods_us=periods_us(period, plan),
            timing_models=None if timing is None else timing_models(timing, plan),
            transactions=_transactions(transaction, plan),
            progress=progress,
        )
    _write(found, format_)


def _transactions(asked: str | None, profile: "Profile") -> "Sequence[str] | None":
    if asked is None:
        return None
    from busplan.analysis.derivation.latency import latency_names

    known = latency_names(profile)
    if asked not in (*known, ALL_MODELS):
        raise BusplanError(f"--transaction {asked}: expected {', '.join(known)} or both")
    return known if asked == ALL_MODELS else (asked,)


def _refuse_without_figure(options: "dict[str, object]") -> None:
    """Refuse options that say which derivation of a figure, where there is none."""
    given = [name for name, value in options.items() if value]
    if given:
        raise BusplanError(f"{' and '.join(given)}: goes with a FIGURE, as in busplan explain PROFILE required_us")


def _list(plan: "Profile", format_: ExplainFormat) -> None:
    from busplan.analysis.derivation.explain import assumptions
    from busplan.answers import explain as report
    from busplan.forms import json_and_csv

    found = assumptions(plan)
    if format_ == "text":
        emit(report.figure_lines(plan, found))
    elif format_ == "json":
        emit_document(json_and_csv.to_json(report.figure_document(plan, found)))
    else:
        emit_document(report.figure_markdown(plan, found))


def _write(found: "Explanation", format_: ExplainFormat) -> None:
    from busplan.answers import explain as report
    from busplan.forms import json_and_csv

    found = report.in_words(found)
    if format_ == "text":
        emit(report.explain_lines(found))
    elif format_ == "json":
        emit_document(json_and_csv.to_json(report.explain_document(found)))
    else:
        emit_document(report.explain_markdown(found))
