"""The answer of `busplan compare`: sentences, table, document and rows."""

import csv
import re
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan.forms import render

BOTH = ("ieee1394", "can")
INPUTS = busplan.load_profile("gantry-24", changes={"group.io.read_bytes": 40})
"""Without axes, no PDO of its own takes bytes from it."""
GANTRY = busplan.compare(INPUTS, buses=BOTH)
PAPER = busplan.compare("paper-1ms", buses=BOTH)


def lines_of(answer: busplan.CompareAnswer) -> list[str]:
    """The whole answer."""
    return render(answer.report()._replace(is_whole=True), "table").splitlines()


def row(answer: busplan.CompareAnswer, start: str) -> list[str]:
    # A setting that makes the period the smallest may follow the name.
    return next(line for line in lines_of(answer) if line.startswith((f"{start}  ", f"{start} (smallest"))).split()


def test_the_first_lines_say_where_it_fits_and_which_kind_is_best() -> None:
    assert lines_of(PAPER)[:4] == [
        "paper-1ms at 1 ms: fits on IEEE 1394, its own bus; with assumed values of other buses, shown to fit on none.",
        "The smallest period is 552.494 us on IEEE 1394.",
        "The most axes at 1 ms are 12 on IEEE 1394.",
        "On other kinds of bus the machine has the bus of a new profile, with assumed values.",
    ]
    assert lines_of(busplan.compare(INPUTS, buses="can"))[:2] == [
        "gantry-24 at 2 ms: with assumed values of other buses, shown to fit on none.",
        "Axes are counted with more nodes of drives, with the other groups unchanged.",
    ]


def test_a_row_has_the_verdict_margin_smallest_period_axes_and_the_largest_term() -> None:
    own = "IEEE 1394, as it is 552.494 12 time fits 230 +/- 6 execution -"
    # The host keeps its half of the period on CAN, too.
    assert not re.search("execution|assumed  ", str(PAPER).partition("\n\n")[2].partition("\n\n")[0])
    new = "bus.bit_rate_kbit_s = 1000, bus.pipeline_cycles = 1, 10 defaults"
    assert " ".join(row(PAPER, "IEEE 1394, as it is")) == own
    assert " ".join(row(PAPER, "CAN")) == f"CAN 2266.597 0 time does not fit -548 +/- 85 feedback {new}"
    assert row(GANTRY, "CAN")[1:3] == ["-", "0"]


def test_a_kind_whose_host_is_assumed_is_not_ranked() -> None:
    found = busplan.compare("paper-1ms", buses=["ieee1394", "ethercat"])
    assert lines_of(found)[1:4] == [
        "The smallest period is 552.494 us on IEEE 1394.",
        "The most axes at 1 ms are 12 on IEEE 1394.",
        "Not ranked, because the host's time is assumed: EtherCAT (bus.master_us = 40).",
    ]
    own, other = found.to_dict()["buses"]
    assert (own["assumed_host"], other["assumed_host"]) == ([], ["bus.master_us"])
    assert other["smallest_period_us"] < own["smallest_period_us"]
    assert "bus.master_us = 40" in " ".join(row(found, "EtherCAT"))


@pytest.mark.parametrize(
    ("changes", "keys"),
    [({}, ["bus.master_us"]), ({"bus.master_grade": "measured"}, []), ({"bus.master_us": 0}, [])],
)
def test_a_host_that_the_profile_itself_assumes_is_not_ranked_either(
    changes: dict[str, object], keys: list[str]
) -> None:
    own = busplan.load_profile("ethercat-servo-8", changes=changes)
    found = busplan.compare(own, buses="ethercat")
    lines = lines_of(found)
    assert found.to_dict()["buses"][0]["assumed_host"] == keys
    assert any(line.startswith("The smallest period is ") for line in lines) == (not keys)
    assert any("Not ranked" in line and "EtherCAT (bus.master_us = 40)" in line for line in lines) == bool(keys)


def test_what_is_left_out_untested_and_in_the_way_is_said_of_each_kind() -> None:
    hindrance, note = [line for line in lines_of(GANTRY) if line.startswith("CAN: ")]
    assert hindrance in str(GANTRY).splitlines()
    assert note not in str(GANTRY)
    said = "At 2 ms a PDO of 40 bytes is over the 32 bytes of four frames; the bus load with the longest bits is 372.0%"
    assert said in hindrance
    assert "No period is shown to fit: a PDO of 40 bytes" in hindrance
    left_out = "bus.speed, bus.gap_count, bus.charge_hops, bus.root, bus.cycle_master, group.io.write_response"
    assert f"Left out on CAN: {left_out}." in lines_of(GANTRY)
    assert "Execution times are assumed to be as long as on IEEE 1394; here they are: from SYNC to a queued" in note
    assert "Checked against lengths of classical frames (2 sizes), " in note
    assert note.endswith("; never measured: the cycle.")
    reset = "After a bus reset, with bus.gap_count = 63 until it is set again, the verdict is: not shown to fit."
    assert any(line.startswith(f"IEEE 1394: {reset}") for line in lines_of(GANTRY))
    assert [one["verdict_after_reset"] for one in GANTRY.to_dict()["buses"]] == ["not shown to fit", None]
    assert not [line for line in lines_of(PAPER) if line.startswith("IEEE 1394: After")]
    broadcasts = busplan.compare("dvrk", buses=BOTH)
    assert any("; no execution time is in the cycle of IEEE 1394 as this" in line for line in lines_of(broadcasts))


def test_a_cycle_without_execution_times_says_so() -> None:
    found = busplan.compare("paper-1ms", buses="ethercat")
    assert [line for line in lines_of(found) if line.startswith("EtherCAT: No execution time is in its cycle.")]
    own = busplan.compare("ethercat-servo-8", buses=["ethercat", "ieee1394"])
    assert not [line for line in lines_of(own) if "No execution time" in line]
    assert [line for line in lines_of(own) if "; no execution time is in the cycle of EtherCAT as this" in line]


def test_assumed_are_the_values_of_a_new_profile_and_the_defaults() -> None:
    assert sum(line.endswith("new profile") for line in lines_of(PAPER)) == 2
    assert sum(line.endswith("  default") for line in lines_of(PAPER)) == 10
    said = "Not shown: what each kind leaves out, assumes and was checked against. to_dict() has all figures."
    assert str(PAPER).splitlines()[-1] == said
    assert sum(one["source"] == "default" for one in PAPER.to_dict()["buses"][1]["assumed"]) == 10
    assert not [line for line in lines_of(busplan.compare("paper-1ms", buses="ieee1394")) if "Assumed" in line]


def test_the_document_has_the_same_keys_for_every_kind() -> None:
    for found in (GANTRY, PAPER):
        document = found.to_dict()
        assert (document["schema"], document["command"]) == (1, "compare")
        assert [one["kind"] for one in document["buses"]] == list(BOTH)
        assert len({tuple(one) for one in document["buses"]}) == 1
    own, can = PAPER.to_dict()["buses"]
    assert (own["is_own"], own["assumed"], own["left_out"]) == (True, [], [])
    assert can["assumed"][0] == {"key": "bus.bit_rate_kbit_s", "value": 1000, "source": "new profile"}
    assert GANTRY.to_dict()["group"] == "drives"


def test_a_kind_that_cannot_have_it_is_a_row_with_the_reason(tmp_path: Path) -> None:
    long = busplan.load_profile("ethercat-servo-8", changes={"node.cable_length_m": 100.0})
    found = busplan.compare(long, buses=["ethercat", "ieee1394"])
    assert row(found, "IEEE 1394") == ["IEEE", "1394", *"---", "not", "compared", *"---"]
    assert any(line.startswith("IEEE 1394 cannot have this machine: bus.gap_count: ") for line in lines_of(found))
    own, other = found.to_dict()["buses"]
    assert own.keys() == other.keys()
    assert (other["verdict"], len(other["why_not"])) == (None, 1)
    assert rows_of(found, tmp_path)[1]["verdict"] == ""
    alone = busplan.compare(long, buses="ieee1394")
    none = "ethercat-servo-8 at 1 ms: with assumed values of other buses, shown to fit on none."
    assert lines_of(alone)[0] == none
    with pytest.raises(busplan.BusplanError, match="there is nothing to draw"):
        alone.drawing()


def rows_of(answer: busplan.CompareAnswer, folder: Path) -> list[dict[str, Any]]:
    answer.save(folder / "rows.csv")
    return [*csv.DictReader((folder / "rows.csv").read_text(encoding="utf-8").splitlines())]


def test_a_bus_without_the_wake_up_of_the_host_says_so() -> None:
    said = "Without the host's wake-up, bus.sync_jitter_us: SERCOS I and II."
    for jitter_us in (0, 780):
        profile = busplan.load_profile("can-servo-8", changes={"bus.sync_jitter_us": jitter_us} if jitter_us else {})
        assert (said in str(busplan.compare(profile))) == bool(jitter_us)
