"""What a profile may say: strict, frozen and closed; ranges, defaults, and what the sections compute."""

import math
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

import busplan
from busplan.profile.kinds import cycle_keys, default_of, dotted_keys, profile_schema, words_of
from busplan.sections.cycle import time_uncertainty_us
from busplan.sections.profile import varied_nodes

TEXT = """\
schema_version = 1
name = "test"
bus = {kind = "ieee1394", speed = "S400", nodes = 2}
cycle = {period_us = 4000}
payload = {read_bytes = 12, write_bytes = 12}
node = {axes = 4, execution = {kind = "linear", base_us = 30, per_byte_us = 0.35}}
"""
TABLE = {"kind": "table", "payload_bytes": [4, 16, 64], "time_us": [40.0, 34.0, 58.0]}


@cache
def smallest() -> busplan.Profile:
    """A smallest profile."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "test.toml")
        path.write_text(TEXT, encoding="utf-8")
        return busplan.load_profile(path)


def profile(**changes: object) -> Any:
    """A smallest profile with new values by key, two underscores for the dot."""
    return busplan.load_profile(smallest(), changes={key.replace("__", "."): to for key, to in changes.items()})


def value_of(model: Any, key: str) -> object:
    value: object = model
    for name in key.split("__"):
        value = getattr(value, name)
    return value


def refused(**changes: object) -> list[str]:
    """What is said of changes that are refused, without the words on what was changed."""
    with pytest.raises(busplan.BusplanError) as caught:
        profile(**changes)
    return [problem.partition(": ")[2] for problem in caught.value.problems]


def figures(**changes: object) -> dict[str, Any]:
    """Figures of `capacity` by the standard."""
    (found,) = busplan.capacity(profile(**changes), timing_model="standard").results
    return dict(found.by_key())


# --- strictness -------------------------------------------------------------------------------------------

WHOLE = {
    "bus__nodes": (1, 1_000_000),
    "bus__max_hops": (1, 1_000_000),
    "payload__read_bytes": (0, 1_000_000),
    "payload__write_bytes": (0, 1_000_000),
    "payload__overhead_bytes": (0, 1_000_000),
    "node__axes": (1, 1_000_000),
    "bus__gap_count": (0, 63),
    "limits__min_spare_nodes": (0, 1_000_000),
    "limits__min_spare_axes": (0, 1_000_000),
    "cycle__retries": (0, 1_000_000),
    "node__execution__measured_gap_count": (0, 63),
}
TIMES = {
    "cycle__nonperiodic_us": (0, 1e9),
    "cycle__sync__ping_us": (0, 1e9),
    "cycle__sync__ping_per_node_us": (0, 1e9),
    "node__execution__base_us": (0, 1e9),
    "node__execution__per_byte_us": (0, 1e9),
    "node__execution__uncertainty_us": (0, 1e9),
    "node__execution__worst_extra_us": (0, 1e9),
    "host__transaction_us": (0, 1e9),
    "host__uncertainty_us": (0, 1e9),
    # IEEE 1394a, MAX_BUS_HOLD: longer than this between an acknowledge and its response, and the bus is another's.
    "node__response_us": (0, 1.63),
}
SHARES = {"limits__max_utilisation": (0, 1), "limits__reserve": (0, 0.99)}
ABOVE_ZERO = {
    "cycle__period_us": (1e-3, 1e9),
    "cycle__slice_ratio": (1e-6, 1),
    "bus__cable_length_m": (5e-324, 100),
    "bus__phy_delay_us": (5e-324, 10),
}
WORDS = {
    "node__read_response": ("split", "concatenated"),
    "node__write_response": ("split", "unified"),
    "node__execution__residual": ("none", "paper", "standard"),
}
KINDS = {
    *("bus__nodes", "bus__max_hops", "cycle__nonperiodic_us", "limits__max_utilisation", "cycle__period_us"),
    *("name", "bus__speed", "node__execution__kind", "node__execution__grade", "bus", "cycle__sync", "node__execution"),
}
"""One key of each kind of constraint."""


def each(keys: Iterable[str], *values: object) -> Iterator[tuple[str, Any]]:
    """All values with one key of each kind, and the first of them with every key."""
    return ((key, value) for key in keys for value in (values if key in KINDS else values[:1]))


@pytest.mark.parametrize(
    "key", ["", "bus__", "cycle__", "cycle__sync__", "payload__", "node__", "node__execution__", "host__", "limits__"]
)
def test_an_unknown_key_is_refused_in_every_section(key: str) -> None:
    (message,) = refused(**{f"{key}surprise": 1})
    assert message.startswith("unknown key; known here: ")


@pytest.mark.parametrize("key", ["name", "bus__nodes", "cycle__period_us", "cycle__sync__ping_us", "node__axes"])
def test_a_profile_is_frozen(key: str) -> None:
    loaded = profile()
    *tables, last = key.split("__")
    owner = value_of(loaded, "__".join(tables)) if tables else loaded
    with pytest.raises(ValidationError, match="frozen"):
        setattr(owner, last, 1)
    with pytest.raises(ValidationError, match="frozen"):
        delattr(owner, last)


# --- ranges -----------------------------------------------------------------------------------------------


def test_a_range_holds_its_ends_and_nothing_beyond() -> None:
    for key, (low, high) in (WHOLE | TIMES | SHARES | ABOVE_ZERO).items():
        for inside in (low, high):
            assert value_of(profile(**{key: inside}), key) == inside
        step = type(high)(1)
        beyond: tuple[float, ...] = (type(high)(low) - step, high + step)
        if key in ABOVE_ZERO:
            beyond = (0, 0.0, -0.0, math.nextafter(low, -math.inf), math.nextafter(high, math.inf))
        for outside in beyond:
            assert refused(**{key: outside})


@pytest.mark.parametrize(
    "name", ["x", "x" * 100, "größe", "日本", "[bold]x[/]", '"quoted"', "a\\b", "with space", "\U0001f600"]
)
def test_a_name_is_any_printable_text(name: str) -> None:
    assert profile(name=name).name == name


@pytest.mark.parametrize(
    "name", ["", "x" * 101, "a\nb", "a\tb", "\x1b[31m", "\x00", "\x7f", "a\u2028b", "\u202e", "\u200b"], ids=ascii
)
def test_a_name_holds_nothing_that_a_terminal_would_obey(name: str) -> None:
    assert refused(name=name)


def test_a_description_may_have_lines_and_tabs_and_no_other_control() -> None:
    assert profile(description="a\n\tb").description == "a\n\tb"
    assert len(profile(description="x" * 2000).description) == 2000
    assert refused(description="x" * 2001)
    for control in ("\x1b", "\r", "\x00", "\x9b"):
        assert refused(description=f"a{control}b") == ["must not hold control characters"]


# --- defaults ---------------------------------------------------------------------------------------------


def test_defaults_are_those_of_the_reference() -> None:
    loaded = profile()
    assert loaded.description == ""
    assert (loaded.bus.gap_count, loaded.bus.max_hops, loaded.bus.cable_length_m) == (63, None, 4.5)
    assert (loaded.cycle.slice_ratio, loaded.cycle.nonperiodic_us) == (0.5, 0.0)
    assert (loaded.cycle.sync.ping_us, loaded.cycle.sync.ping_per_node_us) == (0.3, 0.1)
    assert loaded.payload.overhead_bytes == 20
    # An OHCI host sends cycle starts; what no bus of the paper has is off.
    assert (loaded.bus.cycle_master, loaded.bus.isochronous_us, loaded.bus.phy_delay_us) == (True, 0.0, None)
    assert (loaded.cycle.retries, loaded.limits.reserve) == (0, 0.0)
    node, execution = loaded.node, loaded.node.execution
    assert (node.read_response, node.write_response, node.response_us) == ("split", "split", 1.63)
    assert (execution.residual, execution.measured_gap_count) == ("none", 63)
    assert (execution.grade, execution.uncertainty_us, execution.worst_extra_us) == (None, None, 0.0)
    assert (loaded.host.transaction_us, loaded.host.uncertainty_us) == (0.0, None)


@pytest.mark.parametrize("key", WORDS)
def test_a_key_of_words_takes_each_of_them_and_no_other(key: str) -> None:
    own = WORDS[key]
    assert [value_of(profile(**{key: word}), key) for word in own] == [*own]
    for word in ("", own[0].upper(), f"{own[0]} ", "both", {"split": "none"}.get(own[0], "split")):
        (message,) = refused(**{key: word})
        assert all(f'"{one}"' in message for one in own)


def test_reads_and_writes_are_not_answered_alike() -> None:
    assert refused(node__read_response="unified")  # nothing would carry the data
    assert refused(node__write_response="concatenated")


def test_isochronous_traffic_needs_a_cycle_master() -> None:
    message = "isochronous traffic follows cycle starts, and cycle_master is false: set bus.cycle_master = true"
    assert refused(bus__isochronous_us=20, bus__cycle_master=False) == [message]
    assert profile(bus__isochronous_us=20, bus__cycle_master=True).bus.isochronous_us == 20
    assert profile(bus__isochronous_us=20).bus.cycle_master
    assert profile(bus__isochronous_us=0, bus__cycle_master=False).bus.isochronous_us == 0
    # It has its place within the 125 us of one cycle start.
    assert profile(bus__isochronous_us=125, bus__cycle_master=True)
    for value in (-1e-9, 125.1, math.inf, math.nan, "20", True, None):
        assert refused(bus__isochronous_us=value, bus__cycle_master=True)


def test_what_is_not_said_of_an_uncertainty_follows_from_the_grade_or_is_a_tenth() -> None:
    by_grade = {"measured": 0.1 / math.sqrt(12), "derived": 1 / math.sqrt(3), "calibrated": 4, None: 4}
    # From none to twice the value, equally likely (JCGM 100, 4.3.7).
    by_grade["assumed"] = 40 / math.sqrt(3)
    for grade, expected in by_grade.items():
        execution = profile(node__execution__grade=grade).node.execution
        assert execution.standard_uncertainty_us(40.0) == pytest.approx(expected)
        said = profile(node__execution__grade=grade, node__execution__uncertainty_us=0.25).node.execution
        assert said.standard_uncertainty_us(40.0) == 0.25
    assert profile(host__transaction_us=5).host.standard_uncertainty_us == 0.5
    assumed = profile(host__transaction_us=5, host__grade="assumed").host
    assert assumed.standard_uncertainty_us == pytest.approx(5 / math.sqrt(3))
    assert profile(host__transaction_us=5, host__uncertainty_us=0).host.standard_uncertainty_us == 0
    assert [
        time_uncertainty_us(40.0, is_guess=guess, given_us=given) for guess in (False, True) for given in (3, None)
    ] == [
        *(3, 4.0),
        *(3, pytest.approx(40 / math.sqrt(3))),
    ]


def test_every_default_is_a_value_that_the_schema_takes() -> None:
    # Pydantic does not check defaults: a wrong one would load.
    loaded = smallest()
    whole = loaded.model_dump()
    sections = ("bus", "cycle", "payload", "node", "servo", "mechanics", "delivery", "circle", "tolerance", "limits")
    assert busplan.load_profile(loaded, changes={name: whole[name] for name in sections}) == loaded


SHIPPED = ("gantry-24", "can-servo-8", "ethercat-servo-8", "sercos3-servo-8")
MESSAGES = """\
schema_version = 1
name = "alone"
bus = {kind = "can", bit_rate_kbit_s = 500}
[[message]]
name = "a"
identifier = 0x181
payload_bytes = 2
period_us = 1000
"""


def defaults_in(schema: dict[str, Any], node: dict[str, Any], parts: list[str]) -> list[object]:
    """Defaults of a key in a JSON Schema, one for each table that may have it."""
    places = [node]
    for part in parts:
        found = []
        while places:
            place = places.pop()
            if "$ref" in place:
                places.append(schema["$defs"][place["$ref"].rpartition("/")[2]])
            places += place.get("anyOf", []) + place.get("oneOf", [])
            if part in place.get("properties", {}):
                found.append(place["properties"][part])
        places = found
    return [place.get("default") for place in places]


def test_the_schema_has_defaults_and_titles_of_the_model() -> None:
    schema = profile_schema()
    of_kinds = {
        choice["if"]["properties"]["bus"]["properties"]["kind"]["const"]: choice["then"] for choice in schema["allOf"]
    }
    for name in SHIPPED:
        loaded = busplan.load_profile(name)
        keys = {key: entry.value for key, entry in dotted_keys(loaded).items() if entry.source == "default"}
        assert len(keys) > 10
        for key, value in keys.items():
            assert default_of(loaded, key) == (list(value) if isinstance(value, tuple) else value)
            if value is not None and not key.startswith(("group", "message")):
                assert value in defaults_in(schema, of_kinds[loaded.bus.kind], key.split(".")), key
        for key in ("schema_version", "cycle.period_us", "bus.kind", "cycle.period_us.x", "nothing.at_all"):
            assert default_of(loaded, key) is None
    titles = {name: part["title"] for name, part in schema["$defs"].items() if name.endswith(("Group", "Section"))}
    assert [name for name, title in titles.items() if title not in name] == []
    assert titles["EthercatGroup"] == titles["GroupSection"] == "Group"
    assert titles["Ieee1394CycleSection"] == "Cycle"


def test_a_cycle_depends_on_keys_of_its_own_and_on_those_of_the_verdict(tmp_path: Path) -> None:
    alike, in_groups = (set(cycle_keys(busplan.load_profile(name))) for name in ("paper-4ms", "gantry-24"))
    verdict = {"limits.reserve", "limits.missed_cycles"}
    assert alike >= {"bus.nodes", "cycle.period_us", "node.axes", "payload.read_bytes", "host.transaction_us", *verdict}
    assert in_groups >= {"bus.speed", "group.io.nodes", "group.drives.execution.base_us", *verdict}
    assert not any(key.startswith(("bus.nodes", "node.", "payload.")) for key in in_groups)
    never = ("servo.", "circle.", "tolerance.", "delivery.", "mechanics.", "name", "description", "schema_version")
    for keys in (alike, in_groups):
        assert not any(key.startswith(never) or key.endswith((".name", ".kind")) for key in keys)
        assert {key for key in keys if key.startswith("limits.")} == verdict
        # Nor on what is no number and no word: the columns of a table.
        assert not any(key.endswith(("execution.payload_bytes", "execution.time_us")) for key in keys)
    # A kind of bus may have limits that its cycle depends on.
    of_can = set(cycle_keys(busplan.load_profile("can-servo-8")))
    assert {key for key in of_can if key.startswith("limits.")} == {"limits.max_load", *verdict}
    (tmp_path / "alone.toml").write_text(MESSAGES)
    alone = busplan.load_profile(tmp_path / "alone.toml")
    assert cycle_keys(alone)
    left = of_can - set(cycle_keys(alone))
    assert left >= {"cycle.period_us", "node.axes", "payload.read_bytes", "bus.nodes", *verdict}
    assert not any(key.startswith(("cycle.", "node.", "payload.", "bus.nodes")) for key in cycle_keys(alone))
    assert not any(key.startswith(("cycle.", "node.", "payload.")) for key in dotted_keys(alone))


# --- the bus ----------------------------------------------------------------------------------------------


def test_a_chain_has_as_many_hops_as_nodes_and_a_tree_as_many_as_it_says() -> None:
    assert [figures(bus__nodes=nodes)["hops"] for nodes in (1, 5, 62)] == [1, 5, 62]
    assert [figures(bus__nodes=nodes, bus__max_hops=3)["hops"] for nodes in (1, 5, 62)] == [3, 3, 3]


# From the gap-count table of IEEE 1394a for cables of 4.5 m, by hand.
@pytest.mark.parametrize(
    ("hops", "gap_count"), [(1, 5), (2, 7), (3, 8), (16, 43), (22, 59), (23, 62), (24, 63), (500, 63)]
)
def test_the_optimal_gap_count_follows_the_hops(hops: int, gap_count: int) -> None:
    assert figures(bus__gap_count="optimal", bus__nodes=hops)["gap_count"] == gap_count
    assert figures(bus__gap_count="optimal", bus__nodes=1, bus__max_hops=hops)["gap_count"] == gap_count


def test_the_optimal_gap_count_is_refused_for_cables_the_table_does_not_know() -> None:
    (message,) = refused(bus__gap_count="optimal", bus__cable_length_m=4.6)
    assert "up to 4.5 m" in message
    assert "cable_length_m is 4.6" in message
    assert "give the gap count as a number" in message
    assert profile(bus__gap_count="optimal", bus__cable_length_m=4.5)
    assert profile(bus__gap_count=63, bus__cable_length_m=4.6)


@pytest.mark.parametrize(
    ("speed", "rate_mbit_s", "limit"), [("S100", 98.304, 512), ("S200", 196.608, 1024), ("S400", 393.216, 2048)]
)
def test_a_packet_has_the_rate_and_the_limit_of_its_speed(speed: str, rate_mbit_s: float, limit: int) -> None:
    found: Any = busplan.latency(profile(bus__speed=speed), payload_bytes=[12, 112], timing_model="paper").transactions
    small_us, large_us = (float(one.phases["response_data_us"]) for one in found if one.transaction == "read")
    assert large_us - small_us == pytest.approx(8 * 100 / rate_mbit_s)
    largest = dict.fromkeys(("payload__read_bytes", "payload__write_bytes"), limit)
    assert "payload" not in figures(bus__speed=speed, **largest)["exceeded"]
    assert "payload" in figures(bus__speed=speed, **dict.fromkeys(largest, limit + 1))["exceeded"]


@pytest.mark.parametrize(
    "changes",
    [
        {"bus__nodes": 17},
        {"bus__nodes": 63},
        {"bus__nodes": 1000, "bus__max_hops": 17},
        {"payload__read_bytes": 2049},
        {"payload__write_bytes": 999_999, "bus__speed": "S100"},
    ],
    ids=str,
)
def test_what_breaks_the_standards_limits_loads(changes: dict[str, object]) -> None:
    loaded = profile(**changes)
    for key, value in changes.items():
        assert value_of(loaded, key) == value


# --- the cycle --------------------------------------------------------------------------------------------


def test_the_synchronous_packet_is_a_ping_for_the_paper_and_a_broadcast_for_the_standard() -> None:
    def sync_us(model: str) -> list[Any]:
        cycles = (busplan.capacity(profile(bus__nodes=nodes), timing_model=model).results[0] for nodes in (1, 2, 11))
        return [next(term.us for term in cycle.terms if term.name == "sync") for cycle in cycles]

    assert sync_us("paper") == pytest.approx([0.3, 0.4, 1.3])
    # 20 bytes at 393.216 Mbit/s, arbitration of (4) and the arbitration reset gap of (10) at gap count 63, and twice
    # the hops: the measured ping is propagation, and in them.
    hop_us, gaps_us = 0.023 + 14 / 98.304, 1.63 + (4 * 63 + 53 + 32 * 63) / 98.304
    expected = [160 / 393.216 + gaps_us + 2 * nodes * hop_us for nodes in (1, 2, 11)]
    assert sync_us("standard") == pytest.approx(expected)


# --- execution times --------------------------------------------------------------------------------------


def test_a_linear_execution_time_grows_with_the_payload() -> None:
    execution = profile(node__execution={"kind": "linear", "base_us": 30, "per_byte_us": 0.25}).node.execution
    assert [execution.execution_us(size) for size in (1, 4, 1000)] == [30.25, 31.0, 280.0]


def table(payload_bytes: list[int], time_us: list[float]) -> Any:
    """An execution time by a table; payloads are the first of it, for a profile knows all of its own."""
    execution = {"kind": "table", "payload_bytes": payload_bytes, "time_us": time_us}
    sizes = dict.fromkeys(("payload__read_bytes", "payload__write_bytes"), payload_bytes[-1])
    return profile(node__execution=execution, **sizes).node.execution


def test_a_table_is_exact_at_its_points_and_linear_between_them() -> None:
    execution = table([4, 16, 64], [40.0, 34.0, 58.0])
    assert [execution.execution_us(size) for size in (4, 16, 64)] == [40.0, 34.0, 58.0]
    assert [execution.execution_us(size) for size in (5, 10, 15)] == pytest.approx([39.5, 37.0, 34.5])
    assert [execution.execution_us(size) for size in (17, 40, 63)] == pytest.approx([34.5, 46.0, 57.5])


@given(
    points=st.dictionaries(st.integers(1, 4096), st.floats(0, 1e6), min_size=1, max_size=8),
    share=st.floats(0, 1),
)
def test_between_two_points_a_time_is_between_their_times(points: dict[int, float], share: float) -> None:
    sizes = sorted(points)
    execution = table(sizes, [points[size] for size in sizes])
    for size in sizes:
        assert execution.execution_us(size) == points[size]
    size = round(sizes[0] + share * (sizes[-1] - sizes[0]))
    below = max(known for known in sizes if known <= size)
    above = min(known for known in sizes if known >= size)
    low, high = sorted((points[below], points[above]))
    assert low - 1e-9 * high <= execution.execution_us(size) <= high * (1 + 1e-9)


def test_a_table_covers_its_range_and_nothing_beyond() -> None:
    execution = table([4, 16], [40.0, 34.0])
    assert [execution.covers(size) for size in (3, 4, 5, 16, 17)] == [False, True, True, True, False]
    assert execution.range_bytes == "4 to 16 bytes"


def test_a_table_of_one_point_knows_that_point() -> None:
    execution = table([12], [36.5])
    assert (execution.execution_us(12), execution.covers(11), execution.covers(13)) == (36.5, False, False)


@pytest.mark.parametrize(
    ("payload_bytes", "time_us", "messages"),
    [
        pytest.param(
            [4, 16], [1.0], ["has 1 value and payload_bytes has 2: the two must be of one length"], id="times too few"
        ),
        pytest.param(
            [4], [1.0, 2.0], ["has 2 values and payload_bytes has 1: the two must be of one length"], id="too many"
        ),
        pytest.param([16, 4], [1.0, 2.0], ["payloads must ascend, and this follows 16"], id="descending"),
        pytest.param([4, 4], [1.0, 2.0], ["payloads must ascend, and this follows 4"], id="equal"),
        pytest.param(
            [4, 3, 8, 8],
            [1.0],
            [
                "payloads must ascend, and this follows 4",
                "payloads must ascend, and this follows 8",
                "has 1 value and payload_bytes has 4: the two must be of one length",
            ],
            id="both at once",
        ),
    ],
)
def test_what_is_no_table_is_refused_with_all_its_faults(
    payload_bytes: list[int], time_us: list[float], messages: list[str]
) -> None:
    execution = {"kind": "table", "payload_bytes": payload_bytes, "time_us": time_us}
    found = refused(node__execution=execution)
    assert len(found) == len(messages)
    assert all(map(str.endswith, found, messages))


@pytest.mark.parametrize("key", ["payload_bytes", "time_us"])
def test_a_tables_columns_are_arrays_of_numbers(key: str) -> None:
    values: tuple[object, ...] = ([], ["4"], [True], [-1], [math.nan], [None], [[4]], "44", 4, None, {"a": 4})
    for value in values:
        assert refused(node__execution={"kind": "table", "payload_bytes": [4], "time_us": [4], key: value})


def test_a_tables_payloads_are_whole_and_its_times_need_not_be() -> None:
    assert refused(node__execution={"kind": "table", "payload_bytes": [4.0], "time_us": [4]})
    assert table([4], [4]).time_us == (4.0,)


@pytest.mark.parametrize(
    ("read_bytes", "write_bytes", "count"), [(3, 12, 1), (12, 65, 1), (3, 65, 2), (4, 64, 0), (64, 4, 0)]
)
def test_a_payload_outside_the_table_is_refused_each_with_its_key(
    read_bytes: int, write_bytes: int, count: int
) -> None:
    changes = {"node__execution": TABLE, "payload__read_bytes": read_bytes, "payload__write_bytes": write_bytes}
    if not count:
        assert profile(**changes)
        return
    messages = refused(**changes)
    assert len(messages) == count
    assert all("is outside the execution table, 4 to 64 bytes" in message for message in messages)


def test_a_linear_execution_time_knows_every_payload() -> None:
    assert profile(payload__read_bytes=1_000_000)


def test_a_table_says_what_it_covers_and_refuses_the_rest() -> None:
    known = table([4, 16, 64], [40, 34, 58])
    assert (known.covered_bytes, known.range_bytes) == ((4, 64), "4 to 64 bytes")
    assert [known.covers(size) for size in (3, 4, 64, 65)] == [False, True, True, False]
    with pytest.raises(ValueError, match=r"^65 bytes is outside the execution table, 4 to 64 bytes$"):
        known.execution_us(65)
    linear = smallest().node_groups[0].node.execution
    assert (linear.covered_bytes, linear.covers(0), linear.execution_us(0)) == ((0, math.inf), True, 30)


@pytest.mark.parametrize(
    ("servo", "grades", "words"),
    [
        ({}, ("assumed",), "assumed"),
        ({"grade": "measured"}, ("measured",), "measured"),
        ({"position_gain_per_s": 50, "x": {"drive_lag_us": 9}}, ("assumed", "assumed"), "assumed"),
        (
            # A lag of x, a gain of y, and a grade of each; a default that means none needs none.
            {
                "grade": "calibrated",
                "x": {"drive_lag_us": 9},
                "y": {"position_gain_per_s": 50},
                "grades": {
                    "drive_lag_us": "assumed",
                    "position_gain_per_s": "published",
                    "integral_gain_per_s2": "measured",
                },
            },
            ("assumed", "published"),
            "1 assumed, 1 published",
        ),
        ({"grade": "published", "grades": {"velocity_feedforward": "measured"}}, ("measured",), "measured"),
    ],
)
def test_grades_of_a_servo_are_those_of_what_is_given(servo: Any, grades: tuple[str, ...], words: str) -> None:
    found = profile(servo=servo).servo
    assert found.grades_given == grades
    assert found.grades_text == words
    for axis in ("x", "y"):
        own = {**{key: value for key, value in servo.items() if key == "position_gain_per_s"}, **servo.get(axis, {})}
        keys = found.axis_keys(axis)
        assert keys.items() >= own.items()
        assert {key: keys[key] for key in keys.keys() - own.keys()} == {
            key: value for key, value in smallest().servo.axis_keys(axis).items() if key not in own
        }


def test_the_circle_is_judged_by_the_tolerances_that_are_given() -> None:
    assert not profile(tolerance__min_gain_margin_db=3).tolerance.judges_contour
    judged = profile(tolerance={"circular_deviation_mm": 0.03, "mean_contour_error_mm": 0}).tolerance
    assert judged.judged == ("mean_contour_error_mm", "circular_deviation_mm")
    assert judged.judges_contour


def test_the_nodes_that_vary_are_those_with_the_most_axes() -> None:
    names = [varied_nodes(busplan.load_profile(name)).name for name in ("paper-4ms", "gantry-24")]
    assert names == ["", "drives"]
    more = busplan.load_profile("gantry-24", changes={"group.tool.nodes": 30})
    assert varied_nodes(more).name == "tool"


def test_a_converter_of_one_bit_is_refused() -> None:
    assert refused(servo__dac_bits=1) == ["expected 0 (ideal), or 2 to 32: one bit is a sign and no level"]
    assert [profile(servo__dac_bits=bits).servo.dac_bits for bits in (0, 2, 32)] == [0, 2, 32]


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("bus.cycle_master", ("true", "false")),
        ("node.read_response", ("split", "concatenated")),
        ("bus.gap_count", ("optimal",)),
        ("bus.nodes", ()),
    ],
)
def test_words_that_a_key_takes(key: str, words: tuple[str, ...]) -> None:
    assert words_of(smallest(), key) == words
