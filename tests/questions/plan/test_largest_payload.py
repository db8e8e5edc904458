"""The largest payload that a plan names, against larger ones, on random profiles of every kind of bus."""

from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from busplan.buses import kind_names
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.fit.certainty import FITS
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.constraints import keeps_limits, refused_period, with_payload_within
from busplan.questions.plan.planning import plan
from busplan.questions.plan.search import Search
from busplan.sections.profile import Profile

SOME = settings(max_examples=3)


@pytest.mark.parametrize("kind", kind_names())
@SOME
@given(data=st.data())
def test_it_is_good_and_no_larger_one_is(
    kind: str, data: st.DataObject, profiles_by_kind: Mapping[str, st.SearchStrategy[Profile]]
) -> None:
    own = data.draw(profiles_by_kind[kind])
    payloads = bus_of(own).payloads(network_of(own))
    most, step = payloads.most_bytes, payloads.step_bytes
    nodes = own.alike_nodes[0]
    if own.group or nodes.payload.follows_axes or most < 4 * step:
        return
    # Times that rise, fall or do both; two of a node's transactions take the longest one's share of the slice.
    given_us = own.cycle.period_us * own.cycle.slice_ratio / nodes.nodes
    times_us = [share * given_us / 2 for share in data.draw(st.permutations([0.0, 0.05, 0.3, 1.0]))]
    table = {"kind": "table", "payload_bytes": [1, 2 * step, most // 2, most], "time_us": times_us}
    both = {"payload.read_bytes": step, "payload.write_bytes": step, "node.execution": table}
    goal = override(own, both)

    def is_good(size: int) -> bool:
        profile = override(goal, {"payload.read_bytes": size, "payload.write_bytes": size})
        found = figures(profile, model=bus_of(profile).deciding_model)
        at_period = keeps_limits(network_of(profile)) and not refused_period(profile)
        return bool(found.verdict == FITS and found.safe and at_period)

    said = [one.changes for one in plan(goal, free=[]).options if one.title == "largest payload"]
    largest = int(said[0].get("payload.read_bytes", step)) if said else 0
    assert not largest or is_good(largest)
    above = range(largest + step, most + 1, step)
    if above:
        assert not any(map(is_good, {above[0], *data.draw(st.lists(st.sampled_from(above), max_size=4))}))


RING = {
    "bus": {"kind": "sercos2", "data_rate_mbit_s": 16, "at_gap_us": 5.0, "nodes": 4},
    "payload": {"read_bytes": 1_000_000, "write_bytes_per_axis": 31},
    "node.axes": 1_000_000,
}


@pytest.mark.parametrize("free", [None, ["payload", "nodes", "period"]])
def test_payloads_of_any_size_are_not_tried_one_by_one(free: list[str] | None, monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    def counted(*arguments: Any, **options: Any) -> Any:
        tried.append(arguments)
        return with_payload_within(*arguments, **options)

    monkeypatch.setattr("busplan.questions.plan.freedoms.with_payload_within", counted)
    plan(override(load("sercos2-servo-8").profile, RING), free=free)
    assert len(tried) < 3000


@pytest.mark.parametrize("own", [8, 12, 400])
def test_a_payload_is_the_largest_that_is_in_time(own: int) -> None:
    profile = override(
        load("paper-1ms").profile,
        {
            "cycle.period_us": 900.0,
            "payload": {"read_bytes": own, "write_bytes": own},
            "node.execution": {"kind": "linear", "base_us": 20.0, "per_byte_us": 0.4},
        },
    )
    best = plan(profile, free=["payload"]).recommended
    assert best is not None

    def is_good(size: int) -> bool:
        sized = override(profile, {"payload.read_bytes": size, "payload.write_bytes": size})
        return figures(sized, model="standard").verdict == FITS

    good = [size for size in range(4, own + 1, 4) if is_good(size)]
    assert network_of(best.profile).largest_payload_bytes == max(good)


def test_many_places_are_tried_in_a_row_then_in_strides_and_the_last_always() -> None:
    search = Search(load("paper-1ms").profile, max_circles=5)
    assert list(search.in_strides(range(6, 0, -1))) == [6, 5, 4, 3, 2, 1]
    assert search.proven
    assert list(search.in_strides(range(100))) == [0, 1, 2, 3, 4, 6, 10, 18, 34, 66, 99]
    assert not search.proven
    assert len(list(search.in_strides(range(10**9)))) < 40
    assert list(search.in_strides([])) == []
