"""A sweep of a CAN network, which computes many points at once, against each point alone."""

from itertools import product
from typing import Any

import pytest

import busplan
from tests.buses.can.machines import WORST, loaded
from tests.registers import some

NODE = {"axes": 2, "execution": {"kind": "linear", "grade": "measured", "base_us": 40.0, "per_byte_us": 1.0}}
BASE: dict[str, Any] = {
    "schema_version": 1,
    "name": "arm",
    "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "nodes": 3},
    "cycle": {"period_us": 8000.0},
    "payload": {"read_bytes": 8, "write_bytes": 8},
    "node": NODE,
}


def message(name: str, identifier: int, **keys: Any) -> dict[str, Any]:
    return {"name": name, "identifier": identifier, "payload_bytes": 8, "period_us": 1e5, **keys}


def group(name: str, nodes: int, **keys: Any) -> dict[str, Any]:
    return {"name": name, "nodes": nodes, "read_bytes": 1, "write_bytes": 1, **NODE, "axes": 1, **keys}


NETWORKS: dict[str, tuple[dict[str, Any], dict[str, list[float]]]] = {
    "one message": (
        {**BASE, "message": [message("early", 0x90, period_us=2000.0, jitter_us=300.0, deadline_us=900.0)]},
        {
            "cycle.period_us": [700.0, 2500.0, 20_000.0],
            "bus.nodes": [1, 9, 100],
            "payload.write_bytes": [8, 9],
        },
    ),
    "many messages": (
        {
            **BASE,
            "message": [
                message(f"m{place}", 0x70 + 40 * place, period_us=6000.0 + 700 * place, jitter_us=10.0 * place)
                for place in range(12)
            ],
        },
        {"cycle.period_us": [2500.0, 6000.0, 20_000.0], "bus.nodes": [1, 9], "message.m3.payload_bytes": [0, 8]},
    ),
    "both formats": (
        {
            **BASE,
            "payload": {"feedback_pdos": [6, 6], "command_pdos": [6, 2], "read_bytes": 12, "write_bytes": 8},
            "message": [
                message("sdo", 0x580, period_us=20_000.0, per_node=True),
                message("early", 0x10, period_us=5_000.0, identifier_bits=29),
                message("late", 0x1FFFFFFF, period_us=30_000.0, identifier_bits=29),
            ],
        },
        {"bus.nodes": [1, 4, 40], "payload.read_bytes": [3, 7, 14], "bus.bit_rate_kbit_s": [125.0, 400.0]},
    ),
    "any identifier": (
        {
            **BASE,
            "message": [message("sdo", 0x580, period_us=20_000.0, per_node=True), message("early", 0x10, burst=3)],
        },
        {"bus.sync_identifier": [0x80, 0x182, 0x700], "bus.identifier_bits": [11, 29], "bus.nodes": [2, 12]},
    ),
    "CAN FD": (
        {
            **BASE,
            "bus": {**BASE["bus"], "data_bit_rate_kbit_s": 5000},
            "message": [
                # Which of them is longer rests on the rates.
                message("long", 0x580, period_us=20_000.0, fd=True, payload_bytes=24),
                message("classical", 0x1FFFFFFF, period_us=30_000.0, identifier_bits=29),
                message("early", 0x10, period_us=5_000.0, fd=True, deadline_us=700.0),
            ],
        },
        {
            "bus.nodes": [1, 4, 14],
            "payload.read_bytes": [3, 20, 257],
            "bus.bit_rate_kbit_s": [500.0, 1000.0],
            "bus.data_bit_rate_kbit_s": [1000.0, 8000.0],
        },
    ),
    "two rates": (
        {
            **{key: section for key, section in BASE.items() if key not in ("payload", "node")},
            "bus": {"kind": "can", "bit_rate_kbit_s": 1000},
            "group": [
                group("drives", 2),
                group("io", 1, axes=0, every=2, feedback_identifier=0x7A0, command_identifier=0x7C0),
            ],
            "message": [message("between", 0x300, period_us=2000.0), message("low", 0x7FF, deadline_us=5000.0)],
        },
        {"group.io.every": [1, 2, 5], "group.io.nodes": [1, 4, 12], "cycle.period_us": [1500.0, 4000.0]},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("form", ["compiled", "python"])
@pytest.mark.parametrize("name", NETWORKS)
def test_a_sweep_has_at_each_point_what_capacity_has(monkeypatch: pytest.MonkeyPatch, name: str, form: str) -> None:
    if form == "python":
        monkeypatch.setattr("busplan.buses.can.waiting._compiled", lambda: None)
    data, vary = NETWORKS[name]
    own = loaded(data)
    rows = busplan.sweep(own, vary=vary, timing_model=[WORST]).to_dict()["rows"]
    points = [dict(zip(vary, values, strict=True)) for values in product(*vary.values())]
    for point, row in some(zip(points, rows, strict=True), 6):
        assert {key: row[key] for key in vary} == point
        answer = busplan.capacity(busplan.load_profile(own, changes=point), timing_model=[WORST])
        (result,) = answer.to_dict()["results"]
        # How many nodes fit is known of a group that is varied alone.
        figures = {key: value for key, value in result.items() if key in row and value is not None}
        assert len(figures) > 20
        for key, value in figures.items():
            assert row[key] == (pytest.approx(value, rel=1e-12) if isinstance(value, float) else value), (key, point)
    assert len({row["verdict"] for row in rows}) > 1


def test_a_sweep_counts_the_identifiers_that_stand_twice() -> None:
    own = loaded({**BASE, "payload": {**BASE["payload"], "command_identifier": 0x185}})
    rows = busplan.sweep(own, vary={"bus.nodes": range(1, 9)}, timing_model=[WORST]).to_dict()["rows"]
    # Feedback begins at 0x181: that of five nodes ends where commands begin.
    assert [row["bus.nodes"] for row in rows if "identifiers" in row["exceeded"]] == [5, 6, 7, 8]
