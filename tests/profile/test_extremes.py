"""What no machine comes near: the schema bounds every number and every array of tables, and more is refused."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w

import busplan
from busplan.buses import kind_names
from busplan.profile.kinds import profile_model

SHIPPED = Path(__file__).parents[2] / "profiles"
MOST = {"group": 500, "message": 2048}


def unbounded(node: Any, path: str = "") -> Iterator[str]:
    """Numbers without a least or a largest value, and arrays of tables without a largest length."""
    if isinstance(node, list):
        for place, inner in enumerate(node):
            yield from unbounded(inner, f"{path}/{place}")
    if not isinstance(node, dict):
        return
    if node.get("type") in ("integer", "number") and not {"const", "enum"} & node.keys():
        if not any(key in node for key in ("minimum", "exclusiveMinimum")):
            yield f"{path}: no least value"
        if not any(key in node for key in ("maximum", "exclusiveMaximum")):
            yield f"{path}: no largest value"
    if node.get("type") == "array" and "$ref" in node.get("items", {}) and "maxItems" not in node:
        yield f"{path}: any number of tables"
    for key, inner in node.items():
        yield from unbounded(inner, f"{path}/{key}")


@pytest.mark.parametrize("kind", kind_names())
def test_every_number_and_every_array_of_tables_is_bounded(kind: str) -> None:
    assert [*unbounded(profile_model(kind).model_json_schema())] == []


def with_groups(number: int, kind: str = "ethercat") -> dict[str, Any]:
    """A profile of unlike groups of one node."""
    return {
        "schema_version": 1,
        "name": "groups",
        "bus": {"kind": kind, **({"speed": "S400"} if kind == "ieee1394" else {})},
        "cycle": {"period_us": 1e6},
        "group": [
            {
                "name": f"g{place}",
                "nodes": 1,
                "axes": 1,
                "read_bytes": 1 + place % 7,
                "write_bytes": 1,
                "execution": {"kind": "linear", "base_us": 1.0 + place, "per_byte_us": 0.0},
            }
            for place in range(number)
        ],
    }


@pytest.mark.parametrize("key", ["group", "message"])
def test_more_tables_than_are_computed_are_refused_at_their_key(tmp_path: Path, key: str) -> None:
    most = MOST[key]
    message = {"name": "m", "identifier": 1, "payload_bytes": 8, "period_us": 1e6}
    data: dict[str, Any] = (
        with_groups(most + 1)
        if key == "group"
        else {
            "schema_version": 1,
            "name": "messages",
            "bus": {"kind": "can", "bit_rate_kbit_s": 1000},
            "message": [{**message, "name": f"m{place}", "identifier": place} for place in range(most + 1)],
        }
    )
    path = tmp_path / "p.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    lines = path.read_text(encoding="utf-8").splitlines()
    line = next(number for number, text in enumerate(lines, start=1) if text.lstrip("[").startswith(key))
    with pytest.raises(busplan.BusplanError) as refused:
        busplan.load_profile(path)
    (problem,) = refused.value.problems
    assert problem.startswith(f"{path}:{line}:")
    assert f": {key}" in problem
    assert problem.endswith(f"has {most + 1:,} entries, must have {most:,} or fewer")
    assert len(problem) < 400
    data[key] = data[key][:most]
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    assert busplan.load_profile(path).name == data["name"]


@pytest.mark.parametrize(("kind", "most"), [("can", 127), ("ieee1394", 62)])
def test_there_are_no_more_groups_than_a_bus_has_nodes(kind: str, most: int) -> None:
    assert profile_model(kind).model_json_schema()["properties"]["group"]["maxItems"] == most


@pytest.mark.slow
def test_what_takes_too_long_of_many_groups_is_refused_and_the_report_says_so(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text(tomli_w.dumps(with_groups(60, "ieee1394")), encoding="utf-8")
    axes = {"cycle.nonperiodic_us": range(60)}
    period = {"cycle.period_us": range(1000, 61_000, 1000)}
    with pytest.raises(busplan.BusplanError, match="60 groups: sensitivity changes each by itself, of up to 50"):
        busplan.capacity(path, sensitivity=True)
    with pytest.raises(busplan.BusplanError, match=r"3,600 settings of 60 groups and messages .* up to 833 settings"):
        busplan.map_(path, x=axes, y=period)
    few = {"cycle.nonperiodic_us": range(20)}
    with pytest.raises(busplan.BusplanError, match=r"400 settings of 60 groups and messages .* up to 333 settings"):
        busplan.explore(path, x=few, y={"cycle.period_us": range(1000, 21_000, 1000)}, over={"bus.gap_count": [63]})
    (page,) = busplan.report(path).to_dict()["profiles"]
    reason = "60 groups: sensitivity changes each by itself, of up to 50"
    assert page["missing"] == [f"What moves the margin is not shown: {reason}."]


@pytest.mark.slow
def test_sensitivity_of_many_messages_is_refused(tmp_path: Path) -> None:
    data = with_groups(1, "can")
    data["bus"] |= {"bit_rate_kbit_s": 1000}
    message = {"payload_bytes": 8, "period_us": 1e6, "identifier_bits": 29}
    data["message"] = [{**message, "name": f"m{place}", "identifier": 0x10000 + place} for place in range(1001)]
    path = tmp_path / "p.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    with pytest.raises(busplan.BusplanError, match=r"1,001 messages: sensitivity computes all of them .*, up to 1,000"):
        busplan.capacity(path, sensitivity=True)


@pytest.mark.parametrize(
    ("changes", "most", "beside"),
    [
        ({"access": "polled"}, 500, "a cycle of requests"),
        ({"access": "burst"}, 500, "a cycle of requests"),
        ({}, 200, "40 groups"),
    ],
)
def test_what_a_can_cycle_has_beside_it_is_bounded(
    tmp_path: Path, changes: dict[str, Any], most: int, beside: str
) -> None:
    data = with_groups(1 if changes else 40, "can")
    data["bus"] |= {"bit_rate_kbit_s": 1000, **changes}
    for number, group in enumerate(data["group"]):
        group |= {"feedback_identifier": 0x300 + number, "command_identifier": 0x200 + number}
    message = {"payload_bytes": 8, "period_us": 1e6, "identifier_bits": 29}
    data["message"] = [{**message, "name": f"m{place}", "identifier": 0x10000 + place} for place in range(most + 1)]
    path = tmp_path / "p.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    with pytest.raises(busplan.BusplanError) as refused:
        busplan.load_profile(path)
    (problem,) = refused.value.problems
    assert problem.endswith(f"message: has {most + 1} entries, must have {most} or fewer beside {beside}")
    del data["message"][-1]
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    assert busplan.load_profile(path)
