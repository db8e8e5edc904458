"""`busplan report`."""

from functools import partial
from typing import Annotated, Final

import typer

from busplan.cli.answering import answer
from busplan.cli.changes import load_changed, load_each, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import OutputOption, complete_profile, format_option, option
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError
from busplan.forms import Form
from busplan.profile.changes import NO_CHANGES, KeyChanges

_REFUSED: Final[dict[Form, str]] = {
    "csv": "a page holds many tables; each names its command, and that command's --format csv has its rows"
}


@takes_changes(
    period=" of all profiles with its unit, as 4ms, 250us or 0.001s.  [default: the profile's cycle.period_us]",
    words="Of all profiles.",
)
def report_command(
    profiles: Annotated[
        list[str],
        typer.Argument(
            metavar="PROFILE",
            help="Profile files, shipped names (see `busplan profiles`), or once - for standard input.",
            autocompletion=complete_profile,
            show_default=False,
        ),
    ],
    format_: Annotated[Form | None, format_option("html")] = None,
    output: OutputOption = None,
    title: Annotated[
        str | None,
        option("--title TEXT", "Heading of the page.  [default: the profile's name, or the number of profiles]"),
    ] = None,
    changes: KeyChanges = NO_CHANGES,
    circle: Annotated[
        bool | None,
        typer.Option(
            "--circle/--no-circle",
            help="Run the circle test of profiles that ask for one.  [default: where servo values are measured]",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Put the answers for a profile on one page, for a screen, a machine's file or a repository.

    The first screen has the verdict and the map; every other answer is behind a fold, with its command, and is printed
    whole. Times are in us, contour errors in um. Several profiles are compared at the top. The HTML needs no network
    and no script. Exits 0 with any verdict.

    Example: busplan report paper-4ms paper-1ms -o report.html
    """
    from busplan.printable import has_controls

    if title is not None and (has_controls(title) or not title.strip()):
        raise BusplanError(f"--title {title!r}: expected words in one line, without control characters")
    files = profile_files(*profiles)
    # The answer names the changes itself, for they stand in the commands of the page, too.
    with answer(format_, output, inputs=files, default="html", refused=_REFUSED) as give:
        from busplan.questions.report import report

        loaded = load_each(profiles, partial(load_changed, changes=changes))
        with progress_bar("circle tests") as progress:
            page = report(
                loaded,
                title=title,
                circle=circle,
                progress=progress,
                origins=[(argument, changes) for argument in profiles],
            )
        give(page.report())
