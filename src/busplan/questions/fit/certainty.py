"""How sure it is that a cycle fits: the bias of the timing model, and the uncertainty of what it rests on.

References
----------
JCGM 100 (GUM): the combined standard uncertainty of independent inputs (5.1), and its expansion (6.2).
"""

from collections.abc import Mapping
from functools import reduce
from math import inf
from typing import Final, Literal, NamedTuple, Protocol

from busplan.buses.cycle import BusCycle, Doubt
from busplan.buses.figure import BIAS, UNCERTAINTY
from busplan.buses.network import Network
from busplan.buses.parts import BROKEN, COVERAGE, KEPT, NOT_SHOWN_KEPT, Limit
from busplan.elementwise import FIT_ROUNDING, Number, choose, larger, named, square_root, total
from busplan.questions.fit.cycle import TIME, available_us, fits_in, time_limit
from busplan.questions.fit.network import bus_of

VerdictWord = Literal["fits", "not shown to fit", "does not fit"]
FITS: Final[VerdictWord] = "fits"
NOT_SHOWN: Final[VerdictWord] = "not shown to fit"
DOES_NOT_FIT: Final[VerdictWord] = "does not fit"
VERDICTS: Final = (FITS, NOT_SHOWN, DOES_NOT_FIT)


class Certainty(NamedTuple):
    """A cycle with its bias and its uncertainty [us]. The numbers may be of any sort."""

    bias_us: Number | None
    """What the bus takes beyond the timing model; None where nobody has measured it."""
    margin_corrected_us: Number
    """What is left of the slice, less the bias."""
    uncertainty_us: Number
    """U, two standard uncertainties."""
    safe_required_us: Number
    """What the slice must give for the cycle to be shown to fit, with the reserve."""
    doubts: tuple[Doubt, ...]

    @property
    def known_uncertainty_us(self) -> Number:
        """U; infinite, for it is not known, where neither a bias nor any doubt is."""
        return (
            choose(self.uncertainty_us > 0, self.uncertainty_us, inf) if self.bias_us is None else self.uncertainty_us
        )


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
    combined_us = square_root(total(one.us * one.us for one in doubts))
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
    return {one.key: one.verdict_code(network) for one in bus_of(network.profile).limits if not one.is_safety}


def time_code(found: Certainty, network: Network) -> Number:
    """The place among `VERDICTS` of the limit of time.

    Parameters
    ----------
    found
        The certainty of the network's cycle.
    network
        The network.
    """
    given_us = available_us(network)
    is_shown = fits_in(found.safe_required_us, available_us=given_us)
    best_us: Number = found.margin_corrected_us + found.uncertainty_us
    least_us: Number = -FIT_ROUNDING * given_us
    return choose(is_shown, KEPT, choose(best_us < least_us, BROKEN, NOT_SHOWN_KEPT))


def verdict_code(codes: Mapping[str, Number]) -> Number:
    """The place of the verdict among `VERDICTS`: that of the worst limit, time among them."""
    return reduce(larger, codes.values())


class Judged(Protocol):
    """A verdict with the limits behind it."""

    @property
    def verdict(self) -> str | None:
        """The verdict; None under a timing model that does not decide."""

    @property
    def exceeded(self) -> tuple[str, ...]:
        """Keys of the limits that are broken."""

    @property
    def not_shown(self) -> tuple[str, ...] | None:
        """Keys of the limits that may be kept; None as the verdict."""


def limits_behind(one: Judged) -> tuple[str, ...]:
    """Keys of the limits of the bus that a verdict rests on, without time: the broken ones, or those not shown."""
    keys = (one.not_shown or ()) if one.verdict == NOT_SHOWN else one.exceeded
    return tuple(key for key in keys if key != TIME)


def limits_to_be_safe(network: Network) -> tuple[Limit, ...]:
    """Every limit that a network must keep to be shown to fit on a bus that is set safely; time is the last."""
    bus = bus_of(network.profile)
    time = time_limit(lambda one: certainty(bus.cycle(one, model=bus.deciding_model)).safe_required_us)
    return (*(limit.shown for limit in bus.limits), time)
