"""Payloads of a node: a fixed part, a part for each of its axes, or both."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from tests.registers import at_least

TEXT = """schema_version = 1
name = "gantry"
[bus]
kind = "ieee1394"
speed = "S400"
gap_count = 63
nodes = 2
[cycle]
period_us = 4000
[payload]
{payload}
[node]
axes = 4
[node.execution]
{execution}
"""
LINE = 'kind = "linear"\nbase_us = 20\nper_byte_us = 0.1'


@pytest.fixture(autouse=True)
def _work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def profile(payload: str, execution: str = LINE) -> busplan.Profile:
    Path("gantry.toml").write_text(TEXT.format(payload=payload, execution=execution), encoding="utf-8")
    return busplan.load_profile("gantry.toml")


def refused(payload: str, execution: str = LINE) -> list[str]:
    with pytest.raises(busplan.BusplanError) as caught:
        profile(payload, execution)
    return list(caught.value.problems)


def figures_of(one: busplan.Profile) -> Any:
    return busplan.capacity(one).results, busplan.latency(one).transactions


def standard(one: busplan.Profile) -> Any:
    (figures,) = busplan.capacity(one, timing_model="standard").results
    return figures


@settings(max_examples=at_least(5, 40))
@given(fixed=st.integers(0, 60), per_axis=st.integers(1, 30), axes=st.integers(1, 12))
def test_what_each_axis_adds_is_as_if_it_stood_in_the_payload(fixed: int, per_axis: int, axes: int) -> None:
    added = f"read_bytes_per_axis = {per_axis}\nwrite_bytes_per_axis = {per_axis}"
    if fixed:
        added += f"\nread_bytes = {fixed}\nwrite_bytes = {fixed}"
    size = fixed + per_axis * axes
    both = (profile(added), profile(f"read_bytes = {size}\nwrite_bytes = {size}"))
    first, second = (busplan.load_profile(one, changes={"node.axes": axes}) for one in both)
    assert figures_of(first) == figures_of(second)


def test_the_packet_limit_follows_the_axes() -> None:
    own = profile("read_bytes = 12\nwrite_bytes = 8\nwrite_bytes_per_axis = 20")
    # S400 carries 2,048 bytes: 8 + 102 x 20 is the last that fits.
    last, over = (standard(busplan.load_profile(own, changes={"node.axes": axes})) for axes in (102, 103))
    assert "payload" not in last.exceeded
    assert "payload" in over.exceeded


def test_a_payload_needs_one_of_both_keys() -> None:
    assert refused("read_bytes_per_axis = 8") == [
        "gantry.toml:10:2: payload.write_bytes: missing key; expected write_bytes, write_bytes_per_axis or both"
    ]
    assert "payload.read_bytes: missing key" in refused("")[0]
    for wrong in ("-1", "1.5", "true"):
        assert "payload.read_bytes_per_axis = " in refused(f"read_bytes_per_axis = {wrong}\nwrite_bytes = 4")[0]


@pytest.mark.parametrize(
    ("payload", "read", "write", "follows"),
    [
        ("read_bytes = 12\nwrite_bytes = 8", ("read_bytes", 12), ("write_bytes", 8), False),
        ("read_bytes_per_axis = 3\nwrite_bytes = 8", ("read_bytes_per_axis", 12), ("write_bytes", 8), True),
        (
            "read_bytes = 5\nread_bytes_per_axis = 2\nwrite_bytes = 0",
            ("read_bytes_per_axis", 13),
            ("write_bytes", 0),
            True,
        ),
        (
            "read_bytes = 1\nwrite_bytes = 1\nwrite_bytes_per_axis = 0",
            ("read_bytes", 1),
            ("write_bytes_per_axis", 1),
            True,
        ),
    ],
)
def test_a_payload_is_changed_by_its_part_of_each_axis_first(
    payload: str, read: tuple[str, int], write: tuple[str, int], follows: bool
) -> None:
    """Of a node with four axes."""
    (nodes,) = profile(payload).node_groups
    found = [(nodes.payload.key_of(kind), nodes.bytes_of(kind)) for kind in ("read", "write")]
    assert found == [read, write]
    assert [nodes.payload_key(kind) for kind in ("read", "write")] == [f"payload.{key}" for key, _ in (read, write)]
    assert nodes.payload.follows_axes == follows
    assert (nodes.nodes_key, nodes.node_key("execution.base_us")) == ("bus.nodes", "node.execution.base_us")


@pytest.mark.parametrize(
    ("payload", "problem"),
    [
        ("axes = 0\nread_bytes = 4\nwrite_bytes = 0", ""),
        ("axes = 2\nread_bytes_per_axis = 4\nwrite_bytes_per_axis = 4", ""),
        (
            "axes = 0\nread_bytes = 4\nwrite_bytes_per_axis = 4",
            "group.io.write_bytes_per_axis = 4: makes a payload of 0 bytes: the group has no axes; give write_bytes",
        ),
        (
            "axes = 0\nread_bytes_per_axis = 4\nwrite_bytes = 1",
            "group.io.read_bytes_per_axis = 4: makes a payload of 0 bytes: the group has no axes; give read_bytes",
        ),
        (
            "axes = 3\nread_bytes_per_axis = 0\nwrite_bytes = 0",
            (
                "group.io.write_bytes = 0: makes 0 bytes, and so does what is read: nodes without data have no part in "
                "the cycle; give read_bytes, write_bytes or both"
            ),
        ),
    ],
)
def test_a_group_has_data_whatever_its_axes(payload: str, problem: str) -> None:
    head = TEXT.partition("[payload]")[0].replace("nodes = 2\n", "")
    text = f'{head}[[group]]\nname = "io"\nnodes = 1\n{payload}\n[group.execution]\n{LINE}\n'
    Path("gantry.toml").write_text(text, encoding="utf-8")
    if not problem:
        (group,) = busplan.load_profile("gantry.toml").node_groups
        keys = group.nodes_key, group.node_key("axes"), group.payload_key("read")
        assert keys == ("group.io.nodes", "group.io.axes", f"group.io.{group.payload.key_of('read')}")
        return
    with pytest.raises(busplan.BusplanError) as caught:
        busplan.load_profile("gantry.toml")
    assert [message.partition(": ")[2] for message in caught.value.problems] == [problem]


def test_nodes_are_alike_or_in_groups_and_not_both() -> None:
    group = f'[[group]]\nname = "io"\nnodes = 1\naxes = 1\nread_bytes = 4\nwrite_bytes = 4\n[group.execution]\n{LINE}\n'
    text = TEXT.format(payload="read_bytes = 4\nwrite_bytes = 4", execution=LINE) + group
    Path("gantry.toml").write_text(text + group, encoding="utf-8")
    with pytest.raises(busplan.BusplanError) as caught:
        busplan.load_profile("gantry.toml")
    own = "each [[group]] has its own; remove one of the two"
    assert [message.partition(": ")[2] for message in caught.value.problems] == [
        "bus.nodes = 2: this profile has groups; set group.NAME.nodes instead",
        f"payload: {own}",
        f"node: {own}",
        'group[1].name = "io": there is a group of this name',
    ]


def test_one_direction_may_have_no_data_and_both_may_not() -> None:
    table = 'kind = "table"\npayload_bytes = [4, 16]\ntime_us = [36.7, 36.3]'
    assert profile("read_bytes_per_axis = 4\nwrite_bytes = 0", table)
    (message,) = refused("read_bytes_per_axis = 0\nwrite_bytes = 0")
    assert "payload.write_bytes = 0: makes 0 bytes, and so does what is read" in message


def test_a_table_must_hold_what_all_axes_make() -> None:
    table = 'kind = "table"\npayload_bytes = [4, 16]\ntime_us = [36.7, 36.3]'
    assert profile("read_bytes_per_axis = 4\nwrite_bytes = 4", table)
    (message,) = refused("read_bytes_per_axis = 5\nwrite_bytes = 4", table)
    assert "payload.read_bytes_per_axis = 5: makes 20 bytes, which is outside the execution table, 4 to 16" in message


def test_a_sweep_over_the_axes_is_what_each_profile_gives() -> None:
    own = profile("read_bytes = 4\nread_bytes_per_axis = 8\nwrite_bytes_per_axis = 6")
    swept = busplan.sweep(own, vary={"node.axes": range(1, 7)}, timing_model="standard")["required_us"].tolist()
    assert swept == [standard(busplan.load_profile(own, changes={"node.axes": n})).required_us for n in range(1, 7)]
    assert len(set(swept)) == 6


def test_explain_starts_from_the_payload_of_an_axis() -> None:
    own = profile("read_bytes_per_axis = 8\nwrite_bytes = 12")
    (one,) = busplan.explain(own, "required_us").derivations
    names = {given.name for given in one.inputs}
    assert {"payload.read_bytes_per_axis", "payload.write_bytes", "node.axes"} <= names
    assert "payload.read_bytes" not in names
    assert "node.axes" not in {
        given.name for given in busplan.explain(busplan.load_profile("paper-4ms"), "required_us").derivations[0].inputs
    }


def test_a_plan_cuts_what_each_axis_adds() -> None:
    own = profile("read_bytes_per_axis = 100\nwrite_bytes = 400")
    short = busplan.load_profile(own, changes={"cycle.period_us": 800.0, "bus.cycle_master": False})
    assert busplan.capacity(short).verdict == "not shown to fit"
    # 80 bytes for each of four axes are the other 320.
    found = busplan.plan(short, free=["payload"]).recommended_changes
    assert found == {"payload.read_bytes_per_axis": 80, "payload.write_bytes": 320}
    assert busplan.capacity(busplan.load_profile(short, changes=found)).verdict == "fits"
    more = {"payload.read_bytes_per_axis": 81, "payload.write_bytes": 324}
    assert busplan.capacity(busplan.load_profile(short, changes=more)).verdict == "not shown to fit"


def test_another_payload_in_latency_is_the_whole_of_it() -> None:
    own = profile("read_bytes_per_axis = 8\nwrite_bytes_per_axis = 8")
    assert {one.payload_bytes for one in busplan.latency(own).transactions} == {32}
    asked = busplan.latency(own, payload_bytes=[12]).transactions
    plain = busplan.latency(profile("read_bytes = 12\nwrite_bytes = 12")).transactions
    assert asked == plain
