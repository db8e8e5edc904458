"""`busplan map`."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from busplan.cli.answering import answer, naming
from busplan.cli.changes import load_changed, takes_changes
from busplan.cli.destinations import profile_files, require_apart
from busplan.cli.options import AllOption, ProfileArgument, output_option
from busplan.cli.pictures import PICTURE_FORMAT_HELP, picture_form, picture_title, write_picture
from busplan.cli.vary import VALUES_HELP, parse_axis
from busplan.errors import BusplanError
from busplan.forms import ENDINGS, PICTURES, Form, Picture
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.questions.map.direction import Direction
    from busplan.questions.map.trade_off import TradeOff
    from busplan.sections.profile import Profile

MapForm = Literal[Form, Picture]

_ENDINGS: Final[Mapping[str, MapForm]] = MappingProxyType({**ENDINGS, **PICTURES})


def _along(option: str, *, default: str) -> typer.models.OptionInfo:
    help_ = (
        f"{'What lies across' if option == '--x' else 'What lies up'}: a key of the profile, or axes for the axes of "
        "all nodes (by their number; of groups, by that of the group with the most axes), and up to 64 values "
        f"in its unit: {VALUES_HELP}  [default: {default}]"
    )
    found: typer.models.OptionInfo = typer.Option(option, metavar="KEY=VALUES", help=help_, show_default=False)
    return found


@takes_changes(
    period=" of this design with its unit, as 4ms, 250us or 0.001s.  [default: the profile's cycle.period_us]",
    words="Of this design; along a key that varies, it moves the mark.",
)
def map_command(
    profile: ProfileArgument,
    x: Annotated[str | None, _along("--x", default="axes about the most that fit")] = None,
    y: Annotated[str | None, _along("--y", default="cycle.period_us about the smallest that fits [us]")] = None,
    changes: KeyChanges = NO_CHANGES,
    circle: Annotated[
        bool, typer.Option("--circle", help="Also run the circle test of every setting that fits, up to 1,000.")
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            metavar="N",
            help="Number of processes for --circle.  [default: one for each processor]",
            show_default=False,
        ),
    ] = None,
    all_: AllOption = False,
    format_: Annotated[
        MapForm | None,
        typer.Option(
            "--format",
            help=PICTURE_FORMAT_HELP,
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(_ENDINGS)}")] = None,
) -> None:
    """Draw where a design fits: period against axes, or any two keys of the profile.

    Each cell is the verdict of `busplan capacity` at that setting: fits, not shown to fit, does not fit, or an unsafe
    gap count; with --circle also where the circle fails. A table says what limits each region: time with its largest
    term, or a limit of the bus. This design is marked. A setting that cannot exist is blank. A report: it exits 0
    whatever fits.

    Example: busplan map paper-4ms --y cycle.period_us=500:4000:500
    """
    chosen = picture_form(format_, output, forms=_ENDINGS)
    if jobs is not None and not circle:
        raise BusplanError("--jobs: goes with --circle")
    if jobs is not None and jobs < 1:
        raise BusplanError(f"--jobs {jobs}: must be 1 or more")
    match chosen:
        case "svg" | "png":
            require_apart({"--output": output}, inputs=profile_files(profile))
            with naming(changes):
                found = _found(load_changed(profile, changes), x, y, jobs=jobs, with_circle=circle)
                write_picture(_svg(found, changes), chosen, output)
        case _:
            with answer(chosen, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
                from busplan.questions.map.report import map_report

                give(map_report(_found(load_changed(profile, changes), x, y, jobs=jobs, with_circle=circle)))


def _found(plan: "Profile", x: str | None, y: str | None, *, jobs: int | None, with_circle: bool) -> "TradeOff":
    from busplan.cli.progress import progress_bar
    from busplan.cli.workers import available_processors, executor
    from busplan.questions.map.trade_off import trade_off

    across = _direction(x, plan, option="--x", with_circle=with_circle)
    up = _direction(y, plan, option="--y", with_circle=with_circle)
    with progress_bar("map") as progress, executor(jobs or available_processors() if with_circle else 1) as where:
        return trade_off(plan, x=across, y=up, with_circle=with_circle, mapper=where.map, progress=progress)


def _direction(text: str | None, plan: "Profile", *, option: str, with_circle: bool) -> "Direction | None":
    from busplan.questions.map.direction import checked_direction

    if text is None:
        return None
    key, values = parse_axis(text, profile=plan, option=option)
    circle_option = None if with_circle else "--circle"
    return checked_direction(plan, key, values, option=option, circle_option=circle_option)


def _svg(found: "TradeOff", changes: KeyChanges) -> str:
    """The drawing as a file of its own."""
    from busplan.questions.map.report import headline
    from busplan.questions.map.svg import map_svg

    return map_svg(found, title=picture_title(headline(found), changes))
