"""`busplan compare`."""

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
from busplan.forms import ENDINGS, PICTURES, Form, Picture
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.questions.compare.kinds import KindComparison

CompareForm = Literal[Form, Picture]

_ENDINGS: Final[Mapping[str, CompareForm]] = MappingProxyType({**ENDINGS, **PICTURES})


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
        typer.Option(
            "--buses",
            metavar="KIND[,KIND...]",
            help="Kinds of bus, as bus.kind has them.  [default: all, the profile's own first]",
            autocompletion=_complete_kinds,
            show_default=False,
        ),
    ] = None,
    changes: KeyChanges = NO_CHANGES,
    circle: Annotated[
        bool,
        typer.Option(
            "--circle",
            help="Also run the circle test of each kind at its smallest period, in the largest steps up to "
            "servo.step_us that divide it.",
        ),
    ] = False,
    all_: AllOption = False,
    format_: Annotated[
        CompareForm | None,
        typer.Option(
            "--format",
            help=PICTURE_FORMAT_HELP,
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(_ENDINGS)}")] = None,
) -> None:
    """Put the machine of a profile on each kind of bus: verdict, smallest period, most axes.

    The machine is what profiles of every kind say: nodes and axes, bytes, execution times, period, servo and circle.
    On its own kind the profile stays as it is. On another one it has the bus and the slice ratio of a new profile,
    which are assumed; what only its own kind has is left out, and named. The smallest period [us] is the one at which
    this machine is shown to fit; the most axes are those at the profile's period. A report: it exits 0 whatever fits.

    Example: busplan compare gantry-24 --circle
    """
    chosen = picture_form(format_, output, forms=_ENDINGS)
    match chosen:
        case "svg" | "png":
            require_apart({"--output": output}, inputs=profile_files(profile))
            with naming(changes):
                found = _found(profile, buses, changes, with_circle=circle)
                write_picture(_svg(found, changes), chosen, output)
        case _:
            with answer(chosen, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
                from busplan.questions.compare.report import compare_report

                give(compare_report(_found(profile, buses, changes, with_circle=circle)))


def _found(profile: str, buses: str | None, changes: KeyChanges, *, with_circle: bool) -> "KindComparison":
    from busplan.cli.progress import progress_bar
    from busplan.questions.compare.kinds import checked_kinds, compare

    kinds = None if buses is None else checked_kinds([one.strip() for one in buses.split(",")], option="--buses")
    with progress_bar("circle tests") as progress:
        return compare(load_changed(profile, changes), kinds=kinds, with_circle=with_circle, progress=progress)


def _svg(found: "KindComparison", changes: KeyChanges) -> str:
    """The drawing as a file of its own."""
    from busplan.questions.compare.report import headline, require_drawn
    from busplan.questions.compare.svg import compare_svg

    require_drawn(found)
    return compare_svg(found, title=picture_title(headline(found), changes))
