"""`busplan capacity`."""

from typing import TYPE_CHECKING, Annotated

import typer

from busplan.cli.answering import answer
from busplan.cli.changes import PeriodsOption, load_changed, periods_us, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import (
    AllOption,
    FormatOption,
    OutputOption,
    ProfileArgument,
    TimingModelOption,
    chosen_model,
)
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.forms.blocks import Command
    from busplan.questions.capacity import CapacityAnswer


@takes_changes()
def capacity_command(
    profile: ProfileArgument,
    period: PeriodsOption = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: TimingModelOption = "both",
    sensitivity: Annotated[
        bool,
        typer.Option(
            "--sensitivity",
            help="Also tell what moves the margin: 10% more execution time, one node, one axis, 4 bytes, one hop or "
            "one retry more, 10 us more host time, or a bus reset, one at a time; and what binds next. CSV has these "
            "rows instead.",
        ),
    ] = False,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Tell whether the cycle fits its period, by what margin, and how many axes the bus carries.

    It begins with a card: the verdict (fits, not shown to fit, or does not fit) by the timing model that decides on
    this bus; how much of the period is used and free, the fastest period, room for more nodes, and what to measure or
    change. The figures follow; a low terminal shows them with --all. Times are in us. Exits 0 with any verdict.

    Example: busplan capacity paper-4ms --period 4ms --period 500us
    """
    with answer(format_, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
        from busplan.questions.capacity import capacity

        loaded = load_changed(profile, changes)
        result = capacity(
            loaded,
            period_us=periods_us(period, loaded),
            timing_model=chosen_model(timing_model),
            sensitivity=sensitivity,
        )
        give(result.report()._replace(next_commands=_next_commands(str(profile), result, changes)))


def _next_commands(argument: str, result: "CapacityAnswer", changes: KeyChanges) -> "tuple[Command, ...]":
    """Commands to run next for the same profile."""
    from busplan.forms.blocks import Command
    from busplan.questions.base.shell import change_options, period_option, shell_word

    own_us, asked_us = result.profile.cycle.period_us, [verdict.period_us for verdict in result.verdicts]
    tried = period_option(asked_us[0]) if len(asked_us) == 1 and asked_us[0] != own_us else ()
    changed = " ".join((shell_word(argument), *change_options(changes, period_us=own_us), *tried))
    all_well = all(verdict.all_well for verdict in result.verdicts)
    second = "circle-test" if all_well else "plan"
    asked = (f"capacity {changed} --sensitivity", f"{second} {changed}", f"report {changed}")
    return tuple(Command(f"busplan {words}") for words in asked)
