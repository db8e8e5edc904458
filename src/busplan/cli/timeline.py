"""`busplan timeline`."""

from typing import TYPE_CHECKING, Annotated

from busplan.cli.changes import load_changed, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import (
    AllOption,
    ProfileArgument,
    option,
    time_us,
)
from busplan.cli.pictures import DrawnFormatOption, DrawnOutputOption, drawn_form, show_drawn
from busplan.errors import BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.questions.timeline import TimelineAnswer


@takes_changes(period=" with its unit, as 4ms, 250us or 0.001s.  [default: the profile's cycle.period_us]")
def timeline_command(
    profile: ProfileArgument,
    from_: Annotated[
        str | None,
        option(
            "--from TIME",
            "Show the cycle from this time on, counted from its start, with its unit, as 50us or 0.1ms.  "
            "[default: its start]",
        ),
    ] = None,
    to: Annotated[
        str | None,
        option(
            "--to TIME",
            "Show the cycle up to this time, with its unit; beyond its end means its end.  [default: its end]",
        ),
    ] = None,
    transaction: Annotated[
        str | None,
        option(
            "--transaction NAME:N",
            "Show one transaction of one node (from 1) with its gaps, by its name on this bus, as read:1, feedback:1, "
            "frame:1 or mdt:1; a wrong name lists the right ones. --from and --to may narrow it further.  [default: "
            "all of them]",
        ),
    ] = None,
    cycle: Annotated[
        int | None,
        option(
            "--cycle N",
            "Show the N-th cycle, from 1, of groups with rates of their own (every = n, on CAN and EtherCAT); beyond "
            "their common multiple the cycles repeat.  [default: the fullest, which the verdict is for]",
        ),
    ] = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: Annotated[
        str | None,
        option(
            "--timing-model MODEL",
            "Timing model of the profile's kind of bus, by its name; on IEEE 1394 paper or standard.  [default: the "
            "profile's bus.timing_model, where it is applicable]",
        ),
    ] = None,
    all_: AllOption = False,
    format_: DrawnFormatOption = None,
    output: DrawnOutputOption = None,
) -> None:
    """Show one communication cycle as events, node by node and to scale.

    The events are everything that takes time on the wire, in its order, the time for non-periodic data, and the rest of
    the slice. Without that rest they add up to the required time of `busplan capacity`. A cycle that overruns its slice
    is shown whole, and says so. Every node is computed with the hops of the farthest, unless the profile says
    otherwise. Times are in us. Exits 0 with any verdict.

    Example: busplan timeline paper-4ms --transaction read:1
    """
    chosen = drawn_form(format_, output)
    from_us = None if from_ is None else time_us(from_, option="--from")
    to_us = None if to is None else time_us(to, option="--to")
    if from_us is not None and to_us is not None and from_us >= to_us:
        raise BusplanError(f"--from {from_} --to {to}: the window must end after it begins")

    def find() -> "TimelineAnswer":
        from busplan.questions.timeline import timeline

        loaded = load_changed(profile, changes)
        return timeline(
            loaded, timing_model=timing_model, from_us=from_us, to_us=to_us, transaction=transaction, cycle=cycle
        )

    show_drawn(find, chosen, output, inputs=profile_files(profile), changes=changes, is_whole=all_)
