"""The answer of `busplan map`: sentences, document and rows."""

from typing import Any

import busplan

SHOWN = busplan.map_("paper-4ms")


def lines_of(*, x: Any = None, y: Any = None, **changes: object) -> list[str]:
    values = {key.replace("__", "."): value for key, value in changes.items()}
    return str(busplan.map_(busplan.load_profile("paper-4ms", changes=values), x=x, y=y)).splitlines()


def test_the_first_line_says_how_much_fits_and_what_this_design_does() -> None:
    assert lines_of()[0] == (
        f"paper-4ms: 104 of {len(SHOWN.cells)} settings are shown to fit. This design (8 axes, period 4 ms): fits."
    )
    late = lines_of(cycle__period_us=500)
    assert late[0].endswith("This design (8 axes, period 500 us): does not fit, time, largest term execution.")
    unsafe = lines_of(bus__gap_count=5)
    assert unsafe[0].endswith("This design (8 axes, period 4 ms): unsafe gap count, gap table.")
    elsewhere = lines_of(x={"bus.gap_count": [7]})
    assert elsewhere[0].endswith("This design is not on the map: it has other values.")


def test_what_is_blank_is_counted_with_a_reason() -> None:
    x, y = {"bus.gap_count": [63, 64, 65]}, {"cycle.period_us": [500, 4000]}
    assert lines_of(x=x, y=y)[1] == (
        '4 settings cannot exist, as bus.gap_count 64: expected a whole number from 0 to 63, or "optimal".'
    )


def test_axes_that_change_no_payload_are_named() -> None:
    assert lines_of(x={"node.axes": [1, 4]})[1].startswith("The payload does not depend on the axes of a node")


def test_the_regions_say_what_limits_them() -> None:
    regions = [(region.state, region.reasons, region.binding_term) for region in SHOWN.regions]
    assert regions == [
        ("fits", (), None),
        ("not shown to fit", ("time",), "execution"),
        ("does not fit", ("time",), "execution"),
        ("does not fit", ("hops",), None),
    ]
    rows = [row.split() for row in lines_of()[-4:]]
    assert rows == [
        ["#", "fits", str(SHOWN.regions[0].cells)],
        ["?", "not", "shown", "to", "fit", "time,", "largest", "term", "execution", str(SHOWN.regions[1].cells)],
        [".", "does", "not", "fit", "time,", "largest", "term", "execution", str(SHOWN.regions[2].cells)],
        ["h", "does", "not", "fit", "hops", str(SHOWN.regions[3].cells)],
    ]


def test_the_document_has_every_cell_and_what_is_not_drawn() -> None:
    document = busplan.map_("paper-4ms", x={"axes": [4, 6, 8]}, y={"cycle.period_us": [500, 4000]}).to_dict()
    assert (document["schema"], document["command"], document["timing_model"]) == (1, "map", "standard")
    assert document["x"] == {"key": "axes", "values": [4, 6, 8]}
    assert [(cell["axes"], cell["cycle.period_us"], cell["state"]) for cell in document["cells"]] == [
        (4, 500, "fits"),
        (8, 500, "does not fit"),
        (4, 4000, "fits"),
        (8, 4000, "fits"),
    ]
    assert [(setting["axes"], setting["cycle.period_us"]) for setting in document["not_drawn"]] == [(6, 500), (6, 4000)]
    assert document["design"] == document["cells"][3]
    assert sum(region["cells"] for region in document["regions"]) == 4
