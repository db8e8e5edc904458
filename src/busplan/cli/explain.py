"""`busplan explain`."""

from typing import Annotated

import typer

from busplan.cli.answering import answer
from busplan.cli.changes import PeriodsOption, load_changed, periods_us, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import ALL_MODELS, AllOption, FormatOption, OutputOption, ProfileArgument, option
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
            help="A key in the JSON of capacity or latency, as required_us (latency.gaps_us where both have it); the "
            'number of an equation, as "(11)"; a label of a table, as arbitration; or a transaction, a message or a '
            "group of nodes, for its latency.  [default: what the verdict rests on, and a list of all figures]",
            autocompletion=complete_figure,
            show_default=False,
        ),
    ] = None,
    period: PeriodsOption = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: Annotated[
        str | None,
        option(
            "--timing-model MODEL|both",
            "Timing model; bias and uncertainty have only the one that decides.  [default: the profile's "
            "bus.timing_model]",
        ),
    ] = None,
    transaction: Annotated[
        str | None,
        option(
            "--transaction NAME",
            "For a figure of latency: the name of the transaction or message, as read, SYNC or loop. A wrong name "
            "lists the right ones.  [default: all]",
        ),
    ] = None,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Show where a figure of the bus comes from: every step in symbols and in numbers, and its inputs.

    Each step names its equation. Each input has its source and its grade: published, derived, recalled, measured,
    calibrated or assumed, or "given" where the profile sets it. The steps are those of the computation itself. What is
    searched for, compared or simulated has no equation: capacity and circle-test show it. Exits 0 with any figures.

    Example: busplan explain paper-4ms required_us
    """
    with answer(format_, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
        from busplan.questions.base.inputs import checked_models, load_network
        from busplan.questions.explain import explain

        loaded = load_changed(profile, changes)
        explanation = explain(
            loaded,
            figure,
            period_us=periods_us(period, loaded),
            timing_model=checked_models(None, load_network(loaded)) if timing_model == ALL_MODELS else timing_model,
            transaction=transaction,
        )
        give(explanation.report())
