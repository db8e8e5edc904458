"""Derive the figures of `latency` by calling the functions of the bus with traced numbers."""

from math import inf
from typing import NamedTuple

from busplan.buses.cycle import BusLatency
from busplan.elementwise import Number, Traced
from busplan.questions.explain.trace import found as result_of
from busplan.questions.fit.inputs import traced_profile
from busplan.questions.fit.network import bus_of, network_of
from busplan.sections.profile import Profile
from busplan.sourced import Input, Sourced, short


def latency_names(profile: Profile) -> tuple[str, ...]:
    """Names of the transactions in `latency`, or of the cycle."""
    bus = bus_of(profile)
    return tuple(one.label for one in bus.cycle(network_of(profile), model=bus.deciding_model).latencies())


class TracedLatencies(NamedTuple):
    """Every transaction of `latency` in traced numbers, and of how many nodes."""

    nodes: Number
    each: tuple[BusLatency, ...]


def traced_latencies(profile: Profile, *, model: str) -> TracedLatencies:
    """Every transaction of `latency` in traced numbers."""
    network = network_of(traced_profile(profile))
    return TracedLatencies(network.nodes, bus_of(profile).cycle(network, model=model).latencies())


def latency_figures(
    profile: Profile, *, model: str, kind: str, latencies: TracedLatencies | None = None
) -> dict[str, Traced]:
    """Derive every figure of one transaction of `latency`.

    Parameters
    ----------
    profile
        The network; the transaction is that of its farthest node.
    model
        Timing model.
    kind
        One of `latency_names`.
    latencies
        All of `traced_latencies`, where they are known.

    Returns
    -------
    dict
        By key, all figures of `latency`; one that this transaction does not have is None.
    """
    latencies = latencies or traced_latencies(profile, model=model)
    (one,) = (one for one in latencies.each if one.label == kind)
    found: dict[str, Number | None] = {
        "timing_model": chosen(model, "timing_model", "timing model asked for"),
        "transaction": chosen(kind, "transaction", "transaction asked for"),
        "payload_bytes": one.payload_bytes,
        "nodes": latencies.nodes,
        **{key: if_finite(number) for key, number in one.phases.items()},
    }
    return {
        figure.key: remembered(found.get(figure.key), figure.key, figure.symbol)
        for figure in bus_of(profile).figures.latency
    }


def if_finite(number: Number) -> Number:
    """A figure, or None with the inputs of an infinite one, which does not exist."""
    if isinstance(number, Traced) and number.value == inf:
        return result_of(None, "does not exist", (number,))
    return number


def chosen(word: object, key: str, meaning: str) -> Traced:
    """Make an input from an option of the caller."""
    return Traced(word, given=Input(key, key, str(word), "", "given", "asked for", meaning))


def remembered(number: Number | None, key: str, symbol: str) -> Traced:
    """Name a traced figure; a constant becomes a line of its own."""
    if isinstance(number, Traced):
        return number.named(key, symbol)
    if isinstance(number, Sourced):
        return Traced(float(number), formula=number.meaning, numbers=short(number), parts=(number,)).named(key, symbol)
    return Traced(number, formula=short(number), numbers=short(number)).named(key, symbol)
