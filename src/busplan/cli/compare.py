"""`busplan compare`."""

from typing import TYPE_CHECKING, Annotated

from busplan.cli.changes import load_changed, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import AllOption, ProfileArgument, option
from busplan.cli.pictures import DrawnFormatOption, DrawnOutputOption, drawn_form, show_drawn
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.questions.compare import CompareAnswer


def _complete_kinds(incomplete: str) -> list[str]:
    """Complete the last of several names of kinds for the shell."""
    from busplan.buses import kind_names

    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in kind_names() if name.startswith(last)]


@takes_changes(
    period=" with its unit, as 4ms, 250us or 0.001s.  [default: the profile's cycle.period_us]",
    words="Of the profile, before it is put on other kinds.",
)
def compare_command(
    profile: ProfileArgument,
    buses: Annotated[
        str | None,
        option(
            "--buses KIND[,KIND...]",
            "Kinds of bus, by their bus.kind.  [default: all, the profile's own first]",
            autocompletion=_complete_kinds,
        ),
    ] = None,
    changes: KeyChanges = NO_CHANGES,
    all_: AllOption = False,
    format_: DrawnFormatOption = None,
    output: DrawnOutputOption = None,
) -> None:
    """Put the machine of a profile on each kind of bus: verdict, smallest period, most axes.

    The machine is the part of a profile that every kind has: nodes and axes, bytes, execution times and period.
    On its own kind the profile stays as it is. On another kind it gets the bus and the slice ratio of a new
    profile, which are assumed; keys that only its own kind has are left out, and named. The smallest period [us] is the
    one at which this machine is shown to fit; the most axes are those at the profile's period. Exits 0 with any
    verdict.

    Example: busplan compare gantry-24
    """
    chosen = drawn_form(format_, output)

    def find() -> "CompareAnswer":
        from busplan.questions.compare import compare

        kinds = None if buses is None else [kind.strip() for kind in buses.split(",")]
        return compare(load_changed(profile, changes), buses=kinds)

    show_drawn(find, chosen, output, inputs=profile_files(profile), changes=changes, is_whole=all_)
