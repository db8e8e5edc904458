"""Capacity: from figures to the lines and tables of the answer."""

import re

import pytest

import busplan
from busplan.forms import render


def paper(**changes: object) -> busplan.Profile:
    """paper-1ms with new values by key, with __ for the dot."""
    return busplan.load_profile("paper-1ms", changes={key.replace("__", "."): value for key, value in changes.items()})


def lines(profile: busplan.Profile) -> dict[str, str]:
    """The lines of the verdict; those of one label by semicolons."""
    said: dict[str, str] = {}
    for line in busplan.capacity(profile).to_dict()["verdicts"][0]["lines"]:
        said[line["label"]] = "; ".join(filter(None, (said.get(line["label"]), line["text"])))
    return said


def test_the_verdict_names_margin_term_limit_and_change() -> None:
    assert lines(paper(cycle__period_us=500)) == {
        "used": "270 us of the 250 that the bus may use, 108 %",
        "short by": "20 us, +/- 6",
        "fastest period": "553 us; 433 us with bus.gap_count = 7",
        "cure": "bus.gap_count = 7, which leaves 46 us",
        "buses": "2 such buses, of 1 node or fewer",
        "waits for": "wire 116 us, nodes 147 us; correction 7 us",
        "largest term": "execution, 147 us",
        "largest doubt": "execution time, +/- 5 us",
        "rests on": "an instant host, cycles without jitter and 4 more",
        "never measured": "a cycle node by node; only its transactions were measured",
        "correction": "6.62 us included in used: measured buses take this much longer than the timing model",
        "checked against": "broadcasts (the dVRK)",
        "paper model": "fits: 207 us of 250; the standard model decides",
    }


def test_a_way_to_more_nodes_is_advised_only_where_none_is_spare() -> None:
    spare, full = lines(paper()), lines(paper(bus__nodes=3))
    assert (spare["room for"], "one more" in spare) == ("1 more node: 3 nodes, 12 axes in all", False)
    assert (full["room for"], full["one more"]) == ("no more nodes", "bus.gap_count = 10, which leaves 76 us")


def test_what_must_stay_free_is_said() -> None:
    assert lines(paper(cycle__period_us=550))["free"] == "5 us, +/- 6"
    assert lines(paper(cycle__period_us=600, limits__reserve=0.15))["free"] == "30 us, +/- 6; 45 must stay free"


def test_an_execution_that_no_answer_puts_on_the_bus_is_not_spoken_of() -> None:
    off = paper(node__read_response="concatenated", node__write_response="unified")
    assert "slower execution" not in render(busplan.capacity(off).report()._replace(is_whole=True), "table")
    assert "The execution time behind these figures" not in str(busplan.latency(off))
    on = busplan.load_profile(off, changes={"node.read_response": "split"})
    assert "slower execution" in render(busplan.capacity(on).report()._replace(is_whole=True), "table")
    assert "The execution time behind these figures is derived." in str(busplan.latency(on))


def test_a_bus_reset_is_spoken_of_where_the_cycle_no_longer_fits_after_it() -> None:
    assert lines(paper(bus__gap_count=7, cycle__period_us=500))["bus reset"] == (
        "does not fit while it leaves bus.gap_count = 63"
    )
    # After it the cycle fits, too; it is as after a reset already; it does not fit before either.
    for changes in ({"bus__gap_count": 7}, {}, {"bus__gap_count": 7, "cycle__period_us": 300}):
        profile = paper(**changes)
        assert "bus reset" not in lines(profile)
        assert busplan.capacity(profile).to_dict()["verdicts"][0]["verdict_after_reset"] is None


def test_what_the_paper_cannot_express_is_not_applicable() -> None:
    own = paper(cycle__retries=1, host__transaction_us=5.0)
    said = lines(own)
    assert said["paper model"] == "not applicable: it has no cycle.retries, host.transaction_us"
    assert "an instant host" not in said["rests on"]
    assert [one.timing_model for one in busplan.capacity(own).results] == ["standard"]


def test_an_unsafe_gap_count_and_a_long_cable_are_warned_of() -> None:
    said = lines(paper(bus__gap_count=5, bus__cable_length_m=10))
    assert said["unsafe"] == "gap count"
    assert said["beware"] == (
        "gap count 5 is unsafe for 2 hops (2 nodes); the smallest safe one is 7 for cables of up to 4.5 m; "
        "cables of 10 m are longer than the 4.5 m that the gap-count table holds for"
    )
    assert "beware" not in lines(paper(bus__gap_count=13))
    # No more nodes are spoken of than the gap count is safe for: 8 for three hops.
    said = lines(paper(bus__gap_count=9))
    assert (said["room for"], "beware" in said) == ("1 more node: 3 nodes, 12 axes in all", False)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"bus__nodes": 17, "cycle__period_us": 1e6}, "17 hops are over the 16 of one bus"),
        ({"bus__nodes": 63, "bus__max_hops": 3, "cycle__period_us": 1e6}, "63 nodes are over the 62 of one bus"),
        ({"bus__speed": "S100", "payload__write_bytes": 513}, "a payload of 513 bytes is over the 512 bytes of S100"),
    ],
)
def test_the_verdict_says_which_limit_is_broken(changes: dict[str, object], reason: str) -> None:
    profile = paper(**changes)
    assert busplan.capacity(profile).verdict == "does not fit"
    assert lines(profile)["limit"] == reason


def test_latency_warns_of_hops_gap_count_and_payloads_over_the_limit() -> None:
    over = str(busplan.latency(paper(bus__speed="S100"), payload_bytes=[4, 1024]))
    assert over.endswith("\nWarning: a payload of 1024 bytes is over the 512 bytes of S100.")
    assert over.count("\nfigure ") == 2
    long = str(busplan.latency(paper(bus__nodes=17, bus__gap_count=5)))
    assert "\nWarning: 17 hops are over the 16 of one bus.\n" in long
    assert "\nWarning: gap count 5 is unsafe for 17 hops (17 nodes); the smallest safe one is 46." in long


def test_several_periods_share_a_table_and_what_holds_for_all_is_said_once() -> None:
    report = busplan.capacity(paper(), period_us=[500.0, 1000.0, 550.0]).report()
    text = render(report._replace(is_whole=True), "table")
    assert text.count("\navailable time") == 1
    assert re.search(r" 500 us +500 us +1 ms +1 ms +550 us +550 us\n", text)
    assert re.search(r" standard +paper +standard +paper +standard +paper\n", text)
    assert text.count("  rests on ") == text.count("  largest term ") == 1
    assert text.index(" 550 us ") < text.index("  rests on ")
    # What speaks against a verdict is of its period.
    assert re.findall("fits: 207 us of ([0-9]+)", text) == ["250", "275"]


def test_what_fails_is_marked_where_it_stands_and_the_card_stands_alone() -> None:
    report = busplan.capacity("paper-1ms", period_us=[1000.0, 500.0]).report()
    shown = render(report._replace(is_whole=True), "table").splitlines()
    row = {line[: line.index("  ", 4)].strip(): line for line in shown if line.count("  ") > 2}
    assert [row[name].count(" !") for name in ("corrected margin", "margin", "no limit broken")] == [1, 1, 1]
    assert "does not fit" in row["verdict"]
    assert "!" not in row["verdict"]
    assert shown[-1] == "! fails."
    assert {"hold", "host", "utilisation", "smallest period"} <= set(row)
    for form in ("table", "markdown", "html"):
        alone = render(report, form)
        assert "never measured" in alone
        assert not re.search("corrected margin|checked against|Not shown", alone)
