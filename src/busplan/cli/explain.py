"""`busplan explain`."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from busplan.cli.options import (
    BUS_OPTIONS,
    GapCountOption,
    NodesOption,
    PeriodsOption,
    ProfileArgument,
    bus_changes,
    periods_us,
    timing_models,
)
from busplan.cli.output import emit, emit_document
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from busplan.analysis.explain import Explanation
    from busplan.profile.model import Profile
    from busplan.timing import TransactionKind

ExplainFormat = Literal["text", "json", "markdown"]


def complete_figure(incomplete: str) -> list[str]:
    """Figures that begin as typed, for the shell's completion."""
    from busplan.analysis.quantities import FIGURES

    names = (name for command, keys in FIGURES.items() for key in keys for name in (key, f"{command}.{key}"))
    return [name for name in dict.fromkeys(names) if name.startswith(incomplete)]


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
    nodes: NodesOption = None,
    gap_count: GapCountOption = None,
    timing: Annotated[
        Literal["paper", "standard", "both"] | None,
        typer.Option(
            "--timing",
            help="Timing model; a circle test has only the one that decides.  "
            "[default: the profile's bus.timing_model]",
            show_default=False,
        ),
    ] = None,
    transaction: Annotated[
        Literal["read", "write", "both"] | None,
        typer.Option("--transaction", help="Which transaction, for a figure of latency.  [default: both]"),
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
    from busplan.profile.shipped import load
    from busplan.profile.toml import override

    plan = override(load(profile).profile, bus_changes(nodes=nodes, gap_count=gap_count), origin=BUS_OPTIONS)
    if figure is None:
        _refuse_without_figure({"--period": period, "--timing": timing, "--transaction": transaction})
        _list(plan, format_)
        return
    from busplan.analysis.explain import explain
    from busplan.cli.progress import progress_bar

    with progress_bar("circle test") as progress:
        found = explain(
            plan,
            figure,
            periods_us=periods_us(period, plan),
            timing_models=None if timing is None else timing_models(timing),
            transactions=_transactions(transaction),
            progress=progress,
        )
    _write(found, format_)


def _transactions(asked: "Literal['read', 'write', 'both'] | None") -> "Sequence[TransactionKind] | None":
    if asked is None:
        return None
    return ("read", "write") if asked == "both" else (asked,)


def _refuse_without_figure(options: "dict[str, object]") -> None:
    """Refuse options that say which derivation of a figure, where there is none."""
    given = [name for name, value in options.items() if value]
    if given:
        raise BusplanError(f"{' and '.join(given)}: goes with a FIGURE, as in busplan explain PROFILE required_us")


def _list(plan: "Profile", format_: ExplainFormat) -> None:
    from busplan.analysis.explain import assumptions
    from busplan.report import explain as report
    from busplan.report import text

    found = assumptions(plan)
    if format_ == "text":
        emit(report.figure_lines(plan.name, found))
    elif format_ == "json":
        emit_document(text.to_json(report.figure_document(plan.name, found)))
    else:
        emit_document(report.figure_markdown(plan.name, found))


def _write(found: "Explanation", format_: ExplainFormat) -> None:
    from busplan.report import explain as report
    from busplan.report import text

    found = report.in_words(found)
    if format_ == "text":
        emit(report.explain_lines(found))
    elif format_ == "json":
        emit_document(text.to_json(report.explain_document(found)))
    else:
        emit_document(report.explain_markdown(found))
