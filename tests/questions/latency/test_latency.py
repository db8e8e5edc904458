"""Latency of a profile's transactions."""

from collections.abc import Callable

import pytest

import busplan
from busplan.errors import BusplanError

Make = Callable[..., busplan.Profile]


def test_without_payloads_the_profiles_own_are_taken(make: Make) -> None:
    result = busplan.latency(make(payload__read_bytes=8, payload__write_bytes=16))
    assert [(row.transaction, row.payload_bytes, row.timing_model) for row in result.transactions] == [
        ("read", 8, "standard"),
        ("read", 8, "paper"),
        ("write", 16, "standard"),
        ("write", 16, "paper"),
    ]


def test_payloads_go_to_read_and_write_alike(make: Make) -> None:
    result = busplan.latency(make(), payload_bytes=[4, 32], timing_model="standard")
    assert [(row.transaction, row.payload_bytes) for row in result.transactions] == [
        ("read", 4),
        ("write", 4),
        ("read", 32),
        ("write", 32),
    ]


def test_the_farthest_node_of_a_chain_is_as_many_hops_away_as_there_are_nodes(make: Make) -> None:
    chain, tree = (busplan.latency(make(bus__nodes=5, bus__max_hops=hops)).transactions[0].phases for hops in (None, 2))
    assert (chain["hops"], tree["hops"]) == (5, 2)
    assert (chain["latency_us"] or 0) > (tree["latency_us"] or 0) > 0


def test_execution_comes_from_the_profile(make: Make) -> None:
    profile = make(node__execution__base_us=10.0, node__execution__per_byte_us=2.0)
    assert {row.phases["execution_us"] for row in busplan.latency(profile, payload_bytes=7).transactions} == {24.0}


def test_a_payload_outside_the_table_is_refused_with_its_range(make: Make) -> None:
    table = {"kind": "table", "payload_bytes": [4, 64], "time_us": [30.0, 50.0]}
    with pytest.raises(BusplanError, match="payload 65 bytes: outside the execution table of test, 4 to 64 bytes"):
        busplan.latency(make(node__execution=table), payload_bytes=[65])


def test_a_loop_over_the_host_is_said_in_a_sentence() -> None:
    first, *_ = str(busplan.latency("ethercat-servo-8")).splitlines()
    assert first == "A command acts after 1500 us, feedback is 604 us old, a loop takes 2000 us."
    of_host = "of which 5000 us are the host's cycles"
    parts = f"{of_host} and 1480 us the wait for that SYNC"
    said = f"Loop: 10000 us from SYNC to the SYNC that applies the command, {parts}."
    assert said in str(busplan.latency("canopen-6")).splitlines()
    said = f"Loop: 8520 us from SYNC to the executed command, {of_host}."
    on_arrival = busplan.load_profile("canopen-6", changes={"servo.update": "on_arrival"})
    assert said in str(busplan.latency(on_arrival)).splitlines()
    # The vendors model decides nothing.
    assert "A command acts" not in str(busplan.latency("ethercat-servo-8", timing_model="vendors"))
