"""Commands that analyse a profile: capacity, latency, circle-test, timeline, explain and report."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from busplan.cli.answering import NOTHING_REFUSED, answer, profile_files, require_apart
from busplan.cli.options import (
    ALL_MODELS,
    AllOption,
    DrawnForm,
    DrawnFormatOption,
    DrawnOutputOption,
    FormatOption,
    OutputOption,
    PeriodsOption,
    ProfileArgument,
    TimingModelOption,
    chosen_model,
    complete_profile,
    format_option,
    load_changed,
    load_each,
    parse_sizes,
    periods_us,
    require_company,
    takes_changes,
    time_us,
)
from busplan.cli.output import PlanFailsError, progress_bar, say
from busplan.errors import BusplanError
from busplan.files import new_file
from busplan.forms import PICTURES, Form
from busplan.profile.changes import NO_CHANGES, KeyChanges, change_options, period_option, shell_word

if TYPE_CHECKING:
    from busplan.forms.blocks import Command
    from busplan.questions.capacity import CapacityAnswer


@takes_changes()
def capacity_command(
    profile: ProfileArgument,
    period: PeriodsOption = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: TimingModelOption = "both",
    sensitivity: bool = False,
    all_: AllOption = False,
    format_: DrawnFormatOption = None,
    output: DrawnOutputOption = None,
) -> None:
    """Tell whether the cycle fits its period, by what margin, and how many axes the bus carries.

    It prints a card: the verdict (fits, not shown to fit, or does not fit) by the timing model that decides on this
    bus; how much of the period is used and free, the fastest period, room for more nodes, and what to measure or
    change. --all adds every figure behind it. Times are in us. Exits 0 with any verdict.

    Example: busplan capacity paper-4ms --period 4ms --period 500us

    Parameters
    ----------
    --sensitivity
        Also tell what moves the margin: 10% more execution time, one node, one axis, 4 bytes, one hop or one retry
        more, 10 us more host time, or a bus reset, one at a time; and what binds next. CSV has these rows instead, and
        a picture their bars.
    """
    refused = NOTHING_REFUSED if sensitivity else _NO_PICTURE
    files = profile_files(profile)
    with answer(format_, output, inputs=files, changes=changes, is_whole=all_, is_drawn=True, refused=refused) as give:
        from busplan.questions.capacity import capacity

        loaded = load_changed(profile, changes)
        result = capacity(
            loaded,
            period_us=periods_us(period, loaded),
            timing_model=chosen_model(timing_model),
            sensitivity=sensitivity,
        )
        give(result.report()._replace(next_commands=_next_commands(str(profile), result, changes)))


_NO_PICTURE: Final[dict[DrawnForm, str]] = dict.fromkeys(
    PICTURES.values(), "capacity draws what moves the margin; give --sensitivity, too"
)


def _next_commands(argument: str, result: "CapacityAnswer", changes: KeyChanges) -> "tuple[Command, ...]":
    """Commands to run next for the same profile."""
    from busplan.forms.blocks import Command

    profile_us, periods = result.profile.cycle.period_us, [verdict.period_us for verdict in result.verdicts]
    tried = period_option(periods[0]) if len(periods) == 1 and periods[0] != profile_us else ()
    changed = " ".join((shell_word(argument), *change_options(changes, period_us=profile_us), *tried))
    second = "circle-test" if all(verdict.all_well for verdict in result.verdicts) else "plan"
    more = "--all" if result.sensitivities else "--sensitivity"
    commands = (f"capacity {changed} {more}", f"{second} {changed}", f"report {changed}")
    return tuple(Command(f"busplan {command}") for command in commands)


@takes_changes(period=True)
def latency_command(
    profile: ProfileArgument,
    payload: str | None = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: TimingModelOption = "both",
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Show how long data takes to arrive, phase by phase, under each timing model.

    On IEEE 1394 it times one read and one write of the farthest node, or, in the broadcast schedule, the data and the
    commands of all nodes; on CAN the worst-case response time of every message, and a loop over feedback and commands;
    on EtherCAT a command, feedback, and a loop over both; on SERCOS feedback and commands of all nodes; on a polled bus
    the whole cycle. Times are in us, sizes in bytes; each phase has its equation or source. Exits 0 with any figures.

    Example: busplan latency paper-two-node --payload 4,16,1024

    Parameters
    ----------
    --payload BYTES[,BYTES...]
        Payload of both read and write in bytes, or several with commas, as 4,16,32. [default: the profile's
        payload.read_bytes and payload.write_bytes]
    """
    with answer(format_, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
        from busplan.questions.latency import latency

        loaded = load_changed(profile, changes)
        latencies = latency(
            loaded,
            payload_bytes=None if payload is None else parse_sizes(payload, option="--payload"),
            timing_model=chosen_model(timing_model),
        )
        give(latencies)


@takes_changes()
def circle_test_command(
    profile: ProfileArgument,
    period: PeriodsOption = None,
    changes: KeyChanges = NO_CHANGES,
    contributions: bool = False,
    trace: Path | None = None,
    every: Annotated[int | None, typer.Option(min=1)] = None,
    all_: AllOption = False,
    format_: DrawnFormatOption = None,
    output: DrawnOutputOption = None,
) -> None:
    """Tell whether the circle is still round: simulate both axes at the period that the bus delivers.

    The test has three parts. The bus: a cycle that does not fit its period fails before any simulation. Stability: a
    loop without its phase and gain margin fails, however round its circle. The tolerances of the profile: without any,
    the circle is not judged, nor below 0.1 um, where no error source of the profile matters. Errors are in um in the
    table, in mm in JSON and CSV; F_min, F_max and G are the terms of ISO 230-4, and circle.path = "iso230-4" measures
    them on a whole turn. A picture shows the magnified polar error, the error over time and the ranked error sources,
    with tolerances. Exits 0 when the test passes or the circle is not judged, and 1 when it fails.

    Example: busplan circle-test paper-4ms --contributions

    Parameters
    ----------
    --contributions
        Rank the error sources: run the test again without each of them.
    --trace FILE.csv
        Write time [us], commanded and actual position [mm] and contour error [mm] as CSV; an old file is replaced.
        [default: no file]
    --every N
        Write one of N steps of the simulation to --trace. [default: 10]
    """
    require_company("--trace FILE.csv", {"--every": every}, is_given=trace)
    files = list(profile_files(profile))
    require_apart({"--output": output, "--trace": trace}, inputs=files)
    with answer(format_, output, inputs=files, changes=changes, is_whole=all_, is_drawn=True) as give:
        from busplan.questions.circle import circle_test

        loaded = load_changed(profile, changes)
        periods = periods_us(period, loaded)
        with new_file(trace, overwrite=True) if trace else nullcontext() as trace_file:
            # Opened before the simulation, so that a path that cannot be written fails at once.
            with _naming(profile, period), progress_bar("circle test") as progress:
                test = circle_test(loaded, period_us=periods, contributions=contributions, progress=progress)
            if trace_file is not None:
                trace_file.writelines(block.encode() for block in test.trace_csv(every=every or 10))
        if trace is not None:
            say(f"wrote {trace}")
        give(test)
    if test.passed is False:
        raise PlanFailsError


@contextmanager
def _naming(profile: str, period: list[str] | None) -> Iterator[None]:
    """Name the file and --period in errors about a circle that cannot be run."""
    try:
        yield
    except BusplanError as error:
        from busplan.profile.sources import locate

        _, name = locate(profile)
        typed = "".join(f" (with --period {text})" for text in period or ())
        raise BusplanError(*(f"{name}: {problem}{typed}" for problem in error.problems)) from None


@takes_changes(period=True)
def timeline_command(
    profile: ProfileArgument,
    from_: str | None = None,
    to: str | None = None,
    transaction: str | None = None,
    cycle: int | None = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: str | None = None,
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

    Parameters
    ----------
    --from TIME
        Show the cycle from this time on, counted from its start, with its unit, as 50us or 0.1ms. [default: its start]
    --to TIME
        Show the cycle up to this time, with its unit; beyond its end means its end. [default: its end]
    --transaction NAME:N
        Show one transaction of one node (from 1) with its gaps, by its name on this bus, as read:1, feedback:1, frame:1
        or mdt:1; a wrong name lists the right ones. --from and --to may narrow it further. [default: all of them]
    --cycle N
        Show the N-th cycle, from 1, of groups with rates of their own (every = n, on CAN and EtherCAT); beyond their
        common multiple the cycles repeat. [default: the fullest, which the verdict is for]
    --timing-model MODEL
        Timing model of the profile's kind of bus, by its name; on IEEE 1394 paper or standard. [default: the one
        that decides]
    """
    from_us = None if from_ is None else time_us(from_, option="--from")
    to_us = None if to is None else time_us(to, option="--to")
    if from_us is not None and to_us is not None and from_us >= to_us:
        raise BusplanError(f"--from {from_} --to {to}: the window must end after it begins")
    files = profile_files(profile)
    with answer(format_, output, inputs=files, changes=changes, is_whole=all_, is_drawn=True) as give:
        from busplan.questions.timeline import timeline

        loaded = load_changed(profile, changes)
        schedule = timeline(
            loaded, timing_model=timing_model, from_us=from_us, to_us=to_us, transaction=transaction, cycle=cycle
        )
        give(schedule)


def complete_figure(incomplete: str) -> list[str]:
    """Complete the name of a figure for the shell."""
    from busplan.questions.explain import figure_names

    return [name for name in figure_names() if name.startswith(incomplete)]


@takes_changes()
def explain_command(
    profile: ProfileArgument,
    figure: Annotated[str | None, typer.Argument(autocompletion=complete_figure)] = None,
    period: PeriodsOption = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: str | None = None,
    transaction: str | None = None,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Show where a figure of the bus comes from: every step in symbols and in numbers, and its inputs.

    Each step names its equation. Each input has its source and its grade: published, derived, recalled, measured,
    calibrated or assumed, or "given" where the profile sets it. The steps are those of the computation itself. What is
    searched for, compared or simulated has no equation: capacity and circle-test show it. Exits 0 with any figures.

    Example: busplan explain paper-4ms required_us

    Parameters
    ----------
    FIGURE
        A key in the JSON of capacity or latency, as required_us (latency.gaps_us where both have it); the number of an
        equation, as "(11)"; a label of a table, as arbitration; or a transaction, a message or a group of nodes, for
        its latency. [default: what the verdict rests on, and a list of all figures]
    --timing-model MODEL|both
        Timing model; bias and uncertainty have only the one that decides. [default: the one that decides, or the first
        that has the figure]
    --transaction NAME
        For a figure of latency: the name of the transaction or message, as read, SYNC or loop. A wrong name lists the
        right ones. [default: all]
    """
    with answer(format_, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
        from busplan.questions.base.arguments import checked_models, load_network
        from busplan.questions.explain import explain

        loaded = load_changed(profile, changes)
        explanation = explain(
            loaded,
            figure,
            period_us=periods_us(period, loaded),
            timing_model=checked_models(None, load_network(loaded)) if timing_model == ALL_MODELS else timing_model,
            transaction=transaction,
        )
        give(explanation)


_REFUSED: Final[dict[DrawnForm, str]] = {
    "csv": "a page holds many tables; each names its command, and that command's --format csv has its rows"
}


@takes_changes("It holds for all profiles, as --period does.", period=True)
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
    title: str | None = None,
    changes: KeyChanges = NO_CHANGES,
    circle: bool | None = None,
) -> None:
    """Put the answers for a profile on one page, for a screen, a machine's file or a repository.

    The first screen has the verdict and the map; every other answer is behind a fold, with its command, and is printed
    whole. Times are in us, contour errors in um. Several profiles are compared at the top. The HTML needs no network
    and no script. Exits 0 with any verdict.

    Example: busplan report paper-4ms paper-1ms -o report.html

    Parameters
    ----------
    --title TEXT
        Heading of the page. [default: the profile's name, or the number of profiles]
    --circle/--no-circle
        Run the circle test of profiles that ask for one. [default: where servo values are measured]
    """
    from busplan.english import has_controls

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
        give(page)
