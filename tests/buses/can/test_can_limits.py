"""Limits of a CAN network: each value, what of it is only possible, and its words, by hand."""

from math import inf
from typing import Any

import pytest

import busplan
from busplan.questions.fit.network import network_of
from tests.buses.can.machines import loaded


def alone(*messages: dict[str, Any], bit_rate_kbit_s: float = 1000, **bus: Any) -> Any:
    """Messages of 8 bytes, 135 us each, the first goes first."""
    each = [
        {"name": f"m{place}", "identifier": place, "payload_bytes": 8, "period_us": 10_000, **keys}
        for place, keys in enumerate(messages)
    ]
    bus = {"kind": "can", "bit_rate_kbit_s": bit_rate_kbit_s, **bus}
    return network_of(loaded({"schema_version": 1, "name": "alone", "bus": bus, "message": each}))


def limit(network: Any, key: str) -> tuple[Any, ...]:
    """Value, the most, what of the value is only possible, and its words."""
    (found,) = (one for one in network.bus.limits if one.key == key)
    return found.value(network), found.most(network), found.perhaps(network), found.words(network)


def test_the_load_has_two_more_bits_of_each_fd_frame_in_doubt() -> None:
    # 64 bytes: 32 + 680 bits (ISO 11898-1), at 1000 and 2000 kbit/s, and 2 more at 1000.
    value, most, perhaps, words = limit(
        alone({"fd": True, "payload_bytes": 64}, {"fd": True, "payload_bytes": 64}, data_bit_rate_kbit_s=2000), "load"
    )
    assert (value, perhaps) == pytest.approx((2 * (32 + 2 + 340) / 10_000, 2 * 2 / 10_000))
    assert (most, words) == (0.8, "the bus load with the longest bits is 7.5%, over limits.max_load, 80.0%")


@pytest.mark.parametrize(("load", "shortest_us"), [(0.8, 0), (0.81, inf)])
def test_no_period_takes_load_off_messages_alone(load: float, shortest_us: float) -> None:
    of = alone({"period_us": 135 / load, "deadline_us": "none"})
    (found,) = (one for one in of.bus.limits if one.key == "load")
    assert found.shortest_period_us(of, is_shown=True) == shortest_us


def test_the_adapter_carries_so_many_frames() -> None:
    of = alone({}, {"period_us": 20_000}, max_frames_s=120)
    value, most, perhaps, words = limit(of, "adapter")
    assert (value, most, perhaps) == (pytest.approx(150 / 120), 1, 0)
    assert words == "the bus has 150.0 frames a second, over the 120.0 of the host's adapter"
    (ceiling,) = (one for one in of.bus.limits if one.key == "adapter")
    machine = network_of(busplan.load_profile("can-servo-8", changes={"bus.max_frames_s": 5000}))
    # 17 frames a cycle beside 350 a second: an SDO 50 and 100 times, and the heartbeats of eight nodes 20 times each.
    per_second = sum(1e6 / message.period_us * (8 if message.per_node else 1) for message in machine.profile.message)
    assert ceiling.value(machine) == pytest.approx((17 / 0.004 + per_second) / 5000)
    assert ceiling.shortest_period_us(machine, is_shown=True) == pytest.approx(17e6 / (5000 - per_second))
    full = machine._replace(profile=busplan.load_profile("can-servo-8", changes={"bus.max_frames_s": per_second}))
    assert ceiling.shortest_period_us(full, is_shown=True) == inf


def test_a_deadline_is_a_share_and_what_a_queue_adds_is_only_possible() -> None:
    # Each waits for a frame that is on the bus, and for those before it.
    late = limit(alone({"deadline_us": 1000}, {"deadline_us": 269}), "deadline")
    assert late[:3] == (270 / 269, 1, 0)
    # In one queue the first waits for the second, too; sure are only 135 us, and 100 of jitter.
    both = {"sender": "a", "deadline_us": 500}
    queued = limit(alone(both, both | {"jitter_us": 100}, {"deadline_us": 5000}, queue="fifo"), "deadline")
    assert queued[:3] == (pytest.approx(505 / 500), 1, pytest.approx((505 - 235) / 500))
    assert queued[3] == "the worst-case response time of m1 is 505 us, over its 500 us"


@pytest.mark.parametrize(
    ("of", "key", "value", "words"),
    [
        (
            alone({"deadline_us": 200}, {"deadline_us": 260}, {"deadline_us": 600}),
            "deadline",
            405 / 260,
            "the worst-case response time of m1 is 405 us, over its 260 us and 1 more",
        ),
        (
            alone({"period_us": 130, "deadline_us": 5000}, {}, {}),
            "deadline",
            inf,
            "m0 and 2 more have no worst-case response time",
        ),
        (
            alone({"period_us": 500}, {"period_us": 500}, {"period_us": 200}),
            "deadline",
            inf,
            "m2 has no worst-case response time",
        ),
        (
            alone({"period_grade": "assumed"}, {}, {"period_grade": "assumed"}),
            "periods",
            2,
            "the period of m0, m2 is assumed: give what their specification or a log says",
        ),
        (
            alone({}, {"sender": "a"}, {}, {}, {}, queue="fifo"),
            "senders",
            4,
            "m0, m2, m3 and 1 more: who sends it is not known, so neither what waits in its queue",
        ),
        (alone({}, {}), "senders", 0, ": who sends it is not known, so neither what waits in its queue"),
    ],
)
def test_words_of_a_limit_say_what_breaks_it(of: Any, key: str, value: float, words: str) -> None:
    found = limit(of, key)
    assert (found[0], found[3]) == (pytest.approx(value), words)


def test_a_bus_has_127_node_ids() -> None:
    many = network_of(
        busplan.load_profile("can-servo-8", changes={"node.axes": 4, "payload.pdo_per": "axis", "bus.nodes": 32})
    )
    found = limit(many, "nodes")
    assert (found[0], found[1]) == (128, 127)
    assert found[3] == "128 PDOs in one direction are over the 127 node-IDs of a bus"


def findings(of: Any) -> dict[str, str]:
    """What the gate says of each key, without cures."""
    found = (one.finding for one in busplan.check(of.profile).findings)
    return {one.key: one.message.removeprefix(f"{one.key}: ").partition("; ")[0] for one in found}


def test_the_gate_says_what_makes_a_message_late() -> None:
    assert findings(alone({"deadline_us": 200}, {})) == {
        "message.m0.deadline_us": "its worst-case response time is 270 us, over its 200 us"
    }
    # Of 135 us a frame: 1.35 % of the first, 103.85 of the second, and 1.35 of the third.
    assert findings(alone({}, {"period_us": 130, "deadline_us": 200}, {})) == {
        "limits.max_load": "the bus load with the longest bits is 106.5%, 80.0% allowed",
        "message.m1.deadline_us": "it has no worst-case response time, for with it the bus has a load of 105.2%",
        "message.m2.deadline_us": "it has no worst-case response time, for with it the bus has a load of 106.5%",
    }
