"""Rules of the gate that only an EtherCAT bus has: set-points need a common clock, and must be there in time."""

from collections.abc import Iterator
from typing import Any, Final

from busplan.buses.rule import Rule, RuleProblem, RuleSubject, told_apart


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
    """The last command is taken behind SYNC0, and takes effect a cycle later."""
    bus: Any = subject.profile.bus
    one = subject.deciding
    if bus.distributed_clocks and bus.sync_shift and one.command_us > one.sync0_us:
        taken, sync0 = told_apart(one.command_us, one.sync0_us)
        yield RuleProblem(
            "bus.sync_shift",
            f"the last command is taken at {taken} us, behind SYNC0 at {sync0} us",
            "it takes effect a cycle later; a larger share moves SYNC0 back",
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
        "warning",
        "commands are taken behind SYNC0",
        "Drives with distributed clocks act at SYNC0, which lies at bus.sync_shift of the period. A command that has "
        "not arrived by then, with the drive's own time, waits for the next one: a cycle more of dead time, and where "
        "only some drives are late their axes are a cycle apart. SYNC0 at the very start of the cycle, "
        "bus.sync_shift = 0, is always before the frames and not reported.",
        command_behind_sync,
    ),
)
