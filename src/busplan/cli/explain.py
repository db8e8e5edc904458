"""`busplan explain`."""

from typing import Annotated

import typer

from busplan.cli.answering import answer, naming_option
from busplan.cli.changes import PeriodsOption, load_changed, periods_us, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import (
    ALL_MODELS,
    AllOption,
    FormatOption,
    OutputOption,
    ProfileArgument,
    option,
    timing_models,
)
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChanges


def complete_figure(incomplete: str) -> list[str]:
    """Complete the name of a figure for the shell."""
    from busplan.questions.explain import figure_names

    return [name for name in figure_names() if name.startswith(incomplete)]


@takes_changes()
def explain_command(
    profile: ProfileArgument,
    figure: Annotated[
        str | None,
        typer.Argument(
            help="A key in the JSON of latency, capacity or circle-test, as required_us; where several have it, the "
            "first is meant, and circle-test.required_us names another.  [default: a list of all of them]",
            autocompletion=complete_figure,
            show_default=False,
        ),
    ] = None,
    period: PeriodsOption = None,
    changes: KeyChanges = NO_CHANGES,
    timing: Annotated[
        str | None,
        option(
            "--timing MODEL|both",
            "Timing model; a figure of the circle test or the verdict has only the one that decides.  [default: the "
            "profile's bus.timing_model]",
        ),
    ] = None,
    transaction: Annotated[
        str | None,
        option(
            "--transaction NAME|both",
            "For a figure of latency: the name of the transaction or message, as read, SYNC or loop, or both for all "
            "of them. A wrong name lists the right ones.  [default: both]",
        ),
    ] = None,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Show where a figure comes from: every step in symbols and in numbers, and its inputs.

    Each step names its equation. Each input has its source and its grade: published, derived, recalled, measured,
    calibrated or assumed, or "given" where the profile sets it. The steps are those of the computation itself; a search
    or a simulation is one step. A figure of the circle test runs the test. Exits 0 with any figures.

    Example: busplan explain paper-4ms required_us
    """
    if figure is None:
        _refuse_without_figure({"--period": period, "--timing": timing, "--transaction": transaction})
    with answer(format_, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
        from busplan.questions.explain import explain

        loaded = load_changed(profile, changes)
        with progress_bar("circle test") as progress, naming_option("transaction"):
            explanation = explain(
                loaded,
                figure,
                period_us=periods_us(period, loaded),
                timing_model=None if timing is None else timing_models(timing, loaded),
                transaction=None if transaction == ALL_MODELS else transaction,
                progress=progress,
            )
        give(explanation.report())


def _refuse_without_figure(options: "dict[str, object]") -> None:
    """Refuse options of a derivation without a figure."""
    given = [name for name, value in options.items() if value]
    if given:
        raise BusplanError(f"{' and '.join(given)}: goes with a FIGURE, as in busplan explain PROFILE required_us")
