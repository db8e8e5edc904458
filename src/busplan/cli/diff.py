"""`busplan diff`."""

from math import isfinite
from typing import Annotated

import typer

from busplan.cli.answering import answer, naming_option
from busplan.cli.changes import load_each, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import (
    ALL_MODELS,
    AllOption,
    FormatOption,
    OutputOption,
    TimingOption,
    complete_profile,
    option,
    timing_model,
)
from busplan.cli.output import PlanFailsError, say
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChanges


@takes_changes(words="Of both profiles.")
def diff_command(
    a: Annotated[
        str,
        typer.Argument(
            metavar="A",
            help="The profile to compare with: a file, a shipped name, - for standard input, or REV:path for a file "
            "as it stood in a git revision, as HEAD~1:profiles/line.toml; the path starts at the current folder.",
            autocompletion=complete_profile,
            show_default=False,
        ),
    ],
    b: Annotated[
        str,
        typer.Argument(
            metavar="B", help="The profile to judge, likewise.", autocompletion=complete_profile, show_default=False
        ),
    ],
    changes: KeyChanges = NO_CHANGES,
    timing: TimingOption = "both",
    circle: Annotated[
        bool, typer.Option("--circle/--no-circle", help="Run both circle tests when either profile asks for one.")
    ] = True,
    fail_on_regression: Annotated[
        bool, typer.Option("--fail-on-regression", help="Exit 1 when a figure of B is worse.")
    ] = False,
    tolerance: Annotated[
        float | None,
        option(
            "--tolerance PERCENT",
            "With --fail-on-regression, how much worse a number may be than A's [%].  [default: 0]",
        ),
    ] = None,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Tell what changed between two profiles, and what that does to every figure.

    It lists the keys whose values differ, defaults applied, then the figures of capacity, latency and circle-test that
    differ, with B - A, its share of A, and whether B is better, worse or neutral. Settings and what describes them
    (period, nodes, gap count, time available, largest term) are neutral. JSON and CSV list equal figures, too. Times
    are in us, contour errors in um in the table and in mm in JSON. Markdown is for a pull request. Exits 0 with any
    figures; with --fail-on-regression 1 when any figure is worse, under any timing model or in the circle. --timing and
    --no-circle leave figures out, but never whether B is shown to fit. A circle that cannot be run counts as not
    passed.

    Example: busplan diff paper-1ms paper-optimal-gap --fail-on-regression
    """
    allowed = _tolerance(tolerance, wanted=fail_on_regression)
    with answer(format_, output, inputs=profile_files(a, b), changes=changes, is_whole=all_) as give:
        from busplan.profile.revision import load_revision
        from busplan.questions.diff import diff

        one, other = load_each((a, b), lambda argument: changes.applied(load_revision(argument).profile))
        if timing != ALL_MODELS and one.bus.kind == other.bus.kind:
            for side in (other, one):
                timing_model(timing, side)  # refuses it in the words of the option
        with progress_bar("circle tests") as progress, naming_option("timing_model"):
            found = diff(
                one,
                other,
                timing_model=None if timing == ALL_MODELS else timing,
                circle=circle,
                progress=progress,
                arguments=(a, b),
            )
        give(found.report())
    regressions = found.regression_words(tolerance_percent=allowed)
    if fail_on_regression and regressions:
        say(regressions)
        raise PlanFailsError


def _tolerance(percent: float | None, *, wanted: bool) -> float:
    if percent is None:
        return 0.0
    if not wanted:
        raise BusplanError("--tolerance: goes with --fail-on-regression")
    if not (isfinite(percent) and percent >= 0):
        raise BusplanError(f"--tolerance {percent:g}: must be 0 or more, in percent")
    return percent
