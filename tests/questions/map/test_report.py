"""The answer of `busplan map`: sentences, document and rows."""

import json

from busplan.buses.figure import TIMING_MODEL
from busplan.forms import render
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.map.direction import AXES, PERIOD, Direction
from busplan.questions.map.report import map_document, map_report
from busplan.questions.map.trade_off import STATES, TradeOff, trade_off

PAPER = load("paper-4ms").profile
SHOWN = trade_off(PAPER)


def said(found: TradeOff) -> list[str]:
    return render(map_report(found), "table").splitlines()


def test_the_first_line_says_how_much_fits_and_what_this_design_does() -> None:
    assert said(SHOWN)[0] == (
        "paper-4ms: 104 of 270 settings are shown to fit. This design (8 axes, period 4 ms): fits."
    )
    late = trade_off(override(PAPER, {"cycle.period_us": 500}))
    assert said(late)[0].endswith("This design (8 axes, period 500 us): does not fit, time, largest term execution.")
    unsafe = trade_off(override(PAPER, {"bus.gap_count": 5}))
    assert said(unsafe)[0].endswith("This design (8 axes, period 4 ms): unsafe gap count, gap table.")
    elsewhere = trade_off(PAPER, x=Direction("bus.gap_count", (7,)))
    assert said(elsewhere)[0].endswith("This design is not on the map: it has other values.")


def test_what_is_blank_is_counted_with_a_reason() -> None:
    found = trade_off(PAPER, x=Direction("bus.gap_count", (63, 64, 65)))
    assert (
        said(found)[1]
        == '30 settings cannot exist, as bus.gap_count 64: expected a whole number from 0 to 63, or "optimal".'
    )


def test_axes_that_change_no_payload_are_named() -> None:
    found = trade_off(PAPER, x=Direction("node.axes", (1, 4)))
    assert said(found)[1].startswith("The payload does not depend on the axes of a node")


def test_the_regions_say_what_limits_them() -> None:
    rows = said(SHOWN)[-4:]
    assert [row.split() for row in rows] == [
        ["#", "fits", "104"],
        ["?", "not", "shown", "to", "fit", "time,", "largest", "term", "execution", "4"],
        [".", "does", "not", "fit", "time,", "largest", "term", "execution", "132"],
        ["h", "does", "not", "fit", "hops", "30"],
    ]


def test_the_document_has_every_cell_and_what_is_not_drawn() -> None:
    found = trade_off(PAPER, x=Direction(AXES, (4, 6, 8)), y=Direction(PERIOD, (500, 4000)))
    document = json.loads(json.dumps(map_document(found), allow_nan=False))
    assert (document["schema"], document["command"], document[TIMING_MODEL.key]) == (1, "map", "standard")
    assert document["x"] == {"key": "axes", "values": [4, 6, 8]}
    assert [(cell["axes"], cell["cycle.period_us"], cell["state"]) for cell in document["cells"]] == [
        (4, 500, "fits"),
        (8, 500, "does not fit"),
        (4, 4000, "fits"),
        (8, 4000, "fits"),
    ]
    assert [(one["axes"], one["cycle.period_us"]) for one in document["not_drawn"]] == [(6, 500), (6, 4000)]
    assert document["design"] == document["cells"][3]
    assert sum(region["cells"] for region in document["regions"]) == 4
    assert {region["state"] for region in document["regions"]} <= set(STATES)


def test_markdown_has_the_picture_as_text() -> None:
    text = render(map_report(SHOWN), "markdown")
    assert ">   4 ms | # [#] #" in text.partition("```text\n")[2].partition("```")[0]


def test_a_page_has_the_picture_and_its_legend() -> None:
    page = render(map_report(SHOWN), "html")
    assert page.count('class="cell fits"') == 104
    assert '<data value="132">132</data>' in page


def test_csv_has_a_row_for_each_cell() -> None:
    lines = render(map_report(SHOWN), "csv").splitlines()
    assert lines[0].startswith("profile,axes,cycle.period_us,nodes,state,limited_by,binding_term,verdict,")
    assert len(lines) == 1 + len(SHOWN.cells)
