"""`busplan map`."""

from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from busplan.cli.changes import load_changed, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import VALUES_HELP, AllOption, JobsOption, ProfileArgument, parse_axis
from busplan.cli.pictures import DrawnFormatOption, DrawnOutputOption, drawn_form, show_drawn
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.questions.map import MapAnswer


def _direction(option: str, *, default: str) -> typer.models.OptionInfo:
    help_ = (
        f"Quantity on the {option[-1]} axis: a key of the profile, or axes for the axes of all nodes (varies the "
        "number of nodes; with groups, of the group with the most axes), and up to 64 values in its unit: "
        f"{VALUES_HELP}  [default: {default}]"
    )
    direction: typer.models.OptionInfo = typer.Option(option, metavar="KEY=VALUES", help=help_, show_default=False)
    return direction


@takes_changes(
    period=" of this design with its unit, as 4ms, 250us or 0.001s.  [default: the profile's cycle.period_us]",
    words="For a key on an axis of the map, it moves the mark.",
)
def map_command(
    profile: ProfileArgument,
    x: Annotated[str | None, _direction("--x", default="axes about the most that fit")] = None,
    y: Annotated[str | None, _direction("--y", default="cycle.period_us about the smallest that fits [us]")] = None,
    changes: KeyChanges = NO_CHANGES,
    circle: Annotated[
        bool, typer.Option("--circle", help="Also run the circle test of every cell that fits, up to 1,000.")
    ] = False,
    jobs: JobsOption = None,
    all_: AllOption = False,
    format_: DrawnFormatOption = None,
    output: DrawnOutputOption = None,
) -> None:
    """Draw where a design fits: period against axes, or any two keys of the profile.

    Each cell is the verdict of `busplan capacity` for its two values: fits, not shown to fit, does not fit, or an
    unsafe gap count; with --circle also whether the circle fails. A table says what limits each region: time with its
    largest term, or a limit of the bus. The profile's own cell is marked. Values that cannot be combined are blank.
    Exits 0 with any verdict.

    Example: busplan map paper-4ms --y cycle.period_us=500:4000:500
    """
    chosen = drawn_form(format_, output)
    if jobs is not None and not circle:
        raise BusplanError("--jobs: goes with --circle")
    if jobs is not None and jobs < 1:
        raise BusplanError(f"--jobs {jobs}: must be 1 or more")

    def find() -> "MapAnswer":
        from busplan.cli.workers import available_processors, executor
        from busplan.questions.map import map_

        loaded = load_changed(profile, changes)
        with ExitStack() as run:
            return map_(
                loaded,
                x=_along(x, option="--x"),
                y=_along(y, option="--y"),
                circle=circle,
                progress=run.enter_context(progress_bar("map")),
                executor=run.enter_context(executor(jobs or available_processors())) if circle else None,
            )

    show_drawn(find, chosen, output, inputs=profile_files(profile), changes=changes, is_whole=all_)


def _along(text: str | None, *, option: str) -> dict[str, str] | None:
    return None if text is None else dict([parse_axis(text, option=option)])
