"""A sweep is capacity, point by point: what switches a part on or off does so at each point for itself."""

from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_names
from busplan.profile.kinds import cycle_keys
from busplan.questions.fit.grid import Grid
from busplan.questions.sweep.table import chunks
from busplan.sections.base import value_at
from tests.registers import shipped_of_each_kind

COUNTS = ("max_nodes", "max_axes", "limited_by", "safe_nodes", "safe_axes", "safe_limited_by")
GROUPS: Mapping[str, Any] = {
    "schema_version": 1,
    "name": "test",
    "bus": {"kind": "ethercat", "mailbox_polls": 1, "distributed_clocks": True},
    "cycle": {"period_us": 9500.0},
    "group": [
        {
            "name": name,
            "nodes": nodes,
            "axes": 1,
            "read_bytes": size,
            "write_bytes": 0,
            "every": every,
            "execution": {"kind": "linear", "base_us": 5.0, "per_byte_us": 0.1},
        }
        for name, nodes, size, every in (("first", 2, 8, 1), ("second", 3, 1480, 1), ("third", 5, 46, 8))
    ],
}


def loaded(data: Mapping[str, Any], folder: Path) -> busplan.Profile:
    path = folder / "test.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    return busplan.load_profile(path)


def with_values(profile: busplan.Profile, key: str, values: list[float]) -> list[float]:
    """Those of some values that a profile may have, each once."""
    taken = []
    for value in dict.fromkeys(values):
        try:
            busplan.load_profile(profile, changes={key: value})
        except busplan.BusplanError:
            continue
        taken.append(value)
    return taken


def require_points(profile: busplan.Profile, vary: Mapping[str, list[float]]) -> None:
    for row in busplan.sweep(profile, vary=vary).to_dict()["rows"]:
        point = busplan.load_profile(profile, changes={key: row[key] for key in vary})
        (result,) = busplan.capacity(point, timing_model=row["timing_model"]).results
        figures = result.by_key()
        if result.groups:
            # Counts of the whole are those of the group that varies, beside the others.
            figures = {key: value for key, value in figures.items() if key not in COUNTS}
            figures |= {f"group.{group.name}.{key}": getattr(group, key) for group in result.groups for key in COUNTS}
        for key, value in figures.items():
            assert row[key] == (pytest.approx(value, rel=1e-9, abs=1e-9) if isinstance(value, float) else value), key


@pytest.mark.slow
@pytest.mark.parametrize("kind", kind_names())
@given(data=st.data())
def test_every_figure_of_a_row_is_that_of_its_point(
    kind: str, data: st.DataObject, profiles_by_kind: Mapping[str, st.SearchStrategy[busplan.Profile]]
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    values = {key: value_at(profile, key) for key in cycle_keys(profile)}
    keys = [(key, value) for key, value in values.items() if type(value) in (int, float)]
    key, value = data.draw(st.sampled_from(keys))
    some = with_values(profile, key, [0, 1, 3, value])
    if len(some) > 1:
        require_points(profile, {key: some})


@pytest.mark.slow
@pytest.mark.parametrize("name", [*dict.fromkeys((*shipped_of_each_kind(), "dynamixel-arm-14"))])
def test_every_key_can_be_swept(name: str) -> None:
    profile = busplan.load_profile(name)
    for key in cycle_keys(profile):
        value = value_at(profile, key)
        given = [] if value is None else [value]
        some = [] if isinstance(value, str | bool) else with_values(profile, key, [0, 1, 3, *given])[-2:]
        table = key.rpartition(".")[0]
        if len(some) > 1 and value_at(profile, table) is None:
            with pytest.raises(busplan.BusplanError, match=f"the profile has no table {table}"):
                require_points(profile, {key: some})
        elif len(some) > 1:
            require_points(profile, {key: some})


@pytest.mark.parametrize(("polls", "model"), [([0, 1], None), ([2, 0], "TwinCAT")])
def test_the_last_frame_comes_again_where_no_mailbox_is_asked(
    tmp_path: Path, polls: list[float], model: str | None
) -> None:
    data = {**GROUPS, "bus": {**GROUPS["bus"], **({"master": model} if model else {})}}
    require_points(loaded(data, tmp_path), {"bus.mailbox_polls": polls})


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [[0, 8], [0, 1480, 3]])
def test_the_first_device_with_data_shares_the_first_frame(tmp_path: Path, sizes: list[float]) -> None:
    require_points(loaded(GROUPS, tmp_path), {"group.first.read_bytes": sizes, "group.third.every": [1, 8]})


@given(sizes=st.lists(st.integers(1, 5), min_size=1, max_size=4), most=st.integers(1, 40))
def test_chunks_are_the_grid_in_its_order_and_no_larger_than_asked(sizes: list[int], most: int) -> None:
    grid = Grid({str(place): np.arange(size) for place, size in enumerate(sizes)})
    rows: list[dict[str, object]] = []
    for chunk in chunks(grid, most):
        assert 1 <= prod(chunk.shape) <= most
        columns = [np.broadcast_to(values, chunk.shape).ravel().tolist() for values in chunk.values.values()]
        rows += (dict(zip(chunk.values, row, strict=True)) for row in zip(*columns, strict=True))
    assert rows == [*grid.each_point()]
    assert grid.points == len(rows) == prod(sizes)
