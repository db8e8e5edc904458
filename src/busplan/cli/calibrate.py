"""`busplan calibrate`."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from busplan.cli.answering import answer
from busplan.cli.changes import takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import (
    AllOption,
    FormatOption,
    OutputOption,
    ProfileArgument,
    option,
)
from busplan.cli.output import say
from busplan.cli.rewrite import apply_changes, require_own_file
from busplan.errors import BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChanges, require_separate


@takes_changes("Of the bench, where it was not as the profile: --apply does not write it.")
def calibrate_command(
    profile: ProfileArgument,
    measurements: Annotated[
        str,
        typer.Argument(
            help="A CSV file of measured latencies, the shipped example table-1.csv, or - for standard input.",
            show_default=False,
        ),
    ],
    group: Annotated[
        str | None,
        option(
            "--group NAME", "In a profile with groups: the group of nodes that was measured.  [default: its one group]"
        ),
    ] = None,
    timing_model: Annotated[
        str | None,
        option("--timing-model MODEL", "Timing model that computes the packets.  [default: the one that decides]"),
    ] = None,
    changes: KeyChanges = NO_CHANGES,
    apply: Annotated[
        bool,
        typer.Option(
            "--apply",
            help="Write [node.execution], or that of the group, into the file PROFILE, with a comment on its origin; "
            "your own comments stay.",
        ),
    ] = False,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Find the execution time T_exec of a node from latencies measured on an IEEE 1394 bus.

    The CSV file has a header, the columns payload_bytes and latency_us (T_lant, from the request to its last
    acknowledge, in us) and a line for each measurement; payloads may repeat, and lines that begin with # are comments.
    A column transaction says read or write (write without it).

    T_exec is the latency less the time of its packets by the timing model, equation (3); of each payload the median. If
    the bench differs from the profile, say so: --set bus.nodes=2 --set bus.gap_count=63. Of three or more measurements
    of a payload, those far from their median are named by their line and left out; slow ones are in worst_extra_us.
    Times are in us. Exits 0 with any figures.

    Example: busplan calibrate paper-two-node table-1.csv
    """
    if profile == measurements == "-":
        raise BusplanError("only one of PROFILE and MEASUREMENTS can be standard input")
    if apply:
        require_own_file(profile)
    files = chain(profile_files(profile), _measurements_file(measurements))
    with answer(format_, output, inputs=files, changes=changes, is_whole=all_) as give:
        from busplan.profile.measurements import MAX_MEASUREMENTS_BYTES
        from busplan.profile.shipped import load, locate_measurements
        from busplan.profile.toml import read_bytes
        from busplan.questions.calibrate import calibrate

        loaded = load(profile)
        bench = changes.applied(loaded.profile)
        path, name, shipped = locate_measurements(measurements)
        calibration = calibrate(
            bench,
            # Read here: Python reads no standard input, and takes a name of several lines for CSV text.
            measurements if shipped else read_bytes(path, name=name, limit=MAX_MEASUREMENTS_BYTES),
            group=group,
            timing_model=timing_model,
            source=name,
        )
        if apply:
            for change in changes.by_set:
                for key in calibration.edits:
                    require_separate(change, key, typed="--apply")
            apply_changes(loaded.document, calibration.edits, notes=calibration.notes)
            kept = "your comments are kept: see whether they hold of the new values"
            say(f"wrote [{' '.join(calibration.notes)}] of {profile}; {kept}")
        give(calibration.report(applied_to=profile if apply else None))


def _measurements_file(argument: str) -> Iterator[Path]:
    """File of the MEASUREMENTS argument; nothing if there is none: reading it will report the error."""
    from busplan.profile.shipped import locate_measurements

    with suppress(BusplanError, ValueError):  # ValueError: a NUL in the path
        yield locate_measurements(argument).path
