"""`busplan latency`."""

from typing import Annotated

from busplan.cli.answering import answer
from busplan.cli.changes import load_changed, takes_changes
from busplan.cli.destinations import profile_files
from busplan.cli.options import (
    AllOption,
    FormatOption,
    OutputOption,
    ProfileArgument,
    TimingModelOption,
    chosen_model,
    option,
    parse_sizes,
)
from busplan.profile.changes import NO_CHANGES, KeyChanges


@takes_changes()
def latency_command(
    profile: ProfileArgument,
    payload: Annotated[
        str | None,
        option(
            "--payload BYTES[,BYTES...]",
            "Payload of read and write alike in bytes, or several with commas, as 4,16,32.  [default: the profile's "
            "payload.read_bytes and payload.write_bytes]",
        ),
    ] = None,
    changes: KeyChanges = NO_CHANGES,
    timing_model: TimingModelOption = "both",
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Show how long data takes to arrive, phase by phase, under each timing model.

    On IEEE 1394 it times one read and one write of the farthest node, or, in the broadcast schedule, the data and the
    commands of all nodes; on CAN the worst-case response time of every message, and a loop over feedback and commands;
    on EtherCAT a command, feedback, and a loop over both; on SERCOS feedback and commands of all nodes. Times are in
    us, sizes in bytes; each phase has its equation or source. Exits 0 with any figures.

    Example: busplan latency paper-two-node --payload 4,16,1024
    """
    with answer(format_, output, inputs=profile_files(profile), changes=changes, is_whole=all_) as give:
        from busplan.questions.latency import latency

        loaded = load_changed(profile, changes)
        latencies = latency(
            loaded,
            payload_bytes=None if payload is None else parse_sizes(payload, option="--payload"),
            timing_model=chosen_model(timing_model),
        )
        give(latencies.report())
