"""Rules of the gate that only an EtherCAT bus has: set-points need a common clock, and must be there in time."""

from collections.abc import Iterator
from math import ceil
from typing import Final

from busplan.buses.ethercat.limits import SYNC0
from busplan.buses.rule import Rule, RuleProblem, RuleSubject


def no_common_clock(subject: RuleSubject) -> Iterator[RuleProblem]:
    """A circle is to be tested, and no clock makes its axes act at one time."""
    profile = subject.profile
    if profile.asks_for_circle and not profile.bus.distributed_clocks:
        yield RuleProblem(
            "bus.distributed_clocks",
            "without them each drive acts when its frame passes, one after the other",
            "set bus.distributed_clocks = true if the drives have them",
            ("bus.distributed_clocks = true",),
        )


def command_behind_sync(subject: RuleSubject) -> Iterator[RuleProblem]:
    """The last command is not shown to be taken before SYNC0, and may take effect cycles later."""
    one = subject.deciding
    if SYNC0.key not in (*one.exceeded, *(one.not_shown or ())):
        return
    late = max(ceil((one.command_us - one.sync0_us) / one.period_us), 1)
    maybe = "" if SYNC0.key in one.exceeded else "maybe "
    yield RuleProblem(
        "bus.sync_shift",
        f"{subject.limit_words(SYNC0.key)}: {maybe}{late} cycle{'s' * (late > 1)} late",
        SYNC0.way_out,
        subject.cure().cure,
    )


RULES: Final = (
    Rule(
        "BP131",
        "no-common-clock",
        "warning",
        "the axes of a circle have no distributed clocks",
        "A frame passes one drive after the other, and several frames take longer still. With distributed clocks all "
        "drives take their set-points at SYNC0; without them each takes its own when its frame has passed, and a "
        "circle has that difference between its axes.",
        no_common_clock,
    ),
    Rule(
        "BP132",
        "command-behind-sync",
        "error",
        "commands are not shown to be taken before SYNC0",
        "Drives with distributed clocks act at SYNC0, which lies at bus.sync_shift of the period behind the master's "
        "task. A command that has not arrived by then, with the master's jitter and the drive's own time, waits for "
        "the next one: a cycle more of dead time, and where only some drives are late their axes are a cycle apart. It "
        "is a limit, judged with its doubt as time is. With bus.sync_shift = 0, SYNC0 at the task itself, the SYNC0 "
        "of the next cycle counts.",
        command_behind_sync,
    ),
)
