"""What a network needs of its period: the smallest one that holds all, and the words for what is missing."""

from collections.abc import Callable
from math import inf
from typing import Any

import pytest

import busplan
from busplan.questions.fit.cure import settings_to_be_carried
from busplan.questions.fit.figures import figures
from busplan.questions.fit.needs import Need, missed_limits, smallest_period, to_be_shown, unmet
from busplan.questions.fit.network import at_period, network_of

Make = Callable[..., busplan.Profile]
LIMITS: dict[str, object] = {"limits": {"min_spare_nodes": 1, "min_spare_axes": 3, "max_utilisation": 0.6}}


@pytest.mark.parametrize("name", ["paper-1ms", "ethercat-servo-8", "sercos3-servo-8", "can-motors-8"])
def test_at_the_smallest_period_all_holds_and_below_it_something_does_not(name: str) -> None:
    asked = network_of(busplan.load_profile(name, changes=LIMITS))
    free = network_of(busplan.load_profile(name, changes={"limits": {}}))
    least, fastest = smallest_period(asked), smallest_period(asked, is_safe=False, with_limits=False)
    assert least.us is not None
    assert fastest.us is not None
    at = at_period(asked, least.us)
    assert (unmet(at), missed_limits(at)) == ([], ())
    assert unmet(at_period(asked, least.us * (1 - 1e-6)))
    # Its own period plays no part.
    assert smallest_period(at_period(asked, 7 * least.us)).us == least.us
    # The fastest one asks for no [limits], and the verdict there is that the cycle fits.
    assert fastest == smallest_period(free, is_safe=False, with_limits=False)
    assert fastest.us <= least.us
    fit = figures(at_period(free, fastest.us), model=free.bus.deciding_model)
    assert fit.verdict == "fits"


def test_each_constraint_asks_for_a_slice_or_for_a_period() -> None:
    # The slowest drive takes 480.9 us, SYNC0 in the middle of a period comes too early in one below 668.3 us.
    network = network_of(busplan.load_profile("ethercat-servo-8", changes={"cycle.period_us": 300.0}))
    time, node, sync0 = to_be_shown(network)
    assert (time.key, time.least_us, time.why) == ("time", 0.0, "")
    assert (node.key, node.slice_us, round(node.least_us, 1)) == ("node", 0.0, 480.9)
    assert (sync0.key, sync0.slice_us, round(sync0.least_us, 1)) == ("sync0", 0.0, 668.3)
    assert unmet(network) == [node, sync0]
    assert unmet(at_period(network, 500.0)) == [sync0]
    # Its own period plays no part.
    assert list(to_be_shown(at_period(network, 4000.0))) == [time, node, sync0]
    # A slice is a share of the period, a period is not.
    assert (time.period_us(0.5), node.period_us(0.5)) == (2 * time.slice_us, node.least_us)


@pytest.mark.parametrize(
    ("need", "words"),
    [
        (
            Need(100.0, "time"),
            "the cycle needs a slice of 100.000 us to be shown to fit, and at most 75.000 us can be given",
        ),
        (Need(100.0, "load"), "load needs a slice of 100.000 us, and at most 75.000 us can be given"),
        (Need(100.0, "load", least_us=200.0), "load needs a slice of 100.000 us, and at most 75.000 us can be given"),
        (Need(100.0, "load", least_us=201.0), "load needs a period of 201.000 us, and 150.000 us is the longest"),
        (Need(inf, "hops", "too many hops", inf), "too many hops"),
    ],
)
def test_a_need_in_words_at_half_a_period_of_150_us(need: Need, words: str) -> None:
    assert need.words(ratio=0.5, most_us=150.0) == words


HOPS = "20 hops are over the 16 of one bus (a tree with bus.max_hops = 16 or less has room for 62 nodes)"
GAP = (
    "gap count 3 is unsafe for 2 hops (2 nodes); the smallest safe one is 7 (no gap count is known to be safe for "
    "cables over 4.5 m)"
)


@pytest.mark.parametrize(
    ("changes", "key", "why"),
    [
        ({"bus__nodes": 20}, "hops", HOPS),
        # The first of two that no period mends is told.
        ({"bus__nodes": 20, "bus__gap_count": 3}, "hops", HOPS),
        ({"bus__gap_count": 3}, "gap table", GAP),
    ],
)
def test_what_no_period_mends_is_the_reason(make: Make, changes: dict[str, Any], key: str, why: str) -> None:
    network = network_of(make(**changes))
    *_, last = to_be_shown(network)
    assert (last.key, last.why, last.period_us(1.0)) == (key, why, inf)
    assert [need.key for need in to_be_shown(network)] == ["time", key]
    least = smallest_period(network)
    assert (least.us, least.need.why) == (None, why)
    if key == "gap table":
        # Nobody asked for a safe bus: then it is a matter of time alone.
        assert [need.key for need in to_be_shown(network, is_safe=False)] == ["time"]
        assert smallest_period(network, is_safe=False).us is not None


def room(key: str, nodes: str, us: str, most: str) -> str:
    needed = f"the cycle needs a slice of {us} us to be shown to fit, and at most {most} us can be given"
    return f"limits.{key} asks for room for {nodes}: {needed}"


SPARE = "limits.min_spare_nodes"


@pytest.mark.parametrize(
    ("name", "limits", "missed"),
    [
        # 263.320 us are 52.7 % of 500 us; with three nodes the cycle is shown to fit in 407.7 us, with four it is not.
        ("paper-1ms", {"max_utilisation": 0.53, "min_spare_nodes": 1, "min_spare_axes": 4}, []),
        (
            "paper-1ms",
            {"max_utilisation": 0.5, "min_spare_nodes": 2, "min_spare_axes": 5},
            [
                (
                    "limits.max_utilisation",
                    "",
                    "limits.max_utilisation needs a slice of 526.640 us, and at most 500.000 us can be given",
                ),
                (SPARE, "", room("min_spare_nodes", "4 nodes", "543.329", "500.000")),
                # Five axes are on two nodes of four.
                ("limits.min_spare_axes", "", room("min_spare_axes", "4 nodes", "543.329", "500.000")),
            ],
        ),
        (
            "gantry-24",
            {"min_spare_nodes": 2},
            [
                (SPARE, "drives", room("min_spare_nodes", "6 nodes of drives", "1976.861", "1700.000")),
                (SPARE, "tool", room("min_spare_nodes", "3 nodes of tool", "1961.353", "1700.000")),
            ],
        ),
        # Six axes are on two nodes of drives, which have five, and on two of tool, which have four; io has none.
        (
            "gantry-24",
            {"min_spare_axes": 6},
            [
                (
                    "limits.min_spare_axes",
                    "drives",
                    room("min_spare_axes", "6 nodes of drives", "1976.861", "1700.000"),
                ),
                ("limits.min_spare_axes", "tool", room("min_spare_axes", "3 nodes of tool", "1961.353", "1700.000")),
            ],
        ),
        (
            "paper-1ms",
            {"max_utilisation": 0.0},
            [("limits.max_utilisation", "", "limits.max_utilisation = 0 leaves no time")],
        ),
        (
            "paper-1ms",
            {"min_spare_nodes": 18},
            [(SPARE, "", f"{SPARE} asks for room for 20 nodes: 20 hops are over the 16 of one bus")],
        ),
    ],
)
def test_a_limit_that_is_missed_says_what_it_takes(
    name: str, limits: dict[str, Any], missed: list[tuple[str, str, str]]
) -> None:
    network = network_of(busplan.load_profile(name, changes={"limits": limits}))
    assert [tuple(one) for one in missed_limits(network)] == missed


@pytest.mark.parametrize(
    ("changes", "setting"),
    [
        ({}, {}),
        # However short the period is: some slice carries it.
        ({"cycle__period_us": 1.0, "cycle__slice_ratio": 0.01}, {}),
        ({"bus__gap_count": 3}, {"bus.gap_count": 7}),
        # No setting is safe for longer cables, and none carries more hops.
        ({"bus__gap_count": 3, "bus__cable_length_m": 10.0}, {}),
        ({"bus__gap_count": 3, "bus__nodes": 17}, {}),
    ],
)
def test_a_network_that_no_slice_carries_has_the_cheapest_setting_that_does(
    make: Make, changes: dict[str, Any], setting: dict[str, Any]
) -> None:
    assert settings_to_be_carried(network_of(make(**changes))) == setting
