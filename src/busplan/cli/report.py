"""`busplan report`."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from busplan.cli.destinations import profile_files, require_apart
from busplan.cli.options import complete_profile, form_of_file, output_option, time_us
from busplan.cli.output import document_bytes, emit_document, new_file, say
from busplan.cli.progress import progress_bar
from busplan.cli.several import load_each, part_of
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from busplan.answers.page.content import Page
    from busplan.sections.profile import Profile

ReportFormat = Literal["html", "markdown"]

_SUFFIXES: Final[dict[str, ReportFormat]] = {".html": "html", ".md": "markdown"}


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
    output: Annotated[Path | None, output_option("Write the page to FILE: .html or .md (Markdown)")] = None,
    format_: Annotated[
        ReportFormat | None,
        typer.Option(
            "--format",
            help="Form of the page.  [default: what the name of --output says, else html]",
            show_default=False,
        ),
    ] = None,
    title: Annotated[
        str | None,
        typer.Option(
            "--title",
            metavar="TEXT",
            help="Heading of the page.  [default: the profile's name, or how many profiles]",
            show_default=False,
        ),
    ] = None,
    period: Annotated[
        str | None,
        typer.Option(
            "--period",
            metavar="TIME",
            help="Communication period of all profiles with its unit, as 4ms, 250us or 0.001s.  "
            "[default: the profile's cycle.period_us]",
            show_default=False,
        ),
    ] = None,
    circle: Annotated[
        bool, typer.Option("--circle/--no-circle", help="Run the circle test of profiles that ask for one.")
    ] = True,
) -> None:
    """Put all that busplan says of a profile on one page, for a screen, a machine's file or a repository.

    Verdicts, both timing models, the cycle to scale, where the time goes, axes against period, the circle with its
    error sources, and what it all rests on; each figure names its command. Times are in us, contour errors in um.
    Several profiles are compared in front. The HTML needs no network and no script. A report: it exits 0 whatever the
    verdict is.

    Example: busplan report paper-4ms paper-1ms -o report.html
    """
    from busplan.printable import commands

    chosen = form_of_file(format_, output, forms=_SUFFIXES, default="html")
    if title is not None and (commands(title) or not title.strip()):
        raise BusplanError(f"--title {title!r}: expected words in one line, without control characters")
    require_apart({"--output": output}, inputs=profile_files(*profiles))
    plans = load_each(profiles, partial(_plan, period=period))
    if output is None:
        emit_document(_written(_page(profiles, plans, title, period=period, circle=circle), chosen))
        return
    # Opened before the simulation: a path that cannot be written is said at once.
    with new_file(output, overwrite=True) as file:
        file.write(document_bytes(_written(_page(profiles, plans, title, period=period, circle=circle), chosen)))
    say(f"wrote {output}")


def _plan(argument: str, *, period: str | None) -> "Profile":
    from busplan.profile.shipped import load
    from busplan.profile.toml import override

    plan = load(argument).profile
    if period is None:
        return plan
    asked_us = time_us(period, option="--period")
    return override(plan, {"cycle.period_us": asked_us}, origin={"cycle.period_us": f"--period {period}, in us"})


def _page(
    arguments: "Sequence[str]", plans: "Sequence[Profile]", title: str | None, *, period: str | None, circle: bool
) -> "Page":
    from busplan.analysis.all_answers import all_answers
    from busplan.answers.page.chapters import ReportedProfile, page

    subjects = []
    with progress_bar("circle tests") as progress:
        for number, (argument, plan) in enumerate(zip(arguments, plans, strict=True)):
            own = part_of(progress, number=number, of=len(plans))
            answer = all_answers(plan, with_circle=circle, progress=own)
            subjects.append(ReportedProfile(argument, answer, other_period=period is not None))
    return page(subjects, title=title)


def _written(content: "Page", chosen: ReportFormat) -> str:
    if chosen == "markdown":
        from busplan.answers.page.markdown import page_markdown

        return page_markdown(content)
    from busplan.forms.html import page_html

    return page_html(content)
