"""Commands that analyse a profile: capacity, latency, circle-test, timeline, explain and report."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

import busplan
from busplan.cli.answering import profile_files, require_apart
from busplan.cli.command import Call, Fails, command, load_each
from busplan.cli.options import (
    ALL_MODELS,
    ChannelOption,
    TimingModelOption,
    chosen_model,
    complete_profile,
    parse_sizes,
    require_company,
    time_us,
)
from busplan.cli.output import progress_bar, say
from busplan.errors import BusplanError
from busplan.files import new_file
from busplan.forms import PICTURES
from busplan.profile.changes import change_options, period_option, shell_word

if TYPE_CHECKING:
    from busplan.forms.blocks import Command, Report
    from busplan.questions.base.answer import Answer


_MOST_DIGITS: Final = 9
"""Digits of a cycle's number, at most."""


@command(period="several", is_drawn=True)
def capacity_command(
    call: Call,
    timing_model: TimingModelOption = "both",
    sensitivity: Annotated[
        bool,
        typer.Option(
            "--sensitivity",
            help="Also tell what moves the margin: 10% more execution time, one node, one axis, 4 bytes, one hop "
            "or one more retry, 10 us more host time, or a bus reset, one at a time; and what binds next. "
            "CSV then has these rows, and a picture their bars.",
        ),
    ] = False,
) -> "Report":
    """Tell whether the cycle fits its period, by what margin, and how many axes the bus carries.

    It prints a card: the verdict (fits, not shown to fit, or does not fit) by the timing model that decides on this
    bus; how much of the period is used and free, the fastest period, room for more nodes, and what to measure or
    change. In its bar # is used, ~ in doubt, . free, and r the reserve; | ends the slice. --all adds every figure
    behind it. Times are in us. Exits 0 with any verdict.

    Example: busplan capacity paper-4ms --period 4ms,500us
    """
    if not sensitivity and call.form in PICTURES.values():
        raise BusplanError(f"{call.form_typed}: capacity draws what moves the margin; give --sensitivity, too")
    result = busplan.capacity(
        call.profile,
        period_us=call.periods_us,
        timing_model=chosen_model(timing_model),
        sensitivity=sensitivity,
    )
    return result.report()._replace(next_commands=_next_commands(call, result))


def _next_commands(call: Call, result: "busplan.CapacityAnswer") -> "tuple[Command, ...]":
    """Commands to run next for the same profile."""
    from busplan.forms.blocks import Command

    profile_us, (tried_us, *others) = result.profile.cycle.period_us, (verdict.period_us for verdict in result.verdicts)
    tried = period_option(tried_us) if tried_us not in (profile_us, None) and not others else ()
    changed = " ".join((shell_word(call.argument), *change_options(call.changes, period_us=profile_us), *tried))
    second = "circle-test" if all(verdict.all_well for verdict in result.verdicts) else "plan"
    more = "--all" if result.sensitivities else "--sensitivity"
    page = shell_word(f"{'report' if call.argument == '-' else Path(call.argument).stem}.html")
    commands = (f"capacity {changed} {more}", f"{second} {changed}", f"report {changed} -o {page}")
    return tuple(Command(f"busplan {command}") for command in commands)


@command(period="one")
def latency_command(
    call: Call,
    payload: Annotated[
        str | None,
        typer.Option(
            metavar="BYTES[,BYTES...]",
            help="Payload of both read and write in bytes, or several with commas, as 4,16,32.  [default: the "
            "profile's payload.read_bytes and payload.write_bytes]",
        ),
    ] = None,
    timing_model: TimingModelOption = "both",
) -> "Answer":
    """Show the delay of data, phase by phase, under each timing model.

    On IEEE 1394 it times one read and one write of the farthest node, or, in the broadcast schedule, the data and the
    commands of all nodes; on CAN the worst-case response time of every message, and a loop over feedback and commands;
    on EtherCAT a command, feedback, and a loop over both; on SERCOS feedback and commands of all nodes; on a polled bus
    the whole cycle. Times are in us, sizes in bytes; each phase has its equation or source. Exits 0 whatever the
    figures.

    Example: busplan latency paper-two-node --payload 4,16,1024
    """
    sizes = None if payload is None else parse_sizes(payload, option="--payload")
    return busplan.latency(call.profile, payload_bytes=sizes, timing_model=chosen_model(timing_model))


@command(period="several", is_drawn=True)
def circle_test_command(
    call: Call,
    contributions: Annotated[
        bool, typer.Option("--contributions", help="Rank the error sources: run the test again without each of them.")
    ] = False,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Write time [us], commanded and actual position [mm] and contour error [mm] as CSV; an old file "
            "is replaced.  [default: no file]",
        ),
    ] = None,
    every: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Write one of N steps of the simulation to --trace.  [default: 10]"),
    ] = None,
) -> "Answer | Fails":
    """Tell whether the circle is still round: simulate both axes at the period that the bus delivers.

    The test has three parts. The bus: a cycle that does not fit its period fails before any simulation. Stability: a
    loop without its phase and gain margin fails, however round its circle. The tolerances of the profile: a circle
    without tolerances is not judged, nor is one below 0.1 um, where no error source of the profile matters. Errors are
    in um in the table, in mm in JSON and CSV; F_min, F_max and G are the terms of ISO 230-4, and circle.path =
    "iso230-4" measures them on a whole turn. A picture shows the magnified polar error, the error over time and the
    ranked error sources, with tolerances. Exits 0 when the test passes or the circle is not judged, and 1 when it
    fails.

    Example: busplan circle-test paper-4ms --contributions
    """
    require_company("--trace FILE.csv", {"--every": every}, is_given=trace)
    require_apart({"--output": call.output, "--trace": trace}, inputs=profile_files(call.argument))
    periods = call.periods_us
    with new_file(trace, overwrite=True) if trace else nullcontext() as trace_file:
        # Opened before the simulation, so that a path that cannot be written fails at once.
        with _naming(call), progress_bar("circle test") as progress:
            test = busplan.circle_test(call.profile, period_us=periods, contributions=contributions, progress=progress)
        if trace_file is not None:
            trace_file.writelines(block.encode() for block in test.trace_csv(every=every or 10))
    if trace is not None:
        say(f"wrote {trace}")
    return Fails(test) if test.passed is False else test


@contextmanager
def _naming(call: Call) -> Iterator[None]:
    """Name the file and --period in errors about a circle that cannot be run."""
    try:
        yield
    except BusplanError as error:
        from busplan.profile.sources import locate

        _, name = locate(call.argument)
        typed = "".join(f" (with --period {text})" for text in call.periods)
        raise BusplanError(*(f"{name}: {problem}{typed}" for problem in error.problems)) from None


@command(period="one", is_drawn=True, reads=lambda recording, **_: () if recording is None else (recording,))
def timeline_command(
    call: Call,
    from_: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="TIME",
            help="Show the cycle from this time on, counted from its start, with its unit, as 50us or "
            "0.1ms.  [default: its start]",
        ),
    ] = None,
    to: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="Show the cycle up to this time, with its unit; beyond its end means its end.  [default: its end]",
        ),
    ] = None,
    transaction: Annotated[
        str | None,
        typer.Option(
            metavar="NAME:N",
            help="Show one transaction of one node (from 1) with its gaps, by its name on this bus, as read:1, "
            "feedback:1, frame:1 or mdt:1; a wrong name lists the right ones. --from and --to may narrow it "
            "further.  [default: all of them]",
        ),
    ] = None,
    cycle: Annotated[
        str | None,
        typer.Option(
            metavar="N|worst|median",
            help="Show the N-th cycle, from 1, of groups with rates of their own (every = n, on CAN and "
            "EtherCAT); beyond their common multiple the cycles repeat. Of --recording its N-th, the longest or "
            "the median one.  [default: the fullest, which the verdict is for; of a recording worst]",
        ),
    ] = None,
    timing_model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL",
            help="Timing model of the profile's kind of bus, by its name; on IEEE 1394 paper or "
            "standard.  [default: the one that decides]",
        ),
    ] = None,
    recording: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Show a cycle of this recording beside the same cycle of the plan: of EtherCAT a pcap or pcapng "
            "file, of CAN a log of candump, ASC, BLF or TRC, or a capture of SocketCAN.  [default: the plan alone]",
        ),
    ] = None,
    channel: ChannelOption = None,
) -> "Answer":
    """Show one communication cycle as events, node by node and to scale.

    The events are everything that takes time on the wire, in its order, the time for non-periodic data, and the rest of
    the slice. Without that rest they add up to the required time of `busplan capacity`. A cycle that overruns its slice
    is shown whole, and says so. Every node is computed with the hops of the farthest, unless the profile says
    otherwise.

    With --recording it shows where the time of a recorded cycle went: frames at their length on the wire, and between
    them what was waited for (nodes, or the host with its adapter), frames that are not of the cycle, and what cannot be
    attributed. Both cycles go from their first frame to their last one; their shares add up to them. Times are in us.
    Exits 0 whatever the verdict.

    Example: busplan timeline paper-4ms --transaction read:1
    """
    window = {"--from": from_, "--to": to, "--transaction": transaction, "--timing-model": timing_model}
    if recording is not None:
        for option, given in window.items():
            if given is not None:
                raise BusplanError(f"{option} {given}: a recording is shown by whole cycles; leave it out")
        with progress_bar("recording") as progress:
            return busplan.timeline(
                call.profile, recording=recording, cycle=_cycle(cycle), channel=channel, progress=progress
            )
    require_company("--recording FILE", {"--channel": channel}, is_given=False)
    number = _cycle(cycle)
    if isinstance(number, str):
        raise BusplanError(f"--cycle {cycle}: needs --recording FILE; a planned cycle has a number from 1")
    from_us = None if from_ is None else time_us(from_, option="--from")
    to_us = None if to is None else time_us(to, option="--to")
    if from_us is not None and to_us is not None and from_us >= to_us:
        raise BusplanError(f"--from {from_} --to {to}: the window must end after it begins")
    return busplan.timeline(
        call.profile, timing_model=timing_model, from_us=from_us, to_us=to_us, transaction=transaction, cycle=number
    )


def _cycle(text: str | None) -> "int | Literal['worst', 'median'] | None":
    """Number of a cycle, or the rule that chooses one."""
    match text:
        case None | "worst" | "median":
            return text
    if not text.isascii() or not text.isdigit() or len(text) > _MOST_DIGITS or not int(text):
        raise BusplanError(f"--cycle {text}: expected a whole number from 1, worst or median")
    return int(text)


def complete_figure(incomplete: str) -> list[str]:
    """Complete the name of a figure for the shell."""
    from busplan.questions.explain import figure_names

    return [name for name in figure_names() if name.startswith(incomplete)]


@command(period="several")
def explain_command(
    call: Call,
    figure: Annotated[
        str | None,
        typer.Argument(
            autocompletion=complete_figure,
            help="A key in the JSON of capacity or latency, as required_us (latency.gaps_us where both have it); "
            'the number of an equation, as "(11)"; a label of a table, as arbitration; or a transaction, a '
            "message or a group of nodes, for its latency.  [default: what the verdict rests on, and a list "
            "of all figures]",
        ),
    ] = None,
    timing_model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL|both",
            help="Timing model; bias and uncertainty have only the one that decides.  [default: the one that "
            "decides, or the first that has the figure]",
        ),
    ] = None,
    transaction: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="For a figure of latency: the name of the transaction or message, as read, SYNC or loop. A "
            "wrong name lists the right ones.  [default: all]",
        ),
    ] = None,
) -> "Answer":
    """Show where a figure of the bus comes from: every step in symbols and in numbers, and its inputs.

    Each step names its equation. Each input has its source and its grade: published, derived, recalled, measured,
    calibrated or assumed, or "given" where the profile sets it. The steps are those of the computation itself. What is
    searched for, compared or simulated has no equation: capacity and circle-test show it. Exits 0 whatever the figures.

    Example: busplan explain paper-4ms required_us
    """
    from busplan.questions.base.arguments import checked_models, load_network

    model = checked_models(None, load_network(call.profile)) if timing_model == ALL_MODELS else timing_model
    return busplan.explain(call.profile, figure, period_us=call.periods_us, timing_model=model, transaction=transaction)


@command(
    "It holds for all profiles, as --period does.",
    of="profiles",
    period="one",
    reads=lambda profiles, recording, **_: (*profile_files(*profiles), *([recording] if recording else [])),
    has_all=False,
    default="html",
    names_changes=True,
)
def report_command(
    call: Call,
    profiles: Annotated[
        list[str],
        typer.Argument(
            metavar="PROFILE",
            help="Profile files, shipped names (see `busplan profiles`), or once - for standard input.",
            autocompletion=complete_profile,
            show_default=False,
        ),
    ],
    title: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT", help="Heading of the page.  [default: the profile's name, or the number of profiles]"
        ),
    ] = None,
    circle: Annotated[
        bool | None,
        typer.Option(
            help="Run the circle test of profiles that ask for one.  [default: where servo values are measured]"
        ),
    ] = None,
    recording: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A recording of the machine of the one profile, as `measured` takes it: compared with the plan, "
            "with its longest cycle.  [default: none]",
        ),
    ] = None,
    channel: ChannelOption = None,
) -> "Answer":
    """Put the answers for a profile on one page, for a screen, a machine's file or a repository.

    The first screen has the verdict and the map; every other answer is behind a fold, with its command, and is printed
    whole. Times are in us, contour errors in um. Several profiles are compared at the top. The HTML needs no network
    and no script. Exits 0 whatever the verdict.

    Example: busplan report paper-4ms paper-1ms -o report.html
    """
    from busplan.english import has_controls

    if title is not None and (has_controls(title) or not title.strip()):
        raise BusplanError(f"--title {title!r}: expected words in one line, without control characters")
    if call.form == "csv":
        raise BusplanError(
            f"{call.form_typed}: a page holds many tables; each names its command, and that command's --format csv "
            "has its rows"
        )
    require_company("--recording FILE", {"--channel": channel}, is_given=recording is not None)
    with progress_bar("circle tests") as progress:
        return busplan.report(
            load_each(profiles, lambda argument: Call(argument, call.changes).profile),
            title=title,
            circle=circle,
            recording=recording,
            channel=channel,
            progress=progress,
            # The page names the changes itself, for they stand in its commands, too.
            origins=[(argument, call.changes) for argument in profiles],
        )
