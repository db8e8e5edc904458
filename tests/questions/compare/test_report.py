"""The answer of `busplan compare`: sentences, table, document and rows."""

import json
from typing import Any

import pytest

from busplan.buses import kind_named, kind_names
from busplan.forms import ENDINGS, render
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.compare.kinds import KindComparison, compare
from busplan.questions.compare.report import compare_document, compare_records, compare_report

BOTH = ("ieee1394", "can")
INPUTS = override(load("gantry-24").profile, {"group.io.read_bytes": 40})
"""Without axes, no PDO of its own takes bytes from it."""
GANTRY = compare(INPUTS, kinds=BOTH)
PAPER = compare(load("paper-1ms").profile, kinds=BOTH, with_circle=True)


def said(found: KindComparison, *, whole: bool = False) -> list[str]:
    return render(compare_report(found)._replace(is_whole=whole), "table").splitlines()


def row(found: KindComparison, start: str) -> list[str]:
    return next(line for line in said(found) if line.startswith(f"{start}  ")).split()


def plain(found: KindComparison) -> Any:
    return json.loads(json.dumps(compare_document(found), allow_nan=False))


def test_the_first_lines_say_where_it_fits_and_which_kind_is_best() -> None:
    assert said(PAPER)[:4] == [
        "paper-1ms at 1 ms: shown to fit on 1 of 2 kinds of bus: IEEE 1394.",
        "The smallest period is 552.494 us on IEEE 1394.",
        "The most axes at 1 ms are 12 on IEEE 1394.",
        "On another kind than its own the machine has the bus of a new profile, which is assumed.",
    ]
    alone = compare(INPUTS, kinds=["can"])
    assert said(alone)[:2] == [
        "gantry-24 at 1 ms: shown to fit on 0 of 1 kind of bus.",
        "Axes are counted with more nodes of drives, the other groups as they are.",
    ]


def test_a_row_has_the_verdict_margin_smallest_period_axes_and_the_largest_term() -> None:
    own = "IEEE 1394, as it is fits 230.064 6.311 execution 552.494 12 time - PASSED 92.082"
    # The host keeps its half of the period on CAN, too.
    new = "bus.bit_rate_kbit_s = 1000, bus.pipeline_cycles = 1, 7 defaults"
    other = f"CAN does not fit -548.467 14.693 feedback 2126.320 0 time {new} PASSED 75.940"
    assert " ".join(row(PAPER, "IEEE 1394, as it is")) == own
    assert " ".join(row(PAPER, "CAN")) == other
    assert row(GANTRY, "CAN")[6:9] == ["feedback", "-", "0"]


def test_a_kind_whose_host_is_assumed_is_not_ranked() -> None:
    found = compare(load("paper-1ms").profile, kinds=["ieee1394", "ethercat"])
    assert said(found)[1:4] == [
        "The smallest period is 552.494 us on IEEE 1394.",
        "The most axes at 1 ms are 12 on IEEE 1394.",
        "Not ranked, for the host's own time is assumed there: EtherCAT (bus.master_us = 40).",
    ]
    own, other = plain(found)["buses"]
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
    own = override(load("ethercat-servo-8").profile, changes)
    found = compare(own, kinds=["ethercat"])
    assert plain(found)["buses"][0]["assumed_host"] == keys
    assert any(line.startswith("The smallest period is ") for line in said(found)) == (not keys)
    assert any("Not ranked" in line and "EtherCAT (bus.master_us = 40)" in line for line in said(found)) == bool(keys)


def test_what_is_left_out_untested_and_in_the_way_is_said_of_each_kind() -> None:
    (note,) = [line for line in said(GANTRY) if line.startswith("CAN: ")]
    assert "At 1 ms a PDO of 40 bytes is over the 32 bytes of four frames; the bus load is 744.0%" in note
    assert "No period is shown to fit: a PDO of 40 bytes" in note
    assert "Left out on CAN: bus.speed, bus.gap_count, bus.charge_hops, group.io.write_response." in said(GANTRY)
    assert "Execution times are assumed to be as long as on IEEE 1394; here they are: from SYNC to a queued" in note
    assert "Model of CAN (kind can): published figures set expected load (8 frames that hardware" in note
    assert (
        "; independent figures test lengths of classical frames (2 sizes), lengths of FD frames (1 size), bounds"
        in note
    )
    assert note.endswith("; not tested: the cycle.")
    reset = "After a bus reset, with bus.gap_count = 63 until it is set again, the verdict is: not shown to fit."
    assert any(line.startswith(f"IEEE 1394: {reset}") for line in said(GANTRY))
    assert [one["verdict_after_reset"] for one in plain(GANTRY)["buses"]] == ["not shown to fit", None]
    assert not [line for line in said(PAPER) if line.startswith("IEEE 1394: After")]
    broadcasts = compare(load("dvrk").profile, kinds=BOTH)
    assert any("; no execution time is in the cycle of IEEE 1394 as this" in line for line in said(broadcasts))


def test_assumed_are_the_values_of_a_new_profile_and_the_defaults() -> None:
    short, whole = said(PAPER), said(PAPER, whole=True)
    assert sum(line.endswith("new profile") for line in short) == 2
    assert not [line for line in short if line.endswith("default")]
    assert short[-1] == "Not shown: 7 rows. --all shows all."
    assert sum(line.endswith("default") for line in whole) == 7
    assert not [line for line in said(compare(load("paper-1ms").profile, kinds=["ieee1394"])) if "Assumed" in line]


def test_an_unsafe_bus_does_not_pass() -> None:
    unsafe = compare(override(load("paper-4ms").profile, {"bus.gap_count": 5, "bus.nodes": 4}), kinds=["ieee1394"])
    assert said(unsafe)[0] == "paper-4ms at 4 ms: shown to fit on 0 of 1 kind of bus."
    assert "fits, unsafe gap count" in "\n".join(said(unsafe))


def test_a_circle_that_fails_or_is_not_run_says_why() -> None:
    tight = override(load("paper-1ms").profile, {"tolerance.max_contour_error_mm": 1e-6})
    (note,) = [line for line in said(compare(tight, kinds=["can"], with_circle=True)) if line.startswith("CAN: ")]
    assert "The circle at 2126.320 us: " in note
    assert "max_contour_error_mm" in note or "contour error" in note
    assert "NOT RUN" in "\n".join(said(compare(INPUTS, kinds=["can"], with_circle=True)))


def test_the_document_is_plain_and_whole() -> None:
    for found in (GANTRY, PAPER):
        document = plain(found)
        assert (document["schema"], document["command"]) == (1, "compare")
        assert [one["kind"] for one in document["buses"]] == list(BOTH)
        assert len({tuple(one) for one in document["buses"]}) == 1
    own, can = plain(PAPER)["buses"]
    assert (own["is_own"], own["assumed"], own["left_out"]) == (True, [], [])
    assert can["circle"]["step_us"] == pytest.approx(2126.32 / 28)
    assert can["circle"]["passed"] is True
    assert can["assumed"][0] == {"key": "bus.bit_rate_kbit_s", "value": 1000, "source": "new profile"}
    assert plain(GANTRY)["counted_group"] == "drives"


def test_a_kind_that_cannot_have_it_is_a_row_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    can = kind_named("can")
    monkeypatch.setattr(type(can), "starter", can.starter._replace(bus='[bus]\nkind = "can"'))
    found = compare(load("paper-1ms").profile, kinds=BOTH, with_circle=True)
    assert row(found, "CAN") == ["CAN", "not", "compared", *"---------"]
    assert any(
        line.startswith("CAN cannot have this machine: bus.bit_rate_kbit_s: missing key.") for line in said(found)
    )
    own, other = plain(found)["buses"]
    assert own.keys() == other.keys()
    assert (other["verdict"], len(other["why_not"])) == (None, 1)
    assert compare_records(found)[1]["verdict"] is None
    alone = compare(load("paper-1ms").profile, kinds=["can"])
    for form in ENDINGS.values():
        assert render(compare_report(alone), form)


def test_every_kind_has_a_column_in_csv() -> None:
    rows = compare_records(compare(load("can-servo-8").profile))
    assert {one["kind"] for one in rows} == set(kind_names())
    assert {one["profile"] for one in rows} == {"can-servo-8"}
    assert len({tuple(one) for one in rows}) == 1


def test_a_cycle_without_execution_times_says_so() -> None:
    found = compare(load("paper-1ms").profile, kinds=["ethercat"])
    assert [line for line in said(found) if line.startswith("EtherCAT: No execution time is in its cycle.")]
    own = compare(load("ethercat-servo-8").profile, kinds=["ethercat", "ieee1394"])
    assert not [line for line in said(own) if "No execution time" in line]
    assert [line for line in said(own) if "; no execution time is in the cycle of EtherCAT as this" in line]
