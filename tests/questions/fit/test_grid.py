"""Figures over a grid, in arrays or not, are those of each setting alone: of every kind, for each question."""

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_names
from busplan.forms.blocks import Card
from busplan.questions.fit.figures import capacity_figures, figures
from busplan.questions.fit.grid import Grid, capacities, fits_at, points_of, require_few_tables
from busplan.questions.fit.network import model_names, network_of
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


# --- the engine itself, on a few points ---------------------------------------------------------------------------

GRIDS: dict[str, dict[str, list[object]]] = {
    # A word, a number and the nodes: points of a word stand in an array.
    # And one of two timing models cannot express a retry.
    "paper-1ms": {"bus.gap_count": [63, "optimal"], "cycle.retries": [0, 2], "bus.nodes": [1, 9]},
    "sercos3-servo-8": {"bus.version": ["V1.0", "V1.1"], "cycle.period_us": [250, 500], "bus.nodes": [3, 60]},
    # A truth value is no number.
    "ethercat-servo-8": {"bus.distributed_clocks": [False, True], "cycle.period_us": [800, 1000]},
    # Responses are searched, point by point.
    "can-servo-8": {"bus.nodes": [3, 8]},
}


def grid_of(axes: Mapping[str, list[object]]) -> Grid:
    return Grid({key: np.array(values, dtype=object) for key, values in axes.items()})


@pytest.mark.parametrize("name", GRIDS)
def test_each_point_has_the_figures_of_its_network_alone(name: str) -> None:
    network = network_of(busplan.load_profile(name))
    grid = grid_of(GRIDS[name])
    possible, refused = points_of(network, grid)
    assert refused == {}
    assert [point.changes for point in possible.values()] == [*grid.each_point()]
    points = [*possible.values()]
    together = capacities(network, points)
    decided = fits_at(points, model=network.bus.deciding_model)
    for point, found, fit in zip(points, together, decided, strict=True):
        alone = network_of(busplan.load_profile(name, changes=point.changes))
        assert [of_model.timing_model for of_model in found] == [*model_names(alone)]
        for of_model in found:
            assert of_model.values() == capacity_figures(alone, model=of_model.timing_model).values()
        assert fit.values() == figures(alone, model=network.bus.deciding_model).values()


def test_axes_are_those_of_whole_nodes_beside_the_others() -> None:
    """Drives of five axes each, beside the tool, which has four, or five as well."""
    network = network_of(busplan.load_profile("gantry-24"))
    possible, refused = points_of(network, grid_of({"axes": [4, 9, 10, 14, 15.5], "group.tool.axes": [4, 5]}))
    found = {
        (point.changes["group.tool.axes"], point.network.axes): point.changes["group.drives.nodes"]
        for point in possible.values()
    }
    assert found == {(4, 9): 1, (4, 14): 2, (5, 10): 1}
    assert refused[0] == "axes = 4: no whole number of nodes, with 5 axes each beside 4 others"
    assert refused[3] == "axes = 9: no whole number of nodes, with 5 axes each beside 5 others"
    assert sorted({*possible, *refused}) == [*range(10)]
    assert len(refused) == 7
    _, alike = points_of(network_of(busplan.load_profile("paper-1ms")), grid_of({"axes": [0, 4, 6, 8]}))
    assert alike == {
        place: f"axes = {axes}: no whole number of nodes, with 4 axes each" for place, axes in ((0, 0), (2, 6))
    }


def test_settings_of_many_groups_are_refused_with_how_many_there_may_be() -> None:
    network = network_of(busplan.load_profile("gantry-24"))  # three groups
    require_few_tables(network, settings=10, most=30)
    with pytest.raises(busplan.BusplanError) as caught:
        require_few_tables(network, settings=1100, most=3000)
    said = "1,100 settings of 3 groups and messages take too long: give values for up to 1,000 settings"
    assert caught.value.problems == (said,)
    # Drives that are alike are one table, and each of three messages is another.
    require_few_tables(network_of(busplan.load_profile("can-servo-8")), settings=10, most=40)
    with pytest.raises(busplan.BusplanError, match="10 settings of 4 groups and messages"):
        require_few_tables(network_of(busplan.load_profile("can-servo-8")), settings=10, most=39)
