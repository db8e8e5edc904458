"""The drawings of a timeline: to scale, whole, and safe with any name."""

import re
from collections import defaultdict
from typing import Any

import pytest

import busplan
from busplan.forms import markdown, terminal
from busplan.forms.blocks import Sentence, Table
from busplan.forms.numbers import sentence_text

HOSTILE = '<b>$x_1$ & %%{init: {"theme":"dark"}}%%; ]]> "q" # end: </svg>機械'


def profile(**changes: object) -> busplan.Profile:
    return busplan.load_profile("paper-4ms", changes={key.replace("__", "."): v for key, v in changes.items()})


def plan(**changes: object) -> busplan.TimelineAnswer:
    return busplan.timeline(profile(**changes))


def window(**asked: Any) -> busplan.TimelineAnswer:
    return busplan.timeline("paper-4ms", **asked, recording=None)


def drawn(one: busplan.TimelineAnswer, width: int | None = None) -> list[str]:
    return terminal.text(one.report(), width=width).splitlines()


def headline(one: busplan.TimelineAnswer) -> Sentence:
    said = one.report().blocks[0]
    assert isinstance(said, Sentence)
    return said


def lanes(one: busplan.TimelineAnswer, number: int = 1) -> Any:
    """Lanes of the period (0) or of the window (1)."""
    return one.drawing().panels[number].plot


def lane(one: busplan.TimelineAnswer, label: str, number: int = 0) -> Any:
    (found,) = (lane for lane in lanes(one, number).lanes if lane.label == label)
    return found


def row(lines: list[str], label: str) -> str:
    return next(line.split("|")[1] for line in lines if line.split("|")[0].strip() == label)


def test_the_request_is_the_hosts_and_its_acknowledge_the_nodes() -> None:
    assert [one.label for one in plan().events[1:10]] == [
        "host arbitration",
        "host data",
        "node acknowledge",
        "node execution",
        "node arbitration",
        "node data",
        "host acknowledge",
        "subaction gap after the response",
        "host arbitration",
    ]
    assert plan().events[0].label == "synchronous packet"
    assert busplan.timeline("paper-4ms", timing_model="paper").events[9].label == "arbitration reset gap"


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
    for mark, kinds in {"R": "read", "W": "write", ".": None}.items():
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


def test_an_overrun_is_said_and_seen() -> None:
    one = plan(cycle__period_us=300.0)
    lines = drawn(one)
    said = "used 270 us of the 150 that the bus may use, 180 %; short by 120 us, +/- 6."
    assert lines[0] == f"paper-4ms at 300 us: does not fit by the standard model; {said}"
    paper = drawn(busplan.timeline(profile(cycle__period_us=300.0), timing_model="paper"))
    said = "short by 57.117 us: needs 207.117 us of 150.000 us by the paper model, which does not affect the verdict."
    assert paper[0] == f"paper-4ms at 300 us: {said}"
    assert headline(one).state == "fails"
    over = row(lines, "over")
    assert over.strip() == "!" * over.count("!")
    for name, beyond_us in {"over": 113.320, "paper": 57.117, "standard": 113.320}.items():
        assert row(lines, name).count("!") / len(over) == pytest.approx(beyond_us / 300, abs=0.03)
    assert "idle" not in "\n".join(lines)
    (beyond,) = lane(one, "over").spans
    assert beyond.words == "beyond the slice, 113.320 us: 150.000 to 263.320 us"
    assert [lane(answer, "paper").note for answer in (one, plan())] == [
        "207.117 us needed, 57.117 us short",
        "207.117 us needed, margin 1792.883 us",
    ]
    assert [line.partition("|")[0].strip() for line in lines].count("over") == 2
    assert {guide.x for guide in (*lanes(one, 0).guides, *lanes(one, 1).guides)} == {150.0}
    document = one.to_dict()
    assert (document["fits"], document["exceeded"]) == (False, ["time"])
    assert document["margin_us"] < 0
    assert "beyond" not in "\n".join(drawn(plan()))


def test_an_unsafe_gap_count_is_warned_of() -> None:
    one = plan(bus__gap_count=5)
    assert any("gap count 5 is unsafe" in line for line in drawn(one))
    assert "gap count 5 is unsafe" in one.to_dict()["warnings"][0]


def test_a_single_transaction_is_drawn_event_by_event() -> None:
    lines = drawn(window(transaction=("write", 2)))
    assert any(line.startswith("The write of node 2, 204.108 to 263.320 us") for line in lines)
    assert re.search(r"^node execution +\| +=+ +\|$", "\n".join(lines), re.MULTILINE)
    assert row(lines, "window").strip() == "^^"
    short = drawn(window(from_us=10.0, to_us=10.001))
    assert row(short, "window").strip() == "^"


def test_the_table_says_what_takes_how_much_of_what() -> None:
    answers = (plan(), window(from_us=100.0, to_us=180.0), plan(cycle__period_us=300.0))
    tables = [block for one in answers for block in one.report().blocks if isinstance(block, Table)]
    assert [sentence_text(table.caption) for table in tables if table.caption] == [
        "Use of the slice, 2000.000 us",
        "Use of the window, 80.000 us",
        "Use of the cycle, 263.320 us",
    ]
    lines = drawn(plan())
    assert lines[-2].split() == [",", "subaction", "gap", "(10)", "4", "42.196", "2.11"]
    paper = drawn(busplan.timeline("paper-4ms", timing_model="paper"))
    assert paper[-2].split() == [":", "arbitration", "reset", "gap", "(10)", "4", "21.047", "1.05"]


def test_a_page_and_markdown_have_the_drawing_and_the_totals() -> None:
    answer = plan(name=HOSTILE)
    text = markdown.text(answer.report())
    assert "```text\nThe period of 4000.000 us" in text
    assert "| arbitration | " in text
    page = answer.html
    assert page.count('<svg xmlns="http://www.w3.org/2000/svg" class="chart"') == 1
    assert '<data value="8">8</data>' in page
    assert HOSTILE not in page


@pytest.mark.slow
def test_a_drawing_of_a_thousand_nodes_can_be_read() -> None:
    many = busplan.timeline(
        busplan.load_profile("ethercat-servo-8", changes={"bus.nodes": 1000, "cycle.period_us": 1e6})
    )
    bus, *shared = [each for each in lanes(many).lanes if each.label != "over"]
    assert "A bar is a whole transaction." in many.html
    assert [each.label for each in shared] == [f"nodes {first} to {first + 7}" for first in range(1, 1001, 8)]
    busy = [event for event in many.events if event.kind != "idle"]
    of_lane: dict[int, list[Any]] = defaultdict(list)
    for event in busy:
        of_lane[-1 if event.node is None else (event.node - 1) // 8].append(event)
    for place, each in enumerate((bus, *shared), start=-1):
        events = of_lane[place]
        assert (each.spans[0].start, each.spans[-1].end) == (events[0].start_us, events[-1].end_us)


def spans(one: busplan.TimelineAnswer) -> list[tuple[str, float, float]]:
    return [(event.kind, event.start_us, event.end_us) for event in one.events]
