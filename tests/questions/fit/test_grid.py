"""Figures over a grid, in arrays or not, are those of each setting alone: of every kind, for each question."""

from collections.abc import Mapping
from itertools import product
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_names
from busplan.forms.blocks import Card
from tests.registers import at_least

Profiles = Mapping[str, st.SearchStrategy[busplan.Profile]]
PERIOD, RESERVE = "cycle.period_us", "limits.reserve"
SHARES = (1, 2)
"""Periods, as multiples of the profile's own."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", kind_names())
@settings(max_examples=at_least(2))
@given(data=st.data())
def test_map_sweep_and_explore_say_of_each_setting_what_capacity_says(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    group = data.draw(st.sampled_from(profile.node_groups))
    place = profile.node_groups.index(group)
    periods_us = sorted({share * profile.cycle.period_us for share in SHARES})
    # A full bus at each period: one more node needs a change.
    verdicts = busplan.capacity(busplan.load_profile(profile, changes={RESERVE: 0.1}), period_us=periods_us).verdicts
    nodes = sorted({verdict.deciding.counts[place].safe_nodes or 1 for verdict in verdicts})
    x, y, over = {group.nodes_key: nodes}, {PERIOD: periods_us}, {RESERVE: [0.1]}
    answer = busplan.explore(profile, x=x, y=y, over=over)
    rows = iter(busplan.sweep(profile, vary={**over, **y, **x}).to_dict()["rows"])
    for reserve, cards, map_ in zip(over[RESERVE], answer.cards, answer.maps, strict=True):
        with_reserve = busplan.load_profile(profile, changes={RESERVE: reserve})
        assert busplan.map_(with_reserve, x=x, y=y).rows == map_.rows
        cells: list[Any] = [cell for row in map_.rows for cell in row]
        for (us, count), card, cell in zip(product(periods_us, nodes), cards, cells, strict=True):
            try:
                setting = busplan.load_profile(with_reserve, changes={PERIOD: us, group.nodes_key: count})
            except busplan.BusplanError:
                assert card is None
                assert cell in map_.not_drawn
                continue
            alone = busplan.capacity(setting)
            (verdict,) = alone.verdicts
            for result in alone.results:
                row = next(rows)
                figures = result.by_key()
                assert {
                    key: row[key] for key in figures
                } == figures  # bit for bit: the same operations in the same order
            assert [card] == [block for block in alone.report().blocks if isinstance(block, Card)]
            shared = ("nodes", "axes", "verdict", "binding_term", "available_us", "margin_corrected_us")
            for key in (*shared, "uncertainty_us"):
                assert getattr(cell, key) == getattr(verdict.deciding, key), key
            assert cell.is_safe == verdict.deciding.safe
            if cell.state == "fits":
                assert verdict.deciding.verdict == "fits"
                assert verdict.deciding.safe
