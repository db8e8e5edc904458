"""What does not agree in a CAN profile is refused with its key, its value and what would be right; its edge is not."""

from typing import Any

import pytest

import busplan
from tests.buses.can.machines import loaded

EXECUTION = {"kind": "linear", "grade": "measured", "base_us": 100, "per_byte_us": 0}
ALIKE: dict[str, Any] = {
    "schema_version": 1,
    "name": "line",
    "bus": {"kind": "can", "bit_rate_kbit_s": 500, "nodes": 2},
    "cycle": {"period_us": 4000},
    "payload": {"read_bytes": 8, "write_bytes": 8},
    "node": {"axes": 1, "execution": EXECUTION},
}
ALONE: dict[str, Any] = {"schema_version": 1, "name": "line", "bus": {"kind": "can", "bit_rate_kbit_s": 500}}


def changed(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Sections with other values by dotted key; None takes one away."""
    data = {key: dict(part) if isinstance(part, dict) else part for key, part in base.items()}
    for key, value in changes.items():
        section, _, name = key.partition(".")
        if value is None:
            del data[section]
        elif name:
            data.setdefault(section, {})[name] = value
        else:
            data[section] = value
    return data


def message(**keys: Any) -> dict[str, Any]:
    return {"name": "one", "identifier": 0x600, "payload_bytes": 8, "period_us": 10_000, **keys}


def groups(number: int, **keys: Any) -> dict[str, Any]:
    """Instead of nodes that are alike some groups."""
    alike = {"nodes": 1, "axes": 1, "read_bytes": 8, "write_bytes": 8, "execution": EXECUTION, **keys}
    some = [{"name": f"g{place}", **alike} for place in range(number)]
    return {"bus": {"kind": "can", "bit_rate_kbit_s": 500}, "payload": None, "node": None, "group": some}


def many(number: int) -> list[dict[str, Any]]:
    return [message(name=f"m{place}", identifier=place, identifier_bits=29) for place in range(number)]


ONE_RATE = "and a classical frame has one alone; write fd = true"
SWITCH = "brs = false says a frame without a switch of bit rate"
NO_SYNC = 'and bus.access = "polled" has none'
NO_NODES = "asks for nodes, and a network of messages alone has none; remove it"
REFUSED: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    (
        ALIKE,
        {"bus.data_bit_rate_kbit_s": 499},
        "bus.data_bit_rate_kbit_s = 499: is under bit_rate_kbit_s, 500: CAN FD switches to no slower bit rate",
    ),
    (
        ALIKE,
        {"bus.error_burst": 2},
        "bus.error_burst = 2: asks for error_period_us, the time from one burst of errors to the next",
    ),
    (
        ALIKE,
        {"payload.feedback_pdos": []},
        "payload.feedback_pdos = []: is empty, so nothing is sent, and read_bytes has data; give one of the two",
    ),
    (
        ALIKE,
        {"payload.command_pdos": [9]},
        "payload.command_pdos = [ 9, ]: has a PDO over the 8 bytes of a classical frame",
    ),
    (ALIKE, {"bus.sync_identifier": 2048}, "bus.sync_identifier = 2048: is over 2047, the largest of 11 bits"),
    (
        ALIKE,
        {"payload.feedback_identifier": 2048},
        "payload.feedback_identifier = 2048: is over 2047, the largest of 11 bits",
    ),
    (
        ALIKE,
        {"bus.sync_jitter_us": 4000},
        "bus.sync_jitter_us = 4000: is not under cycle.period_us, 4000: the next SYNC would come before it",
    ),
    (
        ALIKE,
        {"cycle": None},
        "cycle: missing section [cycle]; as one line, above all sections: cycle = {period_us = 4000}",
    ),
    (
        ALIKE,
        {"message": [message(per_node=True, sender="host")]},
        'message.one.sender = "host": has each node for its sender',
    ),
    (
        ALIKE,
        {"message": [message(payload_bytes=9)]},
        "message.one.payload_bytes = 9: is over the 8 bytes of a classical frame; fd = true allows 64",
    ),
    (
        ALIKE,
        {"message": [message(brs=False)]},
        f"message.one.brs = false: is of an FD frame that keeps the bit rate, {ONE_RATE}",
    ),
    (
        ALIKE,
        {"message": [message(fd=True)]},
        f"message.one.fd = true: asks for bus.data_bit_rate_kbit_s; {SWITCH}",
    ),
    (
        ALIKE,
        {"message": [message(per_node=True, identifier=2047 - 126)]},
        "message.one.identifier = 1921: leaves no room for 127 nodes below 2047",
    ),
    (
        ALIKE,
        {"message": [message(), message(identifier=0x601)]},
        'message[1].name = "one": there is a message of this name',
    ),
    (
        ALIKE,
        {"message": [message(name="loop")]},
        'message.loop.name = "loop": is what the frames of the cycle are called',
    ),
    (ALIKE, groups(100) | {"message": many(81)}, "message: has 81 entries, must have 80 or fewer beside 100 groups"),
    (
        ALIKE,
        {"bus.access": "polled", "message": many(501)},
        "message: has 501 entries, must have 500 or fewer beside a cycle of requests",
    ),
    *(
        (
            ALIKE,
            {"bus.access": "polled", f"bus.{key}": value},
            f"bus.{key} = {words}: asks for SYNC, {NO_SYNC}; remove it",
        )
        for key, value, words in (
            ("sync_identifier", 0x80, "128"),
            ("sync_counter", False, "false"),
            ("sync_jitter_us", 0, "0"),
        )
    ),
    (
        ALIKE,
        {"bus.access": "polled", "bus.pipeline_cycles": 0},
        "bus.pipeline_cycles = 0: asks for SYNC: without it a command rests on an earlier cycle; write 1 or more",
    ),
    (
        ALIKE,
        {"bus.access": "polled", "node.queue": "single-buffer"},
        f'node.queue = "single-buffer": is computed with SYNC alone, {NO_SYNC}; remove it, and by priority is assumed',
    ),
    (
        ALIKE,
        groups(1, queue="fifo") | {"bus.access": "polled"},
        f'group.g0.queue = "fifo": is computed with SYNC alone, {NO_SYNC}; remove it, and by priority is assumed',
    ),
    (
        ALIKE,
        {"bus.access": "polled", "payload.write_bytes": 0},
        "payload.write_bytes = 0: comes to 0 bytes, and a command and its answer have data: 1 or more",
    ),
    (
        ALONE,
        {"cycle.period_us": 4000, "message": [message()]},
        "cycle: has no nodes; add bus.nodes, [node] and [payload], or remove it: messages alone have no cycle",
    ),
    *(
        (ALONE, {key: value, "message": [message()]}, f"{key} = {words}: {NO_NODES}")
        for key, value, words in (
            ("bus.sync_identifier", 0x80, "128"),
            ("bus.host_us", 0, "0"),
            ("limits.min_spare_axes", 1, "1"),
        )
    ),
    (ALONE, {"message": [message(per_node=True)]}, f"message.one.per_node = true: {NO_NODES}"),
]


@pytest.mark.parametrize(("base", "changes", "words"), REFUSED, ids=[words.split(":")[0] for *_, words in REFUSED])
def test_what_does_not_agree_is_refused(base: dict[str, Any], changes: dict[str, Any], words: str) -> None:
    with pytest.raises(busplan.BusplanError) as refused:
        loaded(changed(base, changes))
    (problem,) = refused.value.problems
    key, _, why = words.partition(": ")
    said = " ".join(problem.split()).partition(": ")[2]
    assert (said.startswith(key), said.partition(": ")[2]) == (True, why)


@pytest.mark.parametrize(
    ("base", "changes"),
    [
        (ALIKE, {"bus.data_bit_rate_kbit_s": 500}),
        (ALIKE, {"bus.sync_identifier": 2047}),
        (ALIKE, {"bus.sync_jitter_us": 3999}),
        (ALIKE, {"payload": {"feedback_pdos": [], "write_bytes": 8}}),
        (ALIKE, {"payload.feedback_pdos": [8], "payload.command_pdos": [8]}),
        (ALIKE, {"message": [message(per_node=True, identifier=2047 - 127)]}),
        (ALIKE, {"message": [message(fd=True, brs=False, payload_bytes=64)]}),
        (ALIKE, groups(100) | {"message": many(80)}),
        (ALIKE, {"bus.access": "polled", "message": many(500)}),
        (ALIKE, {"bus.access": "polled", "bus.pipeline_cycles": 1, "bus.queue": "priority"}),
        (ALONE, {"message": [message(identifier=1 << 28, identifier_bits=29)]}),
    ],
)
def test_its_edge_is_not(base: dict[str, Any], changes: dict[str, Any]) -> None:
    assert loaded(changed(base, changes)).name == "line"
