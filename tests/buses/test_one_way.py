"""Nodes that are only read, or only written, on every kind of bus."""

from functools import cache
from typing import Any

import pytest

import busplan
from busplan import BusplanError, Profile
from tests.registers import at_least

EACH_KIND = [
    "paper-4ms",
    "dvrk",
    "can-servo-8",
    "canopen-6",
    "ethercat-servo-8",
    "sercos2-servo-8",
    "sercos3-servo-8",
    "profibus-drives-6",
    "dynamixel-arm-14",
    "mesa-hm2-eth",
]
WAYS = ["read", "write"]


def with_bytes(name: str, way: str, size: int, **more: Any) -> Profile:
    """A shipped profile with another payload in one direction, of all groups, and linear execution times."""
    changes: dict[str, Any] = {}
    for nodes in busplan.load_profile(name).node_groups:
        section, node = (f"group.{nodes.name}",) * 2 if nodes.name else ("payload", "node")
        changes |= {f"{section}.{way}_bytes": size}
        changes |= {f"{node}.execution": {"kind": "linear", "base_us": 20.0, "per_byte_us": 0.1}}
    return busplan.load_profile(name, changes=changes | {key.replace("__", "."): value for key, value in more.items()})


def required_us(profile: Profile) -> float:
    return float(busplan.capacity(profile).results[0].required_us)


@cache
def each_us(name: str, way: str, size: int) -> list[float]:
    return [result.required_us for result in busplan.capacity(with_bytes(name, way, size)).results]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", EACH_KIND)
def test_no_data_take_no_more_time_than_some(name: str, way: str) -> None:
    for size in range(1, 65, 64 // at_least(1)):
        assert each_us(name, way, 0)[0] <= each_us(name, way, size)[0]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", [name for name in EACH_KIND if name not in ("dvrk", "canopen-6")])
def test_a_grid_down_to_no_data_is_its_points(name: str, way: str) -> None:
    own, sizes = with_bytes(name, way, 1), [0, 1]
    swept = busplan.sweep(own, vary={f"payload.{way}_bytes": sizes})["required_us"].tolist()
    assert len(set(swept)) > 1
    assert sorted(swept) == sorted(us for size in sizes for us in each_us(name, way, size))


def test_what_is_not_sent_takes_no_time_by_hand() -> None:
    # 14 servos at 1 Mbit/s: a sync write alone; a sync read and its answers alone, each 22 us behind the one before.
    alone: dict[str, Any] = {"bus.adapter": "none", "bus.host_us": 0.0}
    arm = busplan.load_profile("dynamixel-arm-14", changes={"payload.read_bytes": 0, **alone})
    assert required_us(arm) == 10 * (14 + 14 * (1 + 4))
    arm = busplan.load_profile("dynamixel-arm-14", changes={"payload.write_bytes": 0, **alone})
    assert required_us(arm) == 10 * (14 + 14) + 14 * (22 + 10 * (11 + 10))
    # 6 boards of Modbus: function 16 writes two registers, and no function 23 does both.
    for requests in ("exchange", "single"):
        changes: dict[str, Any] = {"bus.protocol": "modbus-rtu", "bus.nodes": 6, "bus.bit_rate_kbit_s": 38.4}
        changes |= {"bus.requests": requests, "payload.read_bytes": 0, **alone}
        boards = busplan.load_profile("dynamixel-arm-14", changes=changes)
        assert required_us(boards) == pytest.approx(6 * ((9 + 4 + 8) * 11 / 0.0384 + 2 * 1750 + 22))
    # PROFIBUS has no other request: an exchange is empty one way, with 11 bits less for each of its bytes.
    whole_us = required_us(busplan.load_profile("profibus-drives-6"))
    for way, size in (("read", 18), ("write", 10)):
        drives_us = required_us(busplan.load_profile("profibus-drives-6", changes={f"payload.{way}_bytes": 0}))
        assert whole_us - drives_us == pytest.approx(6 * size * 11 / 12)
    # EtherCAT: each of 8 drives has 12 bytes less in the frame, of 0.08 us each.
    drives = [with_bytes("ethercat-servo-8", "read", size) for size in (12, 0)]
    assert required_us(drives[0]) - required_us(drives[1]) == pytest.approx(8 * 12 * 0.08)
    # SERCOS III, V1.1: neither 12 bytes nor the control of the connection, 2, of 8 drives; the AT has 12 more than 40.
    drives = [with_bytes("sercos3-servo-8", "read", size) for size in (12, 0)]
    assert required_us(drives[0]) - required_us(drives[1]) == pytest.approx(8 * (12 + 2) * 0.08)
    # CAN: 8 frames of 8 bytes with the stuff bits of the worst case, 135 bit times each, and no wait for feedback.
    drives = [with_bytes("can-servo-8", "read", size) for size in (8, 0)]
    assert required_us(drives[0]) - required_us(drives[1]) == pytest.approx(8 * 135 + 20 + 0.1 * 8)


@pytest.mark.parametrize("name", ["paper-4ms", "can-servo-8", "ethercat-servo-8", "sercos2-servo-8", "sercos3-servo-8"])
def test_a_latency_that_does_not_exist_has_no_row(name: str) -> None:
    both, read, written = (
        {row.transaction for row in busplan.latency(one).transactions}
        for one in (busplan.load_profile(name), with_bytes(name, "write", 0), with_bytes(name, "read", 0))
    )
    assert read < both
    assert written < both
    assert not read & written & {"feedback", "command", "read", "write", "loop"}


@pytest.mark.parametrize("name", ["paper-4ms", "can-servo-8", "ethercat-servo-8"])
def test_an_axis_without_commands_or_feedback_has_no_loop(name: str) -> None:
    with pytest.raises(BusplanError, match="an axis that gets no commands moves along no circle"):
        busplan.circle_test(with_bytes(name, "write", 0, servo__loop="node"))
    with pytest.raises(BusplanError, match="a loop on the host needs feedback"):
        busplan.circle_test(with_bytes(name, "read", 0, servo__loop="host"))
    assert busplan.circle_test(with_bytes(name, "read", 0, servo__loop="node", cycle__period_us=4000.0))


def test_no_pdos_are_an_empty_list() -> None:
    changes: dict[str, Any] = {"payload.read_bytes": None, "payload.feedback_pdos": []}
    arm = busplan.load_profile("can-servo-8", changes=changes)
    assert required_us(arm) == required_us(busplan.load_profile("can-servo-8", changes={"payload.read_bytes": 0}))
    with pytest.raises(BusplanError, match="is empty, so nothing is sent"):
        busplan.load_profile("can-servo-8", changes={"payload.feedback_pdos": []})


def test_a_machine_keeps_its_one_way_nodes_on_other_buses() -> None:
    meters = with_bytes("dynamixel-arm-14", "write", 0)
    for row in busplan.compare(meters).to_dict()["buses"]:
        assert not any("write_bytes" in key["key"] for key in row.get("assumed", ()))
