"""`busplan measured`."""

from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from busplan.cli.answering import answer
from busplan.cli.changes import takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import AllOption, FormatOption, OutputOption, ProfileArgument, option
from busplan.cli.output import say
from busplan.cli.progress import progress_bar
from busplan.cli.rewrite import apply_changes, require_own_file
from busplan.errors import BusplanError
from busplan.profile.changes import NO_CHANGES, KeyChanges, require_separate


@takes_changes("Of the machine as it was recorded: --apply does not write it.")
def measured_command(
    profile: ProfileArgument,
    recording: Annotated[
        str,
        typer.Argument(
            help="A recording of the machine: of EtherCAT a pcap or pcapng file, of CAN a log of candump, ASC, BLF or "
            "TRC.",
            show_default=False,
        ),
    ],
    quantile: Annotated[
        float,
        option(
            "--quantile SHARE",
            "Share of the cycles that jitter and times are to hold for, 0.5..1 [1].  [default: 1, the worst recorded]",
        ),
    ] = 1.0,
    changes: KeyChanges = NO_CHANGES,
    apply: Annotated[
        bool,
        typer.Option(
            "--apply",
            help="Write the values that were measured into the file PROFILE, with a comment on their origin; your own "
            "comments stay.",
        ),
    ] = False,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Show what the machine does by a recording of its bus, beside what was planned.

    Each figure has the planned and the recorded value, the residual, its expanded uncertainty U, and whether it is
    within the plan: jitter, times, load and bytes at most as planned, or no further beside than U. What the recording
    does not show is said. Of EtherCAT record all packets of the master's port, both ways. Times are in us. `busplan
    manual measured` says how each figure is found. Exits 0 with any figures.

    Example: busplan measured ethercat-servo-8 capture.pcapng --quantile 0.9
    """
    if apply:
        require_own_file(profile)
    files = chain(profile_files(profile), [Path(recording)])
    with answer(format_, output, inputs=files, changes=changes, is_whole=all_) as give:
        from busplan.profile.shipped import load
        from busplan.questions.measured import measured

        loaded = load(profile)
        with progress_bar("recording") as progress:
            seen = measured(changes.applied(loaded.profile), recording, quantile=quantile, progress=progress)
        if apply and not seen.edits:
            raise BusplanError(f"--apply: {recording} shows no value of a key")
        if apply:
            for change in changes.by_set:
                for key in seen.edits:
                    require_separate(change, key, typed="--apply")
            apply_changes(loaded.document, seen.edits, notes=seen.notes)
            say(f"wrote {', '.join(seen.edits)} of {profile}; your comments are kept: see whether they hold")
        give(seen.report(applied_to=profile if apply else None))
