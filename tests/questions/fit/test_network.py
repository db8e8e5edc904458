"""A profile as a network: payloads and their times, groups that are joined, and the models that can express it."""

from typing import Any

import numpy as np
import pytest

import busplan
from busplan.buses import kind_named
from busplan.questions.fit.network import (
    at_periods,
    model_names,
    network_of,
    not_applicable,
    warnings_of,
    with_payloads,
)


def test_other_payloads_of_each_group_have_their_bytes_and_times() -> None:
    """What is not sent takes no time and has no doubt: not even the part of an execution without bytes."""
    gantry = network_of(busplan.load_profile("gantry-24"))
    changed = with_payloads(gantry, [(4, 16), (32, 0), (8, 20)])
    assert [(group.name, group.read_bytes, group.write_bytes) for group in changed.groups] == [
        ("drives", 4, 16),
        ("tool", 32, 0),
        ("io", 8, 20),
    ]
    # From the paper's table; and 5 us and 0.1 us a byte.
    times_us = [(group.read_execution_us, group.write_execution_us) for group in changed.groups]
    assert times_us == [(36.8, 36.7), (45.4, 0.0), (pytest.approx(5.8), pytest.approx(7.0))]
    # Assumed: as a guess x in a rectangle of x to each side.
    doubts_us = [(group.read_uncertainty_us, group.write_uncertainty_us) for group in changed.groups]
    assert doubts_us == [pytest.approx([us / 3**0.5 for us in pair]) for pair in times_us]
    with pytest.raises(ValueError, match="1 bytes is outside the execution table, 4 to 128 bytes"):
        with_payloads(gantry, [(1, 16), (32, 0), (8, 0)])
    (alike,) = with_payloads(network_of(busplan.load_profile("paper-1ms")), [(4, 0)]).groups
    assert (alike.read_bytes, alike.read_execution_us, alike.write_bytes, alike.write_execution_us) == (4, 36.8, 0, 0)
    # At each point of an array, too.
    (_, _, io) = with_payloads(gantry, [(4, 16), (32, 0), (np.array([0, 8]), 20)]).groups
    assert np.asarray(io.read_execution_us).tolist() == [0.0, pytest.approx(5.8)]
    assert np.asarray(io.read_uncertainty_us).tolist() == [0.0, pytest.approx(5.8 / 3**0.5)]


EXECUTION = {"kind": "linear", "grade": "measured", "base_us": 1, "per_byte_us": 0}
GROUP: dict[str, Any] = {"nodes": 2, "axes": 1, "read_bytes": 6, "write_bytes": 6, "execution": EXECUTION}


@pytest.mark.parametrize(
    ("changes", "joined"),
    [
        ({}, True),
        ({"nodes": 3}, True),
        ({"axes": 2}, False),
        ({"read_bytes": 8}, False),
        ({"execution": {**EXECUTION, "base_us": 2}}, False),
        ({"execution": {**EXECUTION, "grade": "assumed"}}, False),
        # At a slower rate they have cycles of their own.
        ({"every": 2}, False),
    ],
)
def test_neighbours_that_differ_in_name_and_number_alone_are_one_group(changes: dict[str, Any], joined: bool) -> None:
    data = busplan.load_profile("ethercat-servo-8").model_dump(exclude_unset=True)
    del data["node"], data["payload"], data["bus"]["nodes"]

    def sizes(first: dict[str, Any], second: dict[str, Any]) -> list[int]:
        data["group"] = [{**GROUP, **first, "name": "a"}, {**GROUP, **second, "name": "b"}]
        network = network_of(kind_named("ethercat").profile_model().model_validate(data))
        return [int(group.nodes) for group in network.groups]

    more = changes.get("nodes", 2)
    assert sizes({}, changes) == ([2 + more] if joined else [2, more])
    # Two that are alike at a slower rate are not joined either.
    assert sizes(changes, changes) == ([2, 2] if "every" in changes else [2 * more])


def test_the_models_that_can_express_a_network_and_the_keys_that_the_others_cannot() -> None:
    plain, gantry = (network_of(busplan.load_profile(name)) for name in ("paper-1ms", "gantry-24"))
    assert (model_names(plain), not_applicable(plain)) == (("standard", "paper"), {})
    assert model_names(gantry) == ("standard",)
    assert not_applicable(gantry) == {"paper": ("bus.cycle_master", "bus.charge_hops", "group.io.write_response")}


def test_a_network_has_its_own_period_or_those_that_are_asked_for() -> None:
    network = network_of(busplan.load_profile("paper-1ms"))
    assert at_periods(network, None) == [network]
    assert [one.period_us for one in at_periods(network, [500, 250.5])] == [500, 250.5]
    with pytest.raises(busplan.BusplanError) as caught:
        at_periods(network, [500.0, -1.0])
    assert caught.value.problems == ("period -1.0: must be 0.001 or more",)


def test_a_bus_is_warned_of_with_the_nodes_that_it_has() -> None:
    changes: dict[str, object] = {"bus.gap_count": 3, "bus.cable_length_m": 10.0}
    assert warnings_of(network_of(busplan.load_profile("paper-1ms", changes=changes))) == (
        "gap count 3 is unsafe for 2 hops (2 nodes); the smallest safe one is 7 for cables of up to 4.5 m",
        "cables of 10 m are longer than the 4.5 m that the gap-count table holds for",
    )
