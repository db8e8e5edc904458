"""The picture of `busplan compare`: a curve with a letter for each kind of bus, and this machine."""

from functools import cache
from typing import Any

import pytest

import busplan

EACH = pytest.mark.parametrize(
    "name",
    ["gantry-24", *(pytest.param(name, marks=pytest.mark.slow) for name in ("can-servo-8", "dvrk")), "paper-1ms"],
)


@cache
def compared(name: str) -> busplan.CompareAnswer:
    return busplan.compare(name)


def plot_of(found: busplan.CompareAnswer) -> Any:
    (panel,) = found.drawing().panels
    return panel.plot


@EACH
def test_every_point_that_carries_axes_is_drawn_and_says_its_figures(name: str) -> None:
    plot = plot_of(compared(name))
    for machine, curve in zip(compared(name).compared, plot.curves, strict=True):
        assert curve.points == tuple((point.period_us, point.axes) for point in machine.curve if point.axes)
        assert len(curve.words) == len(curve.points)
        assert all(f"{axes:,} ax" in words for (_, axes), words in zip(curve.points, curve.words, strict=True))


def test_this_machine_is_a_line_across_and_one_up() -> None:
    across, up = plot_of(compared("paper-1ms")).guides
    assert (across.x, up.y) == (1000, 8)
    assert across.entry == up.entry
    assert across.entry.words == "this machine: 1 ms, 8 axes"


def test_a_machine_that_no_bus_carries_is_drawn() -> None:
    # Inputs of 40 bytes are over the four frames of a PDO, and no axis has one of its own for them.
    inputs = busplan.load_profile("gantry-24", changes={"cycle.period_us": 1.0, "group.io.read_bytes": 40})
    (curve,) = plot_of(busplan.compare(inputs, buses="can")).curves
    assert (curve.points, curve.entry.words) == ((), "CAN: none")
    assert busplan.compare(inputs, buses="can").svg()
