"""The drawings of a timeline: to scale, whole, and safe with any name."""

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import busplan
from busplan.buses import kind_named
from busplan.buses.limits import IDLE
from busplan.forms import markdown, terminal
from busplan.forms.blocks import Report, Sentence, ShownValue, Table
from busplan.forms.charts import Lane, Lanes, legend
from busplan.forms.numbers import sentence_text

ValuesIn = Callable[[object], Iterator[ShownValue]]

HOSTILE = '<b>$x_1$ & %%{init: {"theme":"dark"}}%%; ]]> "q" # end: </svg>機械'


def profile(**changes: object) -> busplan.Profile:
    return busplan.load_profile("paper-4ms", changes={key.replace("__", "."): v for key, v in changes.items()})


def plan(**changes: object) -> busplan.TimelineAnswer:
    return busplan.timeline(profile(**changes))


def window(**asked: Any) -> busplan.TimelineAnswer:
    return busplan.timeline("paper-4ms", **asked)


def drawn(one: busplan.TimelineAnswer, width: int | None = None) -> list[str]:
    return terminal.text(one.report(), width=width).splitlines()


def headline(one: busplan.TimelineAnswer) -> Sentence:
    said = one.report().blocks[0]
    assert isinstance(said, Sentence)
    return said


def lanes(one: busplan.TimelineAnswer, number: int = 1) -> Lanes:
    """Lanes of the period (0) or of the window (1)."""
    plot = one.drawing().panels[number].plot
    assert isinstance(plot, Lanes)
    return plot


def lane(one: busplan.TimelineAnswer, label: str, number: int = 0) -> Lane:
    (found,) = (lane for lane in lanes(one, number).lanes if lane.label == label)
    return found


def row(lines: list[str], label: str) -> str:
    return next(line.split("|")[1] for line in lines if line.split("|")[0].strip() == label)


def test_every_kind_has_its_own_mark() -> None:
    bus = kind_named("ieee1394")
    kinds = (*bus.event_kinds, IDLE)
    assert len({kind.mark for kind in kinds}) == len(kinds) == 17
    # The strip of the whole slice has whole transactions, and what belongs to no node.
    strip = (bus.event_kind("sync"), *bus.stretch_kinds, bus.event_kind("nonperiodic"), IDLE)
    assert len({kind.mark for kind in strip}) == len(strip) == 5
    assert all(kind.mark.isascii() for kind in (*kinds, *strip))


def test_the_request_is_the_hosts_and_its_acknowledge_the_nodes() -> None:
    assert [one.label for one in plan().events[1:10]] == [
        "host arbitration",
        "host data",
        "node acknowledge",
        "node execution",
        "node arbitration",
        "node data",
        "host acknowledge",
        "subaction gap",
        "arbitration reset gap",
    ]


@pytest.mark.parametrize("width", [60, 80, 132])
@pytest.mark.parametrize("nodes", [1, 2, 16, 62])
def test_a_drawing_fits_the_width_and_is_ascii(width: int, nodes: int) -> None:
    lines = drawn(plan(bus__nodes=nodes, bus__max_hops=3, cycle__nonperiodic_us=50.0), width)
    bars = [line for line in lines if line.count("|") == 2]
    assert len(bars) >= min(nodes, 20)
    assert {len(line) for line in bars} == {width}
    assert all(line.isascii() for line in lines)


def test_a_drawing_is_to_scale() -> None:
    one = plan(bus__nodes=8)
    lines = drawn(one, 132)
    strip = row(lines, "cycle")
    for mark, kinds in {"R": "read", "W": "write", "~": None}.items():
        part_us = sum(part.duration_us for part in one.events if part.transaction == kinds and part.kind != "sync")
        assert strip.count(mark) == pytest.approx(part_us / 4000 * len(strip), abs=1.01)
    assert strip.count("-") == pytest.approx(len(strip) / 2, abs=1.01)
    for number in range(1, 9):
        own = [event for event in one.events if event.node == number]
        lane = row(lines, f"node {number}")
        column_us = one.used_us / len(lane)
        assert len(lane) - len(lane.lstrip()) == int(own[0].start_us / column_us)
        assert len(lane.rstrip()) - 1 == pytest.approx(own[-1].end_us / column_us, abs=1.01)
        execution_us = sum(event.duration_us for event in own if event.kind == "execution")
        assert lane.count("=") == pytest.approx(execution_us / column_us, abs=2.01)


def test_a_column_shows_what_takes_most_of_it() -> None:
    # 2.9 us a column: arbitration takes 2.4 us of the first, and execution most of the second behind 1.5 us of others.
    assert row(drawn(plan()), "node 1").split() == ["a=============a.::", "aa============a.:::"]


def test_an_overrun_is_said_and_seen() -> None:
    one = plan(cycle__period_us=300.0)
    lines = drawn(one)
    said = "57.117 us short, 207.117 us needed of 150.000 us by the paper model, which does not affect the verdict."
    assert lines[0] == f"paper-4ms at 300 us: {said}"
    assert headline(one).state == "fails"
    over = row(lines, "over")
    assert over.strip() == "!" * over.count("!")
    for name, beyond_us in {"over": 57.117, "paper": 57.117, "standard": 113.320}.items():
        assert row(lines, name).count("!") / len(over) == pytest.approx(beyond_us / 300, abs=0.03)
    assert "idle" not in "\n".join(lines)
    (beyond,) = lane(one, "over").spans
    assert beyond.words == "beyond the slice, 57.117 us: 150.000 to 207.117 us"
    assert [line.partition("|")[0].strip() for line in lines].count("over") == 2
    assert {guide.x for guide in (*lanes(one, 0).guides, *lanes(one, 1).guides)} == {150.0}
    document = one.to_dict()
    assert (document["fits"], document["exceeded"]) == (False, ["time"])
    assert document["margin_us"] < 0
    assert "beyond" not in "\n".join(drawn(plan()))


@pytest.mark.parametrize("period_us", [4000.0, 550.0, 500.0, 300.0, 250.0, 100.0])
def test_the_period_is_whole_with_its_slice_and_both_margins(period_us: float) -> None:
    one = plan(cycle__period_us=period_us)
    found = {each.timing_model: each for each in busplan.capacity(one.profile).results}
    assert [each["margin_us"] for each in one.to_dict()["margins"]] == [each.margin_us for each in found.values()]
    lines = drawn(one)
    end_us = max(period_us, *(each.required_us for each in found.values()))
    assert lines[4].startswith(f"The period of {period_us:.3f} us")
    assert (lanes(one, 0).across.low, lanes(one, 0).across.high) == (0, end_us)
    for model, each in found.items():
        margin = f"margin {each.margin_us:.3f} us" if each.margin_us >= 0 else f"{-each.margin_us:.3f} us short"
        assert lane(one, model).note == f"{each.required_us:.3f} us needed, {margin}"
        assert f"{each.margin_us:.3f} us by the {model} model" in lines[1]
        bars = row(lines, model)
        used_us = min(each.required_us, each.available_us)
        assert bars.count("#") / len(bars) == pytest.approx(used_us / end_us, abs=0.03)
        assert bars.count(".") / len(bars) == pytest.approx(max(0, each.margin_us) / end_us, abs=0.03)
        needed = lane(one, model).spans[0]
        assert (needed.entry.words, needed.start) == ("needed", 0)
        assert needed.end == pytest.approx(used_us)
    behind = [span for span in lane(one, "cycle").spans if span.entry.words == "rest of the period"]
    assert [(span.start, span.end) for span in behind] == [(one.end_us, period_us)] * (period_us > one.end_us)


def test_an_unsafe_gap_count_is_warned_of() -> None:
    one = plan(bus__gap_count=5)
    assert any("gap count 5 is unsafe" in line for line in drawn(one))
    assert "gap count 5 is unsafe" in one.to_dict()["warnings"][0]


def test_a_single_transaction_is_drawn_event_by_event() -> None:
    lines = drawn(window(transaction=("write", 2)))
    assert any(line.startswith("The write of node 2, 155.438 to 207.117 us") for line in lines)
    assert re.search(r"^node execution +36\.733 us \| +=+ +\|$", "\n".join(lines), re.MULTILINE)
    assert row(lines, "window").strip() == "^^"
    short = drawn(window(from_us=10.0, to_us=10.001))
    assert row(short, "window").strip() == "^"


@pytest.mark.parametrize(
    "one",
    [plan(), plan(cycle__period_us=300.0), window(from_us=100.0, to_us=180.0), plan(bus__nodes=16)],
    ids=["whole", "overrun", "window", "many"],
)
def test_bars_are_the_events_in_the_lanes_of_their_nodes(one: busplan.TimelineAnswer) -> None:
    bars = [span for each in lanes(one).lanes for span in each.spans if "execution" in span.words]
    executions = [event for event in one.events if event.kind == "execution"]
    assert sorted((bar.start, bar.end) for bar in bars) == [(event.start_us, event.end_us) for event in executions]
    assert (lanes(one).across.low, lanes(one).across.high) == (one.from_us, one.used_us if one.is_whole else one.to_us)
    explained = {entry.words for entry in legend(one.drawing().panels)}
    assert {kind_named("ieee1394").event_kind(event.kind).label for event in one.events} - {"idle"} <= explained


def test_documents_hold_the_schedules_own_numbers() -> None:
    one = window(to_us=50.0)
    document = one.to_dict()
    assert [(row["start_us"], row["end_us"]) for row in document["events"]] == [one[1:] for one in spans(one)]
    assert document["required_us"] == one.figures.required_us
    assert [row["share"] for row in document["totals"]] == [part.share for part in one.totals]
    assert {row["profile"] for row in one.report().records or ()} == {"paper-4ms"}


@pytest.mark.parametrize(
    "one",
    [plan(), plan(cycle__period_us=300.0), window(from_us=100.0, to_us=180.0), plan(bus__gap_count=5)],
    ids=["whole", "overrun", "window", "unsafe"],
)
def test_figures_of_the_answer_stand_in_its_document(
    one: busplan.TimelineAnswer, values_of_the_document: Callable[[Report], int], values_in: ValuesIn
) -> None:
    short = not one.figures.fits
    head = {"period_us", "required_us", "available_us"} if short else {"period_us", "margin_us", "available_us"}
    assert values_of_the_document(one.report()) == 3 * len(one.totals)
    assert head <= {value.key for value in values_in(headline(one))}


def test_the_table_says_what_takes_how_much_of_what() -> None:
    answers = (plan(), window(from_us=100.0, to_us=180.0), plan(cycle__period_us=300.0))
    tables = [block for one in answers for block in one.report().blocks if isinstance(block, Table)]
    assert [sentence_text(table.caption) for table in tables if table.caption] == [
        "What takes the slice, 2000.000 us",
        "What takes the window, 80.000 us",
        "What takes the cycle, 207.117 us",
    ]
    lines = drawn(plan())
    assert lines[-2].split() == [":", "arbitration", "reset", "gap", "(10)", "4", "21.047", "1.05"]


def test_a_page_and_markdown_have_the_drawing_and_the_totals() -> None:
    answer = plan(name=HOSTILE)
    text = markdown.text(answer.report())
    assert "```text\nThe period of 4000.000 us" in text
    assert "| arbitration | " in text
    page = answer.html
    assert page.count('<svg xmlns="http://www.w3.org/2000/svg" class="chart"') == 1
    assert '<data value="8">8</data>' in page
    assert HOSTILE not in page


def test_a_page_of_many_events_says_that_a_bar_is_a_transaction() -> None:
    many = plan(bus__nodes=62, bus__max_hops=3)
    assert "A bar is a whole transaction." in many.html
    assert [span.words.split(",")[0] for span in lane(many, "node 9", 1).spans] == ["read of node 9", "write of node 9"]
    assert "A bar is a whole transaction." not in plan().html


@pytest.mark.parametrize("name", ["paper-4ms", "ethercat-servo-8"])
def test_a_drawing_of_a_thousand_nodes_can_be_read(name: str) -> None:
    many = busplan.timeline(busplan.load_profile(name, changes={"bus.nodes": 1000, "cycle.period_us": 1e6}))
    bus, *shared = [each for each in lanes(many).lanes if each.label != "over"]
    assert sum(len(each.spans) for number in (0, 1) for each in lanes(many, number).lanes) < 1500
    assert "A bar is what takes most of a 400th of the scale." in many.html
    assert [each.label for each in shared] == [f"nodes {first} to {first + 7}" for first in range(1, 1001, 8)]
    busy = [event for event in many.events if event.kind != "idle"]
    for each, nodes in (
        (bus, {None}),
        *zip(shared, (range(first, first + 8) for first in range(1, 1001, 8)), strict=True),
    ):
        events = [event for event in busy if event.node in nodes]
        assert (each.spans[0].start, each.spans[-1].end) == (events[0].start_us, events[-1].end_us)


def spans(one: busplan.TimelineAnswer) -> list[tuple[str, float, float]]:
    return [(event.kind, event.start_us, event.end_us) for event in one.events]


def test_bus_lane_comes_first_and_nodes_in_their_turn() -> None:
    one = plan(bus__nodes=12)
    assert [each.label for each in lanes(one).lanes] == ["bus", *(f"node {number}" for number in range(1, 13))]
    each = busplan.timeline(one.profile, transaction=("write", 11))
    assert [span.words.split(":")[0] for lane in lanes(each).lanes for span in lane.spans] == ["write of node 11"] * 9
