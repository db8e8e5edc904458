"""One communication cycle: what it needs, what its slice gives it, and the limits of the standard that it may break."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal, NamedTuple, get_args

from busplan.analysis.latency import phases
from busplan.buses.ieee1394 import equations
from busplan.buses.ieee1394.constants import MAX_HOPS, MAX_NODES
from busplan.buses.ieee1394.timing import Phases, TimingModelName
from busplan.profile.model import Profile

Limit = Literal["time", "hops", "nodes", "payload"]
Term = Literal["arbitration", "data", "acknowledge", "execution", "gaps", "sync", "nonperiodic"]
FIT_ROUNDING: Final = 1e-12
"""Relative allowance for the rounding of floats, so that a cycle that fills its slice exactly fits it. It is a
billionth of a crystal's tolerance and buys no time."""

TERM_KEYS: Final[Mapping[Term, str]] = MappingProxyType(
    {term: f"{term}_us" if term in ("sync", "nonperiodic") else f"cycle_{term}_us" for term in get_args(Term)}
)
"""What each term of a cycle is called among the figures of `capacity`."""


class Cycle(NamedTuple):
    """One communication cycle with a given number of nodes."""

    nodes: int
    read: Phases
    write: Phases
    sync_us: float
    """CTS of (2)."""
    nonperiodic_us: float
    """T_npd of (2)."""

    @property
    def reads_us(self) -> float:
        """T_r of (2): all read transactions with their gaps."""
        return self.nodes * self.read.latency_with_gaps_us

    @property
    def writes_us(self) -> float:
        """T_w of (2): all write transactions with their gaps."""
        return self.nodes * self.write.latency_with_gaps_us

    @property
    def required_us(self) -> float:
        """What the whole cycle needs: N times (2)."""
        return equations.required_time_slice_us(
            self.reads_us, writes_us=self.writes_us, nonperiodic_us=self.nonperiodic_us, sync_us=self.sync_us, nodes=1
        )

    def terms_us(self) -> dict[Term, float]:
        """Take the required time apart; the parts add up to it."""
        both = (self.read, self.write)
        return {
            "arbitration": self.nodes * sum(2 * half.arbitration_us for half in both),
            "data": self.nodes * sum(half.request_data_us + half.response_data_us for half in both),
            "acknowledge": self.nodes * sum(2 * half.acknowledge_us for half in both),
            "execution": self.nodes * sum(half.execution_us for half in both),
            "gaps": self.nodes * sum(half.gaps_us for half in both),
            "sync": self.sync_us,
            "nonperiodic": self.nonperiodic_us,
        }


def cycle(profile: Profile, *, model: TimingModelName, nodes: int, payload_bytes: int | None = None) -> Cycle:
    """Put a cycle together, with any number of nodes on the profile's bus.

    Parameters
    ----------
    profile
        The network.
    model
        Timing model.
    nodes
        Nodes on the bus, 1 or more [1].
    payload_bytes
        Payload of read and write alike [bytes]; without it the profile's own of each.
    """
    read_bytes, write_bytes = (
        (profile.payload.read_bytes, profile.payload.write_bytes)
        if payload_bytes is None
        else (payload_bytes, payload_bytes)
    )
    return Cycle(
        nodes=nodes,
        read=phases(profile, "read", model=model, payload_bytes=read_bytes, nodes=nodes),
        write=phases(profile, "write", model=model, payload_bytes=write_bytes, nodes=nodes),
        sync_us=profile.cycle.sync.sync_us(nodes),
        nonperiodic_us=profile.cycle.nonperiodic_us,
    )


def available_us(profile: Profile) -> float:
    """Share of the period that is for communication, alpha T_s of (1) [us]."""
    return equations.time_slice_us(profile.cycle.period_us, slice_ratio=profile.cycle.slice_ratio, nodes=1)


def fits_in(required_us: float, *, available_us: float) -> bool:
    """Tell whether a cycle fits its share of the period; one that fills it exactly does.

    Examples
    --------
    >>> fits_in(0.1 + 0.2, available_us=0.3)
    True
    """
    return required_us <= available_us * (1 + FIT_ROUNDING)


def limits_broken(profile: Profile) -> dict[Limit, bool]:
    """Whether a profile breaks each of the standard's own limits, whatever the time; arrays broadcast."""
    bus, payload = profile.bus, profile.payload
    most_bytes = bus.max_payload_bytes
    return {
        "payload": (payload.read_bytes > most_bytes) | (payload.write_bytes > most_bytes),
        "nodes": bus.nodes > MAX_NODES,
        "hops": bus.hops(bus.nodes) > MAX_HOPS,
    }


def broken_limits(profile: Profile) -> tuple[Limit, ...]:
    """Tell which of the standard's own limits a profile breaks, whatever the time."""
    return tuple(limit for limit, is_broken in limits_broken(profile).items() if is_broken)
