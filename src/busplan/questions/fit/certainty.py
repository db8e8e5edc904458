"""Time that a cycle needs, time that its slice gives it, and how sure it is that it fits."""

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Final, Literal, NamedTuple

from busplan.buses.cycle import BusCycle, Doubt
from busplan.buses.figure import BIAS, UNCERTAINTY
from busplan.buses.limits import BROKEN, COVERAGE, KEPT, NOT_SHOWN_KEPT, Limit
from busplan.buses.network import Network
from busplan.buses.time_slice import time_slice_us
from busplan.elementwise import FIT_ROUNDING, Number, choose, larger, named, square_root, total, within

VerdictWord = Literal["fits", "not shown to fit", "does not fit"]
FITS: Final[VerdictWord] = "fits"
NOT_SHOWN: Final[VerdictWord] = "not shown to fit"
DOES_NOT_FIT: Final[VerdictWord] = "does not fit"
VERDICTS: Final = (FITS, NOT_SHOWN, DOES_NOT_FIT)
TIME: Final = "time"
"""Key of the limit of time, which is no limit of the bus: the cycle must fit its slice."""


def deciding_cycle(network: Network) -> BusCycle:
    """The cycle of a network under the timing model that decides."""
    return network.bus.cycle(network, model=network.bus.deciding_model)


def available_us(network: Network) -> Number:
    """Share of the period that is for communication, alpha T_s of (1) [us]."""
    return time_slice_us(network.period_us, slice_ratio=network.slice_ratio, nodes=1)


def fits_in(required_us: Number, *, available_us: Number) -> Number:
    """Tell whether a cycle fits its share of the period; a cycle that fills it exactly fits.

    Examples
    --------
    >>> fits_in(0.1 + 0.2, available_us=0.3)
    True
    """
    return within(required_us, available_us)


class Certainty(NamedTuple):
    """A cycle with its bias and its uncertainty [us]. The numbers may be of any sort."""

    bias_us: Number | None
    """Time that the bus takes beyond the timing model; None where it is unknown."""
    margin_corrected_us: Number
    """What the cycle leaves of the slice, less the bias."""
    uncertainty_us: Number
    """U, two standard uncertainties."""
    safe_required_us: Number
    """Length of slice in which the cycle is shown to fit, reserve included."""
    doubts: tuple[Doubt, ...]


def certainty(cycle: BusCycle) -> Certainty:
    """Weigh a cycle: its corrected margin, its uncertainty, and what it needs to be shown to fit.

    Parameters
    ----------
    cycle
        A cycle under the timing model that decides. Its numbers may be of any sort.

    References
    ----------
    JCGM 100 (GUM), 5.1.2 and 6.2.1.
    """
    network, bias_us, doubts = cycle.network, cycle.bias_us(), cycle.doubts()
    extra_us: Number = 0.0 if bias_us is None else bias_us
    combined_us = square_root(total(doubt.us * doubt.us for doubt in doubts))
    expanded_us = COVERAGE * named(combined_us, "combined_uncertainty_us", "u_c")
    longer_us = cycle.added_us(extra_us)
    uncertain_us = cycle.added_us(expanded_us, after_us=extra_us)
    biased_us = cycle.required_us + named(longer_us, BIAS.key, BIAS.symbol)
    return Certainty(
        bias_us=None if bias_us is None else longer_us,
        margin_corrected_us=available_us(network) - biased_us,
        uncertainty_us=uncertain_us,
        safe_required_us=(biased_us + named(uncertain_us, UNCERTAINTY.key, UNCERTAINTY.symbol))
        / (1 - network.profile.limits.reserve),
        doubts=doubts,
    )


def limit_codes(network: Network) -> dict[str, Number]:
    """The place among `VERDICTS` of each limit of the bus by key, those of safety left out."""
    return {limit.key: limit.verdict_code(network) for limit in network.bus.limits if limit.role != "safety"}


def time_code(weighed: Certainty, network: Network) -> Number:
    """The place among `VERDICTS` of the limit of time, from the certainty of a network's cycle."""
    given_us = available_us(network)
    is_shown = fits_in(weighed.safe_required_us, available_us=given_us)
    best_us: Number = weighed.margin_corrected_us + weighed.uncertainty_us
    least_us: Number = -FIT_ROUNDING * given_us
    return choose(is_shown, KEPT, choose(best_us < least_us, BROKEN, NOT_SHOWN_KEPT))


def verdict_code(codes: Mapping[str, Number]) -> Number:
    """The place of the verdict among `VERDICTS`: that of the worst limit, time among them."""
    return reduce(larger, codes.values())


def limits_with_time(network: Network, *, model: str) -> tuple[Limit, ...]:
    """The limits of a network's kind of bus, without those of safety and without doubts; time is the last."""
    bus = network.bus
    time = time_limit(lambda tried: bus.cycle(tried, model=model).most_required_us)
    return (*(limit.nominal for limit in bus.limits if limit.role != "safety"), time)


def limits_to_be_safe(network: Network) -> tuple[Limit, ...]:
    """Every limit that a network must keep to be shown to fit on a bus that is set safely; time is the last."""
    bus = network.bus
    time = time_limit(lambda tried: certainty(bus.cycle(tried, model=bus.deciding_model)).safe_required_us)
    return (*(limit.shown for limit in bus.limits), time)


def time_limit(needed_us: Callable[[Network], Number]) -> Limit:
    """The limit of time: what a network needs [us] against its share of the period."""
    return Limit(TIME, "{value:.3f} us needed of {most:.3f} us", needed_us, available_us)
