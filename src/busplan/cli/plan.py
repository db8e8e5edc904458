"""`busplan plan`."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from busplan.cli.apply import apply_changes, require_own_file
from busplan.cli.destinations import profile_files, require_apart
from busplan.cli.options import (
    BUS_OPTIONS,
    STANDARD_OUTPUT,
    FormatOption,
    GapCountOption,
    ProfileArgument,
    bus_changes,
    periods_us,
)
from busplan.cli.output import PlanFailsError, emit, emit_document, new_file, say
from busplan.cli.progress import progress_bar
from busplan.errors import BusplanError

if TYPE_CHECKING:
    from busplan.analysis.planning.options import Plan
    from busplan.buses.bus import Value
    from busplan.profile.toml import LoadedProfile
    from busplan.sections.profile import Profile

_MAX_AXES = 1_000_000


def plan_command(
    profile: ProfileArgument,
    nodes: Annotated[
        int | None,
        typer.Option(
            "--nodes",
            metavar="N",
            help="Goal: so many distributed nodes, the host not counted.  [default: the profile's bus.nodes]",
        ),
    ] = None,
    axes: Annotated[
        int | None,
        typer.Option(
            "--axes",
            metavar="N",
            min=1,
            max=_MAX_AXES,
            help="Goal: so many axes, on the nodes they need at the profile's node.axes each; instead of --nodes.  "
            "[default: those of the nodes]",
        ),
    ] = None,
    period: Annotated[
        str | None,
        typer.Option(
            "--period",
            metavar="TIME",
            help="Communication period with its unit, as 4ms, 250us or 0.001s; it is then kept.  "
            "[default: the profile's cycle.period_us, which may be changed]",
        ),
    ] = None,
    gap_count: GapCountOption = None,
    circle: Annotated[
        bool,
        typer.Option(
            "--circle/--no-circle",
            help="Run the circle test, where the profile has a section for it (servo, circle, tolerance, ...), or "
            "leave it out.",
        ),
    ] = True,
    max_circles: Annotated[
        int,
        typer.Option(
            "--max-circles",
            metavar="N",
            min=1,
            max=100_000,
            help="Periods in a row to test for the smallest that passes the circle; then the strides double, and the "
            "answer is marked as not proven.",
        ),
    ] = 50,  # best_values.MAX_CIRCLES, which --help must not load
    apply: Annotated[
        bool,
        typer.Option(
            "--apply", help="Write the recommended values into PROFILE, a file; comments and layout stay as they are."
        ),
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="NEW.toml",
            help="Write the recommended profile as a new file, without comments; - is standard output, and the report "
            "goes to standard error.  [default: no file]",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Let -o overwrite a file that is already there.")] = False,
    format_: FormatOption = "table",
) -> None:
    """Tell what to set: gap count, period, slice ratio, payload, and how many nodes would do.

    Each option changes the profile in one way, and is computed again with it in place: the smallest period that fits
    the bus and passes the circle, the best gap count for the hops, the largest payload (read and write alike), the
    smallest slice ratio, the most nodes, under the profile's bus.timing_model. Margins are in us.

    One is recommended: the cheapest after which the goal fits under both timing models with a safe gap count, and
    passes the circle. Cheapest comes first: nothing, gap count, slice ratio (up to 0.9), both, period, period and gap
    count. What is given by an option is kept, and so is the number of nodes; a payload, speed or wiring is changed only
    where the standard's limits demand it. Exits 0 when there is such a plan, 1 when there is none.

    Example: busplan plan paper-1ms --axes 16
    """
    _check_options(nodes=nodes, axes=axes, apply=apply, output=output, force=force, format_=format_)
    from busplan.analysis.planning.options import plan
    from busplan.profile.shipped import load

    if apply:
        require_own_file(profile)
    loaded = load(profile)
    wanted = _wanted(loaded.profile, nodes=nodes, axes=axes, period=period, gap_count=gap_count)
    piped = output == STANDARD_OUTPUT
    require_apart({"--output": None if piped else output}, inputs=profile_files(profile), of_profiles=True)
    with_circle = circle and loaded.profile.asks_for_circle
    with ExitStack() as files:
        # Opened before the search: a path that cannot be written is said at once.
        new = files.enter_context(new_file(output, overwrite=force)) if output and not piped else None
        with progress_bar("circle tests") as progress:
            check = None
            if with_circle:
                from busplan.analysis.circle.check import CircleCheck

                check = CircleCheck(progress=progress, expected=max_circles)
            result = plan(loaded.profile, wanted=wanted, circle=check, max_circles=max_circles)
        if result.recommended is None:
            _emit(result, format_=format_, with_circle=with_circle, piped=piped)
            if apply or output:
                say(f"{profile if apply else output}: not written, for there is no plan")
            raise PlanFailsError
        if output is not None:
            from busplan.profile.write import profile_text

            write = emit_document if new is None else new.write
            write(profile_text(result.recommended.profile).encode())
    if apply:
        _apply(loaded, result)
    elif new is not None:
        say(f"wrote {output}")
    _emit(result, format_=format_, with_circle=with_circle, piped=piped)


def _check_options(
    *, nodes: int | None, axes: int | None, apply: bool, output: Path | None, force: bool, format_: str
) -> None:
    problems = []
    if nodes is not None and axes is not None:
        problems.append(f"--nodes {nodes} and --axes {axes}: give one of them")
    if apply and output is not None:
        problems.append(f"--apply and -o {output}: give one of them; -o leaves PROFILE as it is")
    if output == STANDARD_OUTPUT and format_ != "table":
        problems.append(f"--format {format_} and -o -: standard output takes one document; give -o a file")
    if force and output is None:
        problems.append("--force: goes with -o NEW.toml")
    if problems:
        raise BusplanError(*problems)


def _wanted(
    profile: "Profile", *, nodes: int | None, axes: int | None, period: str | None, gap_count: str | None
) -> "dict[str, Value]":
    """What the options ask for by dotted key, checked."""
    from busplan.analysis.planning.options import nodes_for_axes
    from busplan.profile.toml import override

    origin = dict(BUS_OPTIONS)
    if axes is not None:
        nodes = nodes_for_axes(profile, axes)
        origin["bus.nodes"] = f"--axes {axes}, nodes"
    wanted = bus_changes(nodes=nodes, gap_count=gap_count)
    override(profile, wanted, origin=origin)
    periods = periods_us([period] if period is not None else None, profile)
    if periods:
        wanted["cycle.period_us"] = periods[0]
    return wanted  # type: ignore[return-value]


def _apply(loaded: "LoadedProfile", result: "Plan") -> None:
    """Edit the recommended values into the file."""
    from busplan.answers.plan import settings

    if result.recommended is None:
        return
    changes = result.all_changes(result.recommended)
    if not changes:
        say(f"{loaded.document.name}: nothing to change, left as it is")
        return
    # A whole number is written as one.
    values = {
        key: int(value) if isinstance(value, float) and value.is_integer() else value for key, value in changes.items()
    }
    apply_changes(loaded.document, values)
    say(f"changed {loaded.document.name}: {settings(loaded.profile, changes)}")


def _emit(result: "Plan", *, format_: str, with_circle: bool, piped: bool) -> None:
    """Write the report; where standard output takes the profile, as a summary."""
    from busplan.answers import plan as report

    if piped:
        say(*(line.text for line in report.plan_lines(result, with_circle=with_circle)))
        return
    if format_ == "table":
        emit(report.plan_lines(result, with_circle=with_circle))
        return
    from busplan.answers import documents
    from busplan.forms import json_and_csv

    emit_document(
        json_and_csv.to_json(report.plan_document(result))
        if format_ == "json"
        else json_and_csv.to_csv(documents.with_profile(result.profile.name, report.plan_csv_rows(result)))
    )
