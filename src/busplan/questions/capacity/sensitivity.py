"""What moves the margin: how the corrected margin answers each small change of a network."""

from typing import Any, NamedTuple

from busplan.buses.network import Network
from busplan.buses.parts import BROKEN, NOT_SHOWN_KEPT
from busplan.elementwise import existing, plain
from busplan.profile.toml import override
from busplan.questions.capacity.perturbations import Perturbed, perturbed
from busplan.questions.fit.bottleneck import NextBottleneck, next_bottleneck
from busplan.questions.fit.certainty import VERDICTS, VerdictWord, certainty, limit_codes, time_code, verdict_code
from busplan.questions.fit.cycle import TIME, available_us, fits_in
from busplan.questions.fit.figures import Capacity
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.profile import Profile


class Standing(NamedTuple):
    """Where a network stands under the timing model that decides."""

    margin_corrected_us: float
    uncertainty_us: float | None
    """None where nothing is known of it."""
    verdict: VerdictWord
    safe: bool
    """Whether the bus is set so that it works reliably."""
    exceeded: tuple[str, ...]
    """Keys of the limits that are broken."""
    not_shown: tuple[str, ...]
    """Keys of the limits that are neither broken nor shown to be kept, time among them."""


class Effect(NamedTuple):
    """What one small change does to the margin."""

    change: str
    """What changes, in words."""
    key: str
    """A key of the profile, or a figure of `latency`."""
    before: Any
    """Its value, in the unit of its key; None where the change has no single one."""
    after: Any
    margin_change_us: float | None
    """By how much the corrected margin grows; None where the change cannot be made."""
    then: Standing | None
    """Where the network stands with the change."""
    note: str
    """Why the change cannot be made, or why the margin stays as it is."""


class Sensitivity(NamedTuple):
    """What moves the margin of a network at one period, by the timing model that decides."""

    profile: Profile
    """At that period."""
    timing_model: str
    now: Standing
    effects: tuple[Effect, ...]
    """The largest first; changes that cannot be made are the last."""
    next_bottleneck: NextBottleneck


def sensitivity(profile: Profile) -> Sensitivity:
    """Make every small change of a network, and compute its cycle anew.

    Parameters
    ----------
    profile
        The network.

    Examples
    --------
    >>> from busplan.profile.shipped import load
    >>> found = sensitivity(load("paper-1ms").profile)
    >>> [one.change for one in found.effects[:2]]
    ['one node more', 'one busy retry more']
    """
    network = network_of(profile)
    now = standing(network)
    effects = [_effect(one, now) for one in perturbed(network)]
    effects.sort(key=lambda one: (one.margin_change_us is None, -abs(one.margin_change_us or 0.0)))
    return Sensitivity(profile, bus_of(profile).deciding_model, now, tuple(effects), next_bottleneck(profile))


def sensitivities(capacity: Capacity) -> tuple[Sensitivity, ...]:
    """What moves the margin at each period of a capacity result."""
    periods_us = (results[0].period_us for results in capacity.periods)
    return tuple(sensitivity(override(capacity.profile, {"cycle.period_us": one})) for one in periods_us)


def standing(network: Network) -> Standing:
    """Compute where a network stands: what `capacity` says of a profile, of any network."""
    bus = bus_of(network.profile)
    cycle = bus.cycle(network, model=bus.deciding_model)
    found, codes = certainty(cycle), limit_codes(network)
    broken = tuple(key for key, code in codes.items() if code == BROKEN)
    codes[TIME] = time_code(found, network)
    late = not fits_in(cycle.required_us, available_us=available_us(network))
    return Standing(
        margin_corrected_us=plain(found.margin_corrected_us),
        uncertainty_us=existing(found.known_uncertainty_us),
        verdict=VERDICTS[int(verdict_code(codes))],
        safe=bus.is_safe(network),
        exceeded=(*broken, *((TIME,) if late else ())),
        not_shown=tuple(key for key, code in codes.items() if code == NOT_SHOWN_KEPT),
    )


def _effect(cause: Perturbed, now: Standing) -> Effect:
    change_us, then = None, None
    if cause.network is not None:
        then = standing(cause.network)
        change_us = then.margin_corrected_us - now.margin_corrected_us
    note = "" if change_us else cause.note
    return Effect(cause.change, cause.key, cause.before, cause.after, change_us, then, note)
