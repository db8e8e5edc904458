"""Assumed keys that carry much of the cycle or of its uncertainty: a verdict rests on them unmeasured."""

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

from busplan.buses.network import Group, Network
from busplan.buses.rule import RuleFigures
from busplan.elementwise import plain
from busplan.questions.fit.inputs import given
from busplan.questions.fit.network import network_of
from busplan.sections.base import value_at, with_unchecked
from busplan.sections.profile import Profile
from busplan.sourced import Sourced

_MUCH: Final = Sourced(
    0.25,
    unit="1",
    grade="assumed",
    source="chosen",
    meaning="share of the variance, or of the required time, from which on a verdict rests on a key",
)
_EXECUTION: Final = "execution"
_ENDLESS: Final = 1e12
"""A bit rate at which nothing takes time [kbit/s]."""
_Share = tuple[tuple[str, ...], float, str]
"""Keys, what they carry [1], and of what."""


class HeavyAssumption(NamedTuple):
    """An assumed key, or the assumed execution times together, which carry much of a cycle."""

    keys: tuple[str, ...]
    """Dotted keys: one, or the section of the execution time of each group, which are taken to err together."""
    carries: str
    """Its shares, in words that begin with the verb."""

    @property
    def is_execution(self) -> bool:
        """Whether these are execution times."""
        return self.keys[0].endswith(f".{_EXECUTION}")

    def covers(self, key: str) -> bool:
        """Whether a key is among these, or in one of these sections."""
        return any(key == covered or key.startswith(f"{covered}.") for covered in self.keys)


def heavy_assumptions(figures: RuleFigures, network: Network) -> tuple[HeavyAssumption, ...]:
    """The assumptions that carry more than a quarter of the variance or of the required time.

    Parameters
    ----------
    figures
        Figures under the timing model that decides.
    profile
        The network.
    """
    profile = network.profile
    variance = sum(float(doubt.us) ** 2 for doubt in figures.doubts)
    shares: list[_Share] = [
        ((doubt.key,), float(doubt.us) ** 2 / variance, "the variance") for doubt in figures.doubts if variance
    ]
    shares += [((term.rests_on,), plain(term.us) / figures.required_us, "the required time") for term in figures.terms]
    # What is no key has no grade, and execution times are no term or doubt of one key.
    shares = [share for share in shares if share[1] > _MUCH and _is_assumed(profile, share[0][0])]
    shares += _of_execution(figures, network, variance)
    shares += _of_rates(figures, network)
    said: dict[tuple[str, ...], list[str]] = {}
    for keys, share, whole in shares:
        if share > _MUCH:
            said.setdefault(keys, []).append(f"{share:.0%} of {whole}")
    verbs = {keys: "carries" if len(keys) == 1 else "together carry" for keys in said}
    return tuple(HeavyAssumption(keys, f"{verbs[keys]} {' and '.join(carried)}") for keys, carried in said.items())


def _is_assumed(profile: Profile, key: str) -> bool:
    return isinstance(value_at(profile, key), int | float) and given(profile, key).grade == "assumed"


def _of_execution(figures: RuleFigures, network: Network, variance: float) -> list[_Share]:
    """Shares of the assumed execution times: what of its terms goes without them, and their part of the variance."""
    network, bus = network._replace(period_us=figures.period_us), network.bus
    assumed = [group for group in network.groups if _counts(group, network)]
    if not assumed:
        return []
    without = network._replace(groups=tuple(_at_once(group) if group in assumed else group for group in network.groups))
    cycle, keys = bus.cycle(without, model=figures.timing_model), tuple(group.key(_EXECUTION) for group in assumed)
    whole_us, rest_us = (_doubt_us(doubts) for doubts in (figures.doubts, cycle.doubts()))
    rest = {term.key: plain(term.us) for term in cycle.terms}
    # A term that grows without execution times, as the wait for a gap does, is not carried by them.
    carried_us = sum(max(0.0, plain(term.us) - rest[term.key]) for term in figures.terms)
    of_time = (keys, carried_us / figures.required_us, "the required time")
    return [(keys, whole_us * (whole_us - rest_us) / variance, "the variance"), of_time] if variance else [of_time]


def assumed_rates(network: Network) -> tuple[str, ...]:
    """Keys of the bit rates that a profile calls assumed."""
    return tuple(key for key in network.bus.rate_keys if _is_assumed(network.profile, key))


def _of_rates(figures: RuleFigures, network: Network) -> Iterator[_Share]:
    """Shares of the assumed bit rates: what of the required time, or without a cycle of the load, goes without them."""
    bus = network.bus
    for key in assumed_rates(network):
        endless = network_of(with_unchecked(network.profile, key, _ENDLESS))
        if network.groups:
            cycle = bus.cycle(endless._replace(period_us=figures.period_us), model=figures.timing_model)
            yield (key,), 1 - plain(cycle.required_us) / figures.required_us, "the required time"
        elif (load := bus.limit("load")) is not None:
            yield (key,), 1 - plain(load.bound.value(endless)) / plain(load.bound.value(network)), "the load"


def _counts(group: Group, network: Network) -> bool:
    is_assumed = group.node.execution.grade == "assumed"
    return is_assumed and network.bus.has_execution(network._replace(groups=(group,)))


def _at_once(group: Group) -> Group:
    """The same nodes, known to execute in no time."""
    return group._replace(
        read_execution_us=0.0, write_execution_us=0.0, read_uncertainty_us=0.0, write_uncertainty_us=0.0
    )


def _doubt_us(doubts: Sequence[Any]) -> float:
    """The standard uncertainty that all execution times give a cycle [us]."""
    return sum(float(doubt.us) for doubt in doubts if doubt.key.endswith(f".{_EXECUTION}"))
