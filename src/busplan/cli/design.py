"""Commands that design a machine: plan, calibrate, measured, emulate, map, compare and import."""

import shlex
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import busplan
from busplan.cli.answering import answer, profile_files, require_apart
from busplan.cli.command import Call, command
from busplan.cli.options import (
    STANDARD_OUTPUT,
    VALUES_HELP,
    AllOption,
    ChannelOption,
    FormatOption,
    JobsOption,
    complete_kind,
    form_of_file,
    form_typed,
    output_option,
    parse_axis,
    require_company,
    time_us,
)
from busplan.cli.output import PlanFailsError, message_width, progress_bar, say, write_document
from busplan.cli.rewrite import apply_changes, require_own_file
from busplan.english import printable
from busplan.errors import BusplanError
from busplan.files import NewFile, given_path, new_file
from busplan.forms import ENDINGS, Form, ending_expected
from busplan.profile.changes import KeyChange, KeyChanges, require_separate

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from busplan.forms.blocks import Report
    from busplan.profile.document import LoadedProfile
    from busplan.questions.base.answer import Answer


_PROFILE_ENDINGS = ("", ".toml")
_MAX_AXES = 1_000_000
_LONGEST_NAME = 100
_LONGEST_DESCRIPTION = 2000


@command("Part of the goal, as --period: it is kept, and --apply and -o write it.", period="one", answers=False)
def plan_command(
    call: Call,
    nodes: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Goal: number of distributed nodes, the host not counted.  [default: the profile's bus.nodes]",
        ),
    ] = None,
    axes: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=_MAX_AXES,
            help="Goal: number of axes, instead of --nodes; the nodes follow from the profile's "
            "node.axes.  [default: the axes of the nodes]",
        ),
    ] = None,
    free: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Settings that may change, with commas: keys, as cycle.slice_ratio, or names. On every bus "
            "slice_ratio, payload (less), period and nodes (fewer); on IEEE 1394 gap_count, responses "
            "(reads concatenated, writes unified) and schedule; on CAN pdo_per, bit_rate, data_bit_rate, "
            "identifier_bits and access; on EtherCAT sync_shift; on SERCOS III timing_method; on polled "
            "buses return_delay, bit_rate and requests.  [default: all but payload and nodes]",
        ),
    ] = None,
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
            metavar="FILE",
            help=f"A name ending in {', '.join(ENDINGS)}: write the report there; an old file is replaced. Any other "
            "name, as NEW.toml: write a copy of PROFILE with the recommended values, named after the file; - "
            "is standard output, and the report goes to standard error.  [default: no file, and the report to standard "
            "output]",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Let -o NEW.toml overwrite an existing file.")] = False,
    all_: AllOption = False,
    format_: FormatOption = None,
) -> None:
    """Find the settings for a number of nodes or axes: gap count, slice ratio, period, or several of them.

    It changes one thing at a time, the cheapest first and as little as possible, until the goal is shown to fit with
    its reserve, at a safe gap count, within all [limits]. The cheapest first is: gap_count, slice_ratio, responses,
    schedule, payload, period, nodes. The slice ratio goes up to 0.9; the period changes only if nothing cheaper is
    enough. Values given by an option are kept.

    The table has a row for each thing that was tried. Margins are in us, less the model's bias. Without a plan the
    answer names what prevents it and what would be enough. `busplan manual plan` has more. Exits 0 when there is a
    plan, 1 when there is none.

    Example: busplan plan paper-1ms --axes 16
    """
    changes = call.changes
    if nodes is not None:
        changes = KeyChanges((KeyChange("bus.nodes", nodes, "--nodes", str(nodes)), *changes.entries))
    report_file = output if output is not None and output.suffix.lower() in ENDINGS else None
    if report_file is None and output is not None and output.suffix.lower() not in _PROFILE_ENDINGS:
        raise BusplanError(
            f"--output {output}: expected a name ending in .toml for the profile, or in {', '.join(ENDINGS)} for the "
            "report"
        )
    new = None if report_file is not None else output
    _check_options(changes, axes=axes, apply=apply, new=new, force=force, format_=format_)
    piped, inputs = new == STANDARD_OUTPUT, [*profile_files(call.argument)]
    require_apart({"--output": None if piped else new}, inputs=inputs, of_profiles=True)
    form: Form = form_of_file(format_, report_file, forms=ENDINGS, default="table")
    typed = form_typed(format_, report_file)
    with answer(form, report_file, typed=typed, inputs=inputs, changes=changes, is_whole=all_) as give:
        if apply:
            require_own_file(call.argument)
        loaded = call.loaded
        with ExitStack() as files:
            # Opened before the search, so that a path that cannot be written fails at once.
            file = files.enter_context(new_file(new, overwrite=force)) if new and not piped else None
            result = busplan.plan(
                loaded.profile,
                axes=axes,
                changes=changes,
                free=None if free is None else [name.strip() for name in free.split(",")],
            )
            if new is not None:
                _write_profile(loaded, result, file, name=None if piped else new.stem)
        if result.recommended is None:
            if apply or new:
                say(f"{call.argument if apply else new}: not written, for there is no plan")
        elif apply:
            _apply(loaded, result)
        elif file is not None:
            say(f"wrote {new}")
        (partial(_say_report, changes) if piped else give)(result)
    if result.recommended is None:
        raise PlanFailsError


def _check_options(
    changes: KeyChanges, *, axes: int | None, apply: bool, new: Path | None, force: bool, format_: Form | None
) -> None:
    problems = []
    if axes is not None:
        nodes = [change.typed for change in changes.entries if change.key == "bus.nodes"]
        problems += [f"{typed} and --axes {axes}: give one of them" for typed in nodes]
    if apply and new is not None:
        problems.append(f"--apply and -o {new}: give one of them; -o leaves PROFILE as it is")
    if new == STANDARD_OUTPUT and format_ not in (None, "table"):
        problems.append(f"--format {format_} and -o -: standard output takes one document; give -o a file")
    if force and new is None:
        problems.append("--force: needs -o NEW.toml")
    if problems:
        raise BusplanError(*problems)


def _apply(loaded: "LoadedProfile", result: "busplan.PlanAnswer") -> None:
    """Write the recommended values into the profile's file."""
    if not result.recommended_changes:
        say(f"{loaded.document.name}: nothing to change, left as it is")
        return
    apply_changes(loaded.document, _choices(result), are_choices=True)
    say(f"changed {loaded.document.name}: {result.recommended_words}")


def _write_profile(
    loaded: "LoadedProfile", result: "busplan.PlanAnswer", file: NewFile | None, *, name: str | None
) -> None:
    """Write the recommended profile to its file or standard output; without a plan, an old file stays unchanged.

    A file is another plan than the profile: it has another name, and its description names the profile that it comes
    from.
    """
    if result.recommended is not None:
        from busplan.profile.edit import edited_copy

        profile, choices = loaded.profile, _choices(result)
        if name is not None:
            choices["name"] = printable(name).strip()[:_LONGEST_NAME] or profile.name
            if profile.description.strip():
                words = f"A plan of {profile.name}, which is: {profile.description.strip()}"
                choices["description"] = words[:_LONGEST_DESCRIPTION]
        write_document(edited_copy(loaded, choices), file)
    elif file is not None:
        file.abandon()


def _choices(result: "busplan.PlanAnswer") -> dict[str, object]:
    """The recommended values by key, as a file has them."""
    from busplan.profile.edit import whole

    return {key: whole(value) for key, value in (result.recommended_changes or {}).items()}


def _say_report(changes: KeyChanges, result: "Answer") -> None:
    """Write the report to standard error: standard output has a document."""
    from busplan.forms.terminal import block_lines
    from busplan.questions.base.sentences import changed_report

    blocks = changed_report(result.report(), changes).blocks
    say(*(line.text for line in block_lines(blocks, width=message_width())))


@command(
    "For a bench that differed from the profile: --apply does not write it.",
    reads=lambda measurements, **_: _measurements_file(measurements),
)
def calibrate_command(
    call: Call,
    measurements: Annotated[
        str,
        typer.Argument(
            help="A CSV file of measured latencies, the shipped example table-1.csv, or - for standard input."
        ),
    ],
    group: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="In a profile with groups: the group of nodes that was measured.  [default: its one group]",
        ),
    ] = None,
    timing_model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL", help="Timing model for the time of the packets.  [default: the one that decides]"
        ),
    ] = None,
    apply: Annotated[
        bool,
        typer.Option(
            "--apply",
            help="Write [node.execution], or that of the group, into the file PROFILE, with a comment on its "
            "origin; your own comments stay.",
        ),
    ] = False,
) -> "Report":
    """Find the execution time T_exec of a node from latencies measured on an IEEE 1394 bus.

    The CSV file has a header, the columns payload_bytes and latency_us (T_lant, from the request to its last
    acknowledge, in us) and a line for each measurement; payloads may repeat, and lines that begin with # are comments.
    A column transaction says read or write (write without it).

    T_exec is the latency less the time of its packets by the timing model, equation (3); each payload has the median.
    Where the bench differs from the profile, give its values: --set bus.nodes=2 --set bus.gap_count=63. Of three or
    more measurements of a payload, those far from their median are named by their line and left out; slow ones give
    worst_extra_us. Times are in us. Exits 0 whatever the figures.

    Example: busplan calibrate paper-two-node table-1.csv
    """
    if call.argument == measurements == "-":
        raise BusplanError("only one of PROFILE and MEASUREMENTS can be standard input")
    if apply:
        require_own_file(call.argument)
    from busplan.profile.document import read_bytes
    from busplan.profile.measurements import MAX_MEASUREMENTS_BYTES
    from busplan.profile.sources import locate_measurements

    bench = call.profile
    path, name, shipped = locate_measurements(measurements)
    calibration = busplan.calibrate(
        bench,
        # Read here: Python reads no standard input, and takes a name of several lines for CSV text.
        measurements if shipped else read_bytes(path, name=name, limit=MAX_MEASUREMENTS_BYTES),
        group=group,
        timing_model=timing_model,
        source=name,
    )
    if apply:
        _write_edits(call, calibration, words=f"[{' '.join(calibration.notes)}]")
    return calibration.report(applied_to=call.argument if apply else None)


def _write_edits(call: Call, answer: "busplan.CalibrateAnswer | busplan.MeasuredAnswer", *, words: str) -> None:
    """Write what was measured into the profile's file, but for keys that --set gives for the measurement."""
    for change, key in product(call.changes.by_set, answer.edits):
        require_separate(change, key, typed="--apply")
    apply_changes(call.loaded.document, answer.edits, notes=answer.notes)
    say(
        f"wrote {words} of {call.loaded.document.name}; your comments are kept: see whether they hold of the new values"
    )


def _measurements_file(argument: str) -> Iterator[Path]:
    """File of the MEASUREMENTS argument; nothing if there is none: reading it will report the error."""
    from busplan.profile.sources import locate_measurements

    with suppress(BusplanError, ValueError):  # ValueError: a NUL in the path
        yield locate_measurements(argument).path


@command(
    "For a machine that was recorded with another value: --apply does not write it.",
    reads=lambda recording, **_: () if recording is None else (given_path(recording),),
)
def measured_command(
    call: Call,
    recording: Annotated[
        str | None,
        typer.Argument(
            help="A recording of the machine: of EtherCAT a pcap or pcapng file, of CAN a log of candump, ASC, "
            "BLF or TRC, or a capture of SocketCAN.  [default: none; a CAN log stands in the place of PROFILE]",
            show_default=False,
        ),
    ] = None,
    quantile: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            help="Share of the cycles that jitter and times must cover, 0.5..1 [1].  [default: 1, the worst recorded]",
            show_default=False,
        ),
    ] = 1.0,
    channel: ChannelOption = None,
    bit_rate: Annotated[
        float | None,
        typer.Option(
            metavar="RATE",
            help="Without PROFILE: bit rate of the bus [kbit/s].  [default: that of back-to-back frames in the log]",
        ),
    ] = None,
    data_bit_rate: Annotated[
        float | None,
        typer.Option(metavar="RATE", help="Without PROFILE: bit rate of the data of CAN FD [kbit/s].  [default: 2000]"),
    ] = None,
    apply: Annotated[
        bool,
        typer.Option(
            "--apply",
            help="Write the values that were measured into the file PROFILE, with a comment on their origin; "
            "your own comments stay.",
        ),
    ] = False,
) -> "Answer | Report":
    """Compare a recording of the machine's bus with its plan, or say what a CAN log has.

    Each figure has the planned and the recorded value, the residual, its expanded uncertainty U, and whether it is
    within the plan: jitter, times, load and bytes at most as planned, or beyond it by no more than U. A figure that the
    recording cannot show has the reason instead. On EtherCAT record all packets of the master's port, both ways. Times
    are in us. `busplan manual measured` says how each figure is measured. Exits 0 whatever the figures.

    Of a CAN log without PROFILE it says which identifiers there are and when they come, the load, the gaps, errors and
    emergencies, and what the stamps show.

    Example: busplan measured ethercat-servo-8 capture.pcapng --quantile 0.9
    """
    if recording is None:
        return _recorded(call, {"--apply": apply, "--quantile": quantile != 1}, bit_rate, data_bit_rate, channel)
    if bit_rate is not None or data_bit_rate is not None:
        raise BusplanError("--bit-rate: the profile has it, as bus.bit_rate_kbit_s; --set changes it")
    if apply:
        require_own_file(call.argument)
    with progress_bar("recording") as progress:
        seen = busplan.measured(call.profile, recording, quantile=quantile, channel=channel, progress=progress)
    if apply and not seen.edits:
        why = f": {'; '.join(seen.shows_nothing)}" if seen.shows_nothing else ""
        raise BusplanError(f"--apply: {recording} shows no value of a key{why}")
    if apply:
        _write_edits(call, seen, words=", ".join(seen.edits))
    return seen.report(applied_to=call.argument if apply else None)


def _recorded(
    call: Call,
    for_profile: Mapping[str, bool],
    bit_rate: float | None,
    data_bit_rate: float | None,
    channel: str | None,
) -> "Answer":
    """What a recording has that is the only argument."""
    from busplan.profile.sources import shipped_names

    name = call.argument
    if name.endswith(".toml") or name in shipped_names():
        raise BusplanError(f"{name}: is a profile: give a recording behind it, or a CAN log alone")
    given = [option for option, is_given in {**for_profile, "--set": bool(call.changes.entries)}.items() if is_given]
    if given:
        raise BusplanError(f"{given[0]}: needs a profile: busplan measured PROFILE {name}")
    with progress_bar("recording") as progress:
        return busplan.recorded(
            name, bit_rate_kbit_s=bit_rate, data_bit_rate_kbit_s=data_bit_rate, channel=channel, progress=progress
        )


@command("For a machine that differs from its plan.", period="one", answers=False)
def emulate_command(
    call: Call,
    cycles: Annotated[
        int | None, typer.Option(metavar="N", help="Length of the recording, in cycles.  [default: 1000]")
    ] = None,
    duration: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Length of the recording as a time with its unit.  [default: --cycles]"),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=VALUE]",
            help="A fault of the machine; may be repeated. VALUE is how often it happens, as lost-frame=3, or "
            "how late, as jitter=50us.  [default: 5 times, a share of the period]",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(metavar="N", help="Seed of jitter and data; the same seed gives the same bytes.")
    ] = 1,
    output: Annotated[Path | None, output_option("Write the recording to FILE.pcapng, FILE.log or .candump")] = None,
) -> None:
    """Write the recording that the planned machine would give, to try software before the machine exists.

    EtherCAT gives a capture of the master's port, pcapng, and CAN a log of candump. The file says that it is synthetic,
    not a measurement. Faults of EtherCAT: missing-cycle, lost-frame, wrong-working-counter, jitter. Faults of CAN:
    error-frame; with SYNC missing-cycle, missing-pdo, double-pdo, late-command, jitter; without it lost-answer,
    double-answer, slow-node, slow-host. Exits 0 when it is written.

    Example: busplan emulate can-servo-8 --fault late-command -o log.candump
    """
    require_apart({"--output": output}, inputs=profile_files(call.argument))
    from busplan.questions.emulate import emulator_of

    faults, endings, *_ = emulator_of(call.profile)
    if output is not None and output.suffix.lower() not in endings:
        raise BusplanError(f"--output {output}: {ending_expected(output.suffix, endings)}")
    if output is None and sys.stdout.isatty():
        raise BusplanError(f"a recording is not for a terminal; give -o FILE{endings[0]}, or use a pipe")
    length_us = None if duration is None else time_us(duration, option="--duration")
    units = {known.name: known.unit for known in faults}
    given = dict(_fault(text, units) for text in fault or [])
    with ExitStack() as files:
        file = None if output is None else files.enter_context(new_file(output, overwrite=True))
        made = busplan.emulate(call.profile, cycles=cycles, duration_us=length_us, seed=seed, fault=given)
        write_document(made.content, file)
    if output is not None:
        say(f"wrote {output}")
    _say_report(call.changes, made)


def _fault(text: str, units: Mapping[str, str]) -> tuple[str, Any]:
    """Name and value of a --fault: a number of times, or a time [us]; None without a value."""
    name, _, value = (part.strip() for part in text.partition("="))
    if units.get(name) == "us" and value:
        return name, time_us(value, option=f"--fault {name}")
    return name, int(value) if value.isdecimal() else value or None


def _direction(name: str, *, default: str) -> Any:
    help_ = (
        f"Quantity on the {name[-1]} axis: a key of the profile, or axes for the axes of all nodes (varies the number "
        "of nodes; with groups, of the group with the most axes), and up to 64 values in its unit: "
        f"{VALUES_HELP}  [default: {default}]"
    )
    return typer.Option(name, metavar="KEY=VALUES", help=help_)


def _axes(**texts: str | None) -> dict[str, dict[str, str] | None]:
    """Values by key of each direction; None for one that is not given."""
    return {
        name: None if text is None else dict([parse_axis(text, option=f"--{name}")]) for name, text in texts.items()
    }


@contextmanager
def _crew(jobs: int | None, *, circle: bool) -> "Iterator[Executor | None]":
    """Executor of circle tests; None for this process."""
    require_company("--circle", {"--jobs": jobs}, is_given=circle)
    from busplan.cli.workers import available_processors, executor

    with executor((jobs or available_processors()) if circle else 1) as crew:
        yield crew


@command("For a key on an axis of the map, it moves the mark.", period="one", is_drawn=True)
def map_command(
    call: Call,
    x: Annotated[str | None, _direction("--x", default="axes around the largest number that fits")] = None,
    y: Annotated[str | None, _direction("--y", default="cycle.period_us around the smallest that fits [us]")] = None,
    circle: Annotated[
        bool, typer.Option("--circle", help="Also run the circle test of every cell that fits, up to 1,000.")
    ] = False,
    jobs: JobsOption = None,
) -> "Answer":
    """Draw where a design fits: period against axes, any two keys of the profile, or the curve of one.

    Each cell is the verdict of `busplan capacity` for its two values: fits, not shown to fit, does not fit, or an
    unsafe gap count; with --circle also whether the circle fails. A table says what limits each region: time with its
    largest term, or a limit of the bus. The profile's own cell is marked. Values that cannot be combined are blank.
    With --x alone, the free time and its uncertainty are drawn over that key.
    Exits 0 whatever the verdict.

    Example: busplan map paper-4ms --y cycle.period_us=500:4000:500
    """
    with progress_bar("map") as progress, _crew(jobs, circle=circle) as crew:
        return busplan.map_(call.profile, **_axes(x=x, y=y), circle=circle, progress=progress, executor=crew)


@command("For a key of a slider, it moves the first setting.", period="one", is_drawn=True, has_all=False)
def explore_command(
    call: Call,
    x: Annotated[str | None, _direction("--x", default="as `busplan map`")] = None,
    y: Annotated[str | None, _direction("--y", default="as `busplan map`")] = None,
    over: Annotated[
        str | None,
        typer.Option(
            "--over", metavar="KEY=VALUES", help=f"A third key: {VALUES_HELP}  [default: the larger payload of a node]"
        ),
    ] = None,
    circle: Annotated[
        bool, typer.Option("--circle", help="Also run the circle test of every setting that fits.")
    ] = False,
    jobs: JobsOption = None,
) -> "Answer":
    """Write a page with sliders that shows what a change does: to the period, the nodes, the payload.

    Every setting is computed now, and the page shows its card and its place on the map: one file to open in a browser
    or to send, without a server. Without -o FILE.html it prints the map of this design. Up to 32 values each, 5,000
    settings in all. Exits 0 with any verdict.

    Example: busplan explore gantry-24 -o gantry-24.html
    """
    with progress_bar("explore") as progress, _crew(jobs, circle=circle) as crew:
        axes = _axes(x=x, y=y, over=over)
        return busplan.explore(call.profile, **axes, circle=circle, progress=progress, executor=crew)


def _complete_kinds(incomplete: str) -> list[str]:
    """Complete the last of several names of kinds for the shell."""
    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in complete_kind(last)]


@command("It changes the profile before that is put on other kinds.", period="one", is_drawn=True)
def compare_command(
    call: Call,
    buses: Annotated[
        str | None,
        typer.Option(
            metavar="KIND[,KIND...]",
            autocompletion=_complete_kinds,
            help="Kinds of bus, by their bus.kind.  [default: all, the profile's own first]",
        ),
    ] = None,
) -> "Answer":
    """Put the machine of a profile on each kind of bus: verdict, smallest period, most axes.

    The kinds are those of the paper (IEEE 1394, CAN, SERCOS, and the polled buses PROFIBUS and WorldFIP) and EtherCAT;
    a new profile of a polled bus is PROFIBUS.

    The machine is the part of a profile that every kind has: nodes and axes, bytes, execution times and period.
    On its own kind the profile stays as it is. On another kind it gets the bus of a new profile, which is assumed; keys
    that only its own kind has are left out, and named. The smallest period [us] is the one at which this machine is
    shown to fit; the most axes are those at the profile's period. Exits 0 whatever the verdict.

    Example: busplan compare gantry-24
    """
    kinds = None if buses is None else [kind.strip() for kind in buses.split(",")]
    # A constant may be one of another kind than the profile's.
    return busplan.compare(call.changes.of_profile.applied(call.loaded.profile), buses=kinds)


@command(of="nothing", answers=False)
def import_command(
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE",
            help="Files of one machine, each recognised by its content; - is standard input.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="NEW.toml", help="Write the profile to a new file.  [default: standard output]"
        ),
    ] = None,
    bus: Annotated[
        str | None, typer.Option(metavar="NAME", help="Bus of a database of messages.  [default: the only one]")
    ] = None,
    channel: ChannelOption = None,
    period: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="Period of the CAN messages that have none in any file, with its unit, as 100ms. It is assumed, so "
            "the plan is not shown to fit.  [default: such messages are left out]",
        ),
    ] = None,
    nodes: Annotated[
        str | None,
        typer.Option(
            metavar="NODES",
            help="Nodes described by one EDS: their number, as 8 for node-IDs 1 to 8, or their node-IDs, as "
            "1-8,11.  [default: one]",
        ),
    ] = None,
    bit_rate: Annotated[
        float | None,
        typer.Option(
            metavar="RATE",
            help="Bit rate of a CAN bus, which overrides that of any file [kbit/s].  [default: that of a file, or "
            "that of back-to-back frames in a log]",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Let -o overwrite an existing file.")] = False,
) -> None:
    """Make a profile from the files of a machine: ENI, a scan of its bus, DBC, EDS, a CAN log and others.

    Several files of one machine are merged: an ENI has the frames, the text of `ethercat slaves -v` the measured delays
    of devices, `ethercat pdos` their bytes; a CAN log has the messages of a network, a DBC their names. Each value has
    its grade, file and line in a comment; values in no file are assumed, and named at the end with the verdict.
    `busplan manual import` lists what each format gives.

    The profile goes to standard output or to the file of -o; an existing file stays, unless --force is given. Exits 0
    when the profile is written, whatever the verdict.

    Example: busplan import machine.xml slaves.txt -o machine.toml
    """
    if paths.count("-") > 1:
        raise BusplanError("-: only one FILE can be standard input")
    new = None if output == STANDARD_OUTPUT else output
    if new is not None and new.suffix.lower() != ".toml":
        raise BusplanError(f"--output {new}: expected a name ending in .toml: it is a profile")
    inputs = [given_path(path) for path in paths]
    require_apart({"--output": new}, inputs=inputs, of_profiles=True)
    with ExitStack() as files:
        # Opened before the work, so that a path that cannot be written fails at once.
        file = None if new is None else files.enter_context(new_file(new, overwrite=force))
        with progress_bar("recording") as progress:
            imported = busplan.import_profile(
                paths,
                name=None if new is None else new.stem,
                bus=bus,
                channel=channel,
                bit_rate_kbit_s=bit_rate,
                period_us=None if period is None else time_us(period, option="--period"),
                nodes=nodes,
                progress=progress,
            )
        sentences = imported.sentences()
        write_document(imported.text, file)
    say(*([f"wrote {new}"] if new else []), *sentences)
    if new:
        say(f"next: busplan capacity {shlex.quote(f'./{new}' if str(new).startswith('-') else str(new))}")
