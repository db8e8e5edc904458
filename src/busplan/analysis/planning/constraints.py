"""What a plan must hold: each constraint says what the slice must give, or that no slice is enough."""

from collections.abc import Callable, Iterator
from math import inf
from typing import Final, NamedTuple

from busplan.analysis.capacity.certainty import certainty
from busplan.analysis.capacity.cycle import TIME, available_us, fits_in
from busplan.analysis.circle.refusal import circle_refusals, step_refusals
from busplan.analysis.network import bus_of, network_of
from busplan.analysis.planning.machine import rooms
from busplan.buses.network import Network
from busplan.elementwise import plain
from busplan.sections.base import MIN_STEP_US
from busplan.sections.profile import Profile

CIRCLE: Final = "circle"
_MOST_SLICE_US: Final = 1e12
"""Longer than any slice of a profile: it keeps quotients finite."""


class Need(NamedTuple):
    """What one constraint asks of the slice."""

    us: float
    """What the slice must give; infinite where none is enough [us]."""
    key: str
    """What asks: time, the key of a limit of the bus, or a key of the profile."""
    why: str = ""
    """What no slice mends, in words."""

    def words(self, most_us: float) -> str:
        """Say what is asked, and what the slice can give at most [us]."""
        needs = f"needs a slice of {self.us:.3f} us"
        who = f"the cycle {needs} to be shown to fit" if self.key == TIME else f"{self.key} {needs}"
        return self.why or f"{who}, and at most {most_us:.3f} us can be given"


def shown(network: Network) -> Need:
    """What a network needs to be shown to fit, with bias, uncertainty and reserve, on a bus that is set safely."""
    bus = bus_of(network.profile)
    found = Need(float(certainty(bus.cycle(network, model=bus.deciding_model)).safe_required_us), TIME)
    for limit in bus.limits:
        if limit.is_of_period:
            continue
        # A limit that a period cures is asked at the one that all before it need, whatever the profile's own is.
        at = network if limit.slice_us is None else network._replace(period_us=_period_us(network, found.us))
        if limit.is_broken(at):
            slice_us = inf if limit.slice_us is None else limit.slice_us(at)
            if slice_us == inf:
                way_out = f" ({limit.way_out})" if limit.way_out else ""
                return Need(inf, limit.key, f"{limit.words(at)}{way_out}")
            found = Need(slice_us, limit.key)
    return found


def _period_us(network: Network, slice_us: float) -> float:
    return max(slice_us / float(plain(network.slice_ratio)), MIN_STEP_US)


def keeps_limits(network: Network) -> bool:
    """Whether a network keeps the limits that its period plays a part in, at its own period and slice ratio."""
    return not any(one.slice_us is not None and one.is_broken(network) for one in bus_of(network.profile).limits)


def verdict(profile: Profile) -> Iterator[Need]:
    """The network itself."""
    yield shown(network_of(profile))


def utilisation(profile: Profile) -> Iterator[Need]:
    """[limits] max_utilisation: the share of the slice that may be used."""
    most, key = profile.limits.max_utilisation, "limits.max_utilisation"
    if most is not None:
        bus = bus_of(profile)
        required_us = float(bus.cycle(network_of(profile), model=bus.deciding_model).required_us)
        us = required_us / most if most * _MOST_SLICE_US > required_us else inf
        yield Need(us, key, f"{key} = {most:g} leaves no time" if us == inf else "")


def spare(profile: Profile) -> Iterator[Need]:
    """[limits] min_spare_nodes and min_spare_axes: more nodes must be shown to fit, too."""
    for room in rooms(profile):
        found = shown(room.network)
        why = found.why and f"{room.key} asks for room for {room.words}: {found.why}"
        yield found._replace(key=room.key, why=why)


CONSTRAINTS: Final[tuple[Callable[[Profile], Iterator[Need]], ...]] = (verdict, utilisation, spare)


def missed_limits(profile: Profile) -> tuple[Need, ...]:
    """What each key of [limits] asks that the slice of a profile does not give; the verdict is not among it."""
    given_us = available_us(network_of(profile))
    asked = (need for constraint in CONSTRAINTS[1:] for need in constraint(profile))
    return tuple(need for need in asked if not fits_in(need.us, available_us=given_us))


def needs(profile: Profile) -> list[Need]:
    """What every constraint asks of the slice; the verdict's is the first."""
    return [need for constraint in CONSTRAINTS for need in constraint(profile)]


def refused_period(profile: Profile) -> Need | None:
    """Why a period is none of the bus, or keeps the circle that the profile asks for from being run, if so.

    Parameters
    ----------
    profile
        The network.
    """
    network, bus = network_of(profile), bus_of(profile)
    broken = next((one for one in bus.limits if one.is_of_period and one.is_broken(network)), None)
    if broken is not None:
        return Need(inf, broken.key, broken.words(network))
    causes = circle_refusals(profile)
    return Need(inf, causes[0].name, causes[0].message) if causes else None


def goes_with_step(profile: Profile, period_us: float) -> bool:
    """Whether a period goes with the step of the circle that a profile asks for, if it does.

    Parameters
    ----------
    profile
        The network.
    period_us
        Communication period [us].
    """
    return not profile.asks_for_circle or not any(step_refusals(profile, period_us))
