"""`busplan circle-test`."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from busplan.cli.answering import answer
from busplan.cli.changes import (
    PeriodsOption,
    load_changed,
    periods_us,
    takes_changes,
)
from busplan.cli.destinations import profile_files, require_apart
from busplan.cli.options import AllOption, FormatOption, OutputOption, ProfileArgument, option
from busplan.cli.output import PlanFailsError, say
from busplan.cli.pictures import plot_form
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError
from busplan.files import NewFile, document_bytes, new_file
from busplan.forms import Picture
from busplan.profile.changes import NO_CHANGES, KeyChanges

if TYPE_CHECKING:
    from busplan.questions.circle import CircleTestAnswer


@takes_changes()
def circle_test_command(
    profile: ProfileArgument,
    period: PeriodsOption = None,
    changes: KeyChanges = NO_CHANGES,
    contributions: Annotated[
        bool, typer.Option("--contributions", help="Rank the error sources: run the test again without each of them.")
    ] = False,
    trace: Annotated[
        Path | None,
        option(
            "--trace FILE.csv",
            "Write time [us], commanded and actual position [mm] and contour error [mm] as CSV; an old file is "
            "replaced.  [default: no file]",
        ),
    ] = None,
    every: Annotated[
        int | None, option("--every N", "Write one of N steps of the simulation to --trace.  [default: 10]")
    ] = None,
    plot: Annotated[
        Path | None,
        option(
            "--plot FILE",
            "Draw the magnified polar error, the error over time and the ranked error sources, with tolerances, "
            "into FILE.svg or FILE.png; an old file is replaced. PNG needs the extra plot (resvg-py).  "
            "[default: no figure]",
        ),
    ] = None,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Tell whether the circle is still round: simulate both axes at the period that the bus delivers.

    The test has three parts. The bus: a cycle that does not fit its period fails before any simulation. Stability: a
    loop without its phase and gain margin fails, however round its circle. The tolerances of the profile: without any,
    the circle is not judged, nor below 0.1 um, where no error source of the profile matters. Errors are in um in the
    table, in mm in JSON and CSV; F_min, F_max and G are the terms of ISO 230-4, and circle.path = "iso230-4" measures
    them on a whole turn. Exits 0 when the test passes or the circle is not judged, and 1 when it fails.

    Example: busplan circle-test paper-4ms --contributions
    """
    if every is not None and trace is None:
        raise BusplanError("--every: goes with --trace FILE.csv")
    if every is not None and every < 1:
        raise BusplanError(f"--every {every}: must be 1 or more")
    require_apart({"--output": output, "--trace": trace, "--plot": plot}, inputs=profile_files(profile))
    form = None if plot is None else plot_form(plot)
    with answer(format_, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
        from busplan.questions.circle import circle_test

        loaded = load_changed(profile, changes)
        periods = periods_us(period, loaded)
        with ExitStack() as files:
            # Opened before the simulation, so that a path that cannot be written fails at once.
            trace_file = files.enter_context(new_file(trace, overwrite=True)) if trace else None
            plot_file = files.enter_context(new_file(plot, overwrite=True)) if plot else None
            with _naming(profile, period), progress_bar("circle test") as progress:
                test = circle_test(loaded, period_us=periods, contributions=contributions, progress=progress)
            if trace_file is not None:
                trace_file.writelines(block.encode() for block in test.trace_csv(every=every or 10))
            if plot_file is not None and form is not None:
                _draw(test, plot_file, changes, form)
        _say_written(trace, plot, drawn=any(test.runs))
        give(test.report())
    if test.passed is False:
        raise PlanFailsError


@contextmanager
def _naming(profile: str, period: list[str] | None) -> Iterator[None]:
    """Name the file and --period in errors about a circle that cannot be run."""
    try:
        yield
    except BusplanError as error:
        from busplan.profile.shipped import locate

        _, name = locate(profile)
        typed = "".join(f" (with --period {text})" for text in period or ())
        raise BusplanError(*(f"{name}: {problem}{typed}" for problem in error.problems)) from None


def _draw(test: "CircleTestAnswer", file: NewFile, changes: KeyChanges, form: Picture) -> None:
    """Draw the simulated periods; without any, an old file stays unchanged."""
    if not any(test.runs):
        file.abandon()
        return
    from busplan.forms.raster import picture

    file.write(document_bytes(picture(test.svg(note=changes.words), form)))


def _say_written(trace: Path | None, plot: Path | None, *, drawn: bool) -> None:
    if trace is not None:
        say(f"wrote {trace}")
    if plot is not None:
        say(f"wrote {plot}" if drawn else f"{plot}: not written, for no period fits the bus: nothing to draw")
