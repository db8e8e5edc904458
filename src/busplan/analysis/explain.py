"""What a profile's figures rest on: the constants of the equations, and what the profile itself claims."""

from typing import NamedTuple

from busplan import ieee1394
from busplan.profile.model import Profile
from busplan.sourced import Sourced


class Assumption(NamedTuple):
    """One value that the figures rest on."""

    name: str
    value: float | str
    unit: str
    grade: str
    source: str
    meaning: str


_CONSTANTS: dict[str, Sourced] = {
    "BASE_RATE_MBIT_S": ieee1394.BASE_RATE_MBIT_S,
    "CABLE_DELAY_US": ieee1394.CABLE_DELAY_US,
    "PHY_DELAY_TICKS": ieee1394.PHY_DELAY_TICKS,
    "ARBITRATION_GAP_TICKS": ieee1394.ARBITRATION_GAP_TICKS,
    "ARBITRATION_HOLD_US": ieee1394.ARBITRATION_HOLD_US,
    "DATA_END_US": ieee1394.DATA_END_US,
    "SUBACTION_GAP_TICKS": ieee1394.SUBACTION_GAP_TICKS,
    "SUBACTION_GAP_TICKS_PER_COUNT": ieee1394.SUBACTION_GAP_TICKS_PER_COUNT,
    "RESET_GAP_TICKS": ieee1394.RESET_GAP_TICKS,
    "RESET_GAP_TICKS_PER_COUNT": ieee1394.RESET_GAP_TICKS_PER_COUNT,
}


def assumptions(profile: Profile) -> tuple[Assumption, ...]:
    """Give what the figures of a profile rest on, with its grade and source.

    Parameters
    ----------
    profile
        The network.
    """
    rate = ieee1394.DATA_RATE_MBIT_S[profile.bus.speed]
    execution = profile.node.execution
    return (
        *(
            Assumption(name, float(one), one.unit, one.grade, one.source, one.meaning)
            for name, one in {**_CONSTANTS, "DATA_RATE_MBIT_S": rate}.items()
        ),
        Assumption(
            "node.execution",
            execution.kind,
            "1",
            execution.grade or "not said",
            "profile",
            "execution time T_exec in the node",
        ),
        Assumption(
            "servo", profile.servo.loop, "1", profile.servo.grade, "profile", "position loop and drive of both axes"
        ),
    )
