"""The picture of `busplan compare`: a curve with a letter for each kind of bus, and this machine."""

from functools import cache

import pytest

import busplan
from busplan.forms.charts import Curves

EACH = pytest.mark.parametrize("name", ["can-servo-8", "dvrk", "gantry-24", "paper-1ms"])


@cache
def compared(name: str) -> busplan.CompareAnswer:
    return busplan.compare(name)


def plot_of(found: busplan.CompareAnswer) -> Curves:
    (panel,) = found.drawing().panels
    assert isinstance(panel.plot, Curves)
    return panel.plot


@EACH
def test_every_point_that_carries_axes_is_drawn_and_says_its_figures(name: str) -> None:
    plot = plot_of(compared(name))
    for machine, curve in zip(compared(name).compared, plot.curves, strict=True):
        assert curve.points == tuple((point.period_us, point.axes) for point in machine.curve if point.axes)
        assert len(curve.words) == len(curve.points)
        assert all(f"{axes:,} ax" in words for (_, axes), words in zip(curve.points, curve.words, strict=True))


@EACH
def test_each_kind_has_a_letter_and_a_colour_of_its_own(name: str) -> None:
    entries = [curve.entry for curve in plot_of(compared(name)).curves]
    assert len({entry.mark for entry in entries}) == len({entry.ink for entry in entries}) == len(entries)
    assert sum("(this profile)" in entry.words for entry in entries) == 1


@EACH
def test_both_scales_are_logarithmic_and_hold_everything(name: str) -> None:
    plot = plot_of(compared(name))
    assert plot.across.is_log
    assert plot.up.is_log
    assert plot.up.low == 1
    places = [point for curve in plot.curves for point in curve.points]
    assert all(plot.across.low <= x <= plot.across.high and 1 <= (y or 0) <= plot.up.high for x, y in places)


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
