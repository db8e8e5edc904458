"""What a kind of bus offers for a profile: settings that a plan may change, and small changes of a sensitivity."""

import re
from collections.abc import Iterator

import pytest

import busplan
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.network import network_of
from busplan.sections.base import value_at
from tests.registers import shipped_names

VARIANTS = (
    ("can-fd-arm-7", {"bus.data_bit_rate_kbit_s": 500, "bus.bit_rate_kbit_s": 250}),
    ("canopen-6", {"bus.bit_rate_kbit_s": 500, "bus.sync_counter": True, "bus.identifier_bits": 29}),
    ("can-motors-8", {"bus.bit_rate_kbit_s": 500, "bus.access": "burst"}),
    ("dynamixel-arm-14", {"bus.return_delay_us": 250}),
    ("dynamixel-arm-14", {"bus.requests": "single", "bus.timeout_us": 5000}),
    ("paper-1ms", {"node.write_response": "unified", "bus.max_hops": 1}),
    ("paper-1ms", {"cycle.schedule": "broadcast", "bus.speed": "S800"}),
    ("sercos2-servo-8", {"bus.data_rate_mbit_s": 8}),
)
"""Shipped profiles with values for which a kind offers something else."""


def profiles() -> Iterator[busplan.Profile]:
    for name in shipped_names():
        yield busplan.load_profile(name)
    for name, changes in VARIANTS:
        yield busplan.load_profile(name, changes=changes)


PROFILES = pytest.mark.parametrize("profile", [*profiles()], ids=lambda profile: profile.name)


def required_us(profile: busplan.Profile) -> float:
    return float(deciding_cycle(network_of(profile)).required_us)


def worth(profile: busplan.Profile) -> tuple[object, ...]:
    """What a setting may change: the cycle, a limit, a latency."""
    network = network_of(profile)
    limits = tuple((limit.value(network), limit.most(network)) for limit in network.bus.limits)
    latencies = tuple(tuple(one.phases.items()) for one in deciding_cycle(network).latencies())
    return required_us(profile), limits, latencies


@PROFILES
def test_a_setting_offers_values_that_a_profile_takes_and_each_has_its_own_effect(profile: busplan.Profile) -> None:
    network = network_of(profile)
    for setting in network.bus.settings(network):
        seen = [worth(profile)]
        for changes in setting.values:
            assert changes.keys() <= {*setting.keys}
            other = worth(busplan.load_profile(profile, changes=dict(changes)))
            assert other not in seen, changes
            seen.append(other)


@PROFILES
def test_a_small_change_costs_time_and_one_that_is_not_offered_costs_none(profile: busplan.Profile) -> None:
    network = network_of(profile)
    for small in network.bus.perturbations(network):
        if small.why_not.startswith("in a chain"):  # max_hops would make it another network
            continue
        try:
            changed = busplan.load_profile(profile, changes=dict(small.changes))
        except busplan.BusplanError:
            assert small.why_not, small
            continue
        more_us = required_us(changed) - required_us(profile)
        if step := re.search(r"\+([0-9.]+) |one more", small.label):
            ((key, after),) = small.changes.items()
            before = float(value_at(profile, key) or 0)
            assert float(after) - before == pytest.approx(float(step[1] or 1)) or key == "bus.max_hops", small
        if small.why_not:
            assert changed == profile or more_us == 0, small
        else:
            assert changed != profile, small
            assert more_us < 0 if small.label == "16 Mbit/s" else more_us >= 0, small


@PROFILES
def test_payloads_are_whole_bytes_words_of_sercos_or_quadlets_of_ieee_1394(profile: busplan.Profile) -> None:
    network = network_of(profile)
    quadlets, words = {"ieee1394": 4}, {"sercos2": 2, "sercos3": 2}
    assert network.bus.payloads(network).step_bytes == (quadlets | words).get(profile.bus.kind, 1)


@pytest.mark.parametrize(
    ("name", "changes", "most_bytes"),
    [
        ("paper-4ms", {}, 2048),  # asynchronous packets of S400 and S100
        ("paper-4ms", {"bus.speed": "S100"}, 512),
        ("can-servo-8", {}, 4 * 8),  # four PDOs
        ("can-fd-arm-7", {}, 4 * 64),
        ("sercos2-servo-8", {}, 32),  # what a drive of the ring can be told to send
        ("sercos2-servo-8", {"node.axes": 3}, 3 * 32),
        ("profibus-drives-6", {}, 244),  # data of an SRD telegram
    ],
)
def test_the_largest_payload_is_that_of_its_carrier(name: str, changes: dict[str, object], most_bytes: int) -> None:
    network = network_of(busplan.load_profile(name, changes=changes))
    assert network.bus.payloads(network).most_bytes == most_bytes
