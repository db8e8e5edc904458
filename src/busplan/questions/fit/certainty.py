"""Whether a cycle fits its slice: the time it needs, the time available, and how certain the verdict is."""

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Final, Literal, NamedTuple

from busplan.buses.cycle import BusCycle, Doubt
from busplan.buses.figure import BIAS, UNCERTAINTY
from busplan.buses.limits import BROKEN, COVERAGE, KEPT, NOT_SHOWN_KEPT, ExactLimit, Held
from busplan.buses.network import Network
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import FIT_ROUNDING, Number, choose, larger, named, square_root, total, within

VerdictWord = Literal["fits", "not shown to fit", "does not fit"]
FITS: Final[VerdictWord] = "fits"
NOT_SHOWN: Final[VerdictWord] = "not shown to fit"
DOES_NOT_FIT: Final[VerdictWord] = "does not fit"
VERDICTS: Final = (FITS, NOT_SHOWN, DOES_NOT_FIT)
TIME: Final = "time"
"""Key of the time limit: the cycle must fit its slice. It is not one of `bus.limits`."""


def deciding_cycle(network: Network) -> BusCycle:
    """The cycle of a network under the timing model that decides."""
    return network.bus.cycle(network, model=network.bus.deciding_model)


def available_us(network: Network) -> Number:
    """Time in each period for communication, alpha T_s of equation (1) [us]."""
    return time_slice_us(network.period_us, slice_ratio=network.slice_ratio, nodes=1)


class Certainty(NamedTuple):
    """Margin of a cycle with its bias and uncertainty [us]. The numbers may be arrays or traced numbers."""

    bias_us: Number | None
    """Time that the bus takes in addition to the timing model; None if it is unknown."""
    margin_corrected_us: Number
    """Available time less the required time and the bias."""
    uncertainty_us: Number
    """Expanded uncertainty U of the required time (k = 2)."""
    safe_required_us: Number
    """Required time with bias, U and reserve: the shortest slice in which the cycle is shown to fit."""
    doubts: tuple[Doubt, ...]
    """Components of the uncertainty."""
    possible_us: Number
    """Part of the required time that is only possible: a cycle that fits without it is not shown not to fit."""


def certainty(cycle: BusCycle) -> Certainty:
    """Compute the corrected margin of a cycle, its uncertainty, and the time it needs to be shown to fit.

    The cycle is one under the timing model that decides; its numbers may be arrays or traced numbers.

    References
    ----------
    JCGM 100 (GUM), 5.1.2 and 6.2.1.
    """
    network, bias_us, doubts = cycle.network, cycle.bias_us(), cycle.doubts()
    known_bias_us: Number = 0.0 if bias_us is None else bias_us
    combined_us = square_root(total(doubt.us * doubt.us for doubt in doubts))
    expanded_us = COVERAGE * named(combined_us, "combined_uncertainty_us", "u_c")
    added_bias_us = cycle.added_us(known_bias_us)
    added_uncertainty_us = cycle.added_us(expanded_us, after_us=known_bias_us)
    corrected_us = cycle.required_us + named(added_bias_us, BIAS.key, BIAS.symbol)
    return Certainty(
        bias_us=None if bias_us is None else added_bias_us,
        margin_corrected_us=available_us(network) - corrected_us,
        uncertainty_us=added_uncertainty_us,
        safe_required_us=(corrected_us + named(added_uncertainty_us, UNCERTAINTY.key, UNCERTAINTY.symbol))
        / (1 - network.profile.limits.reserve),
        doubts=doubts,
        possible_us=cycle.possible_us(),
    )


def limit_codes(network: Network) -> dict[str, Number]:
    """Verdict on each limit of the bus by key, as an index of `VERDICTS`; safety limits are left out."""
    return {limit.key: limit.verdict_code(network) for limit in network.bus.limits if limit.role != "safety"}


def time_code(cycle: Certainty, network: Network) -> Number:
    """Verdict on the time limit, as an index of `VERDICTS`, from the certainty of a network's cycle."""
    given_us = available_us(network)
    is_shown = within(cycle.safe_required_us, given_us)
    highest_margin_us: Number = cycle.margin_corrected_us + cycle.uncertainty_us + cycle.possible_us
    is_broken = highest_margin_us < -FIT_ROUNDING * given_us
    return choose(is_shown, KEPT, choose(is_broken, BROKEN, NOT_SHOWN_KEPT))


def verdict_code(codes: Mapping[str, Number]) -> Number:
    """Verdict, as an index of `VERDICTS`: that of the worst limit, time among them."""
    return reduce(larger, codes.values())


def is_shown_to_fit(network: Network) -> bool:
    """Whether the verdict on a network of plain numbers is that it fits, by the timing model that decides."""
    cycle, limits = deciding_cycle(network), (limit for limit in network.bus.limits if limit.role != "safety")
    is_in_time = time_code(certainty(cycle), network) == KEPT
    return bool(is_in_time) and not any(limit.shown.is_broken(network) for limit in limits)


def limits_with_time(network: Network, *, model: str) -> tuple[Held, ...]:
    """Limits of a network's kind of bus at nominal values, without the safety limits; time is the last."""
    bus = network.bus
    time = time_limit(lambda tried: bus.cycle(tried, model=model).most_required_us)
    return (*(limit.nominal for limit in bus.limits if limit.role != "safety"), time)


def limits_to_be_safe(network: Network) -> tuple[Held, ...]:
    """Every limit that a network must keep to be shown to fit on a bus with safe settings; time is the last."""
    bus = network.bus
    time = time_limit(lambda tried: certainty(bus.cycle(tried, model=bus.deciding_model)).safe_required_us)
    return (*(limit.shown for limit in bus.limits), time)


def time_limit(needed_us: Callable[[Network], Number]) -> Held:
    """The time limit: the time that a network needs must not exceed the available time [us]."""
    return ExactLimit(TIME, "{value:.3f} us needed of {most:.3f} us", needed_us, available_us).nominal
