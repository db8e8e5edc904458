"""The card: what a person reads first."""

import re
from math import floor, log10

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.forms.blocks import Card, Command, Gauge
from busplan.forms.numbers import sentence_text
from busplan.forms.terminal import text
from busplan.questions.capacity import CapacityAnswer

SHIPPED = ("paper-4ms", "gantry-24", "can-servo-8", "ethercat-servo-8", "sercos2-servo-8", "sercos3-servo-8")


def card_of(answer: CapacityAnswer) -> tuple[str, dict[str, str]]:
    """The verdict and the lines of the first card."""
    card = next(block for block in answer.report().blocks() if isinstance(block, Card))
    return card.verdict.text, {label: sentence_text(words) for label, words in card.lines}


def test_every_kind_says_how_full_how_fast_and_how_many_more() -> None:
    for name in SHIPPED:
        verdict, lines = card_of(busplan.capacity(name))
        assert verdict == "FITS"
        assert {"used", "free", "fastest period", "room for", "largest part", "tested"} <= {*lines}
        assert not re.search("slice|squared|JCGM|alpha", " ".join(lines.values()))


def test_used_and_free_are_the_figures_of_the_verdict() -> None:
    answer = busplan.capacity("ethercat-servo-8")
    figures = answer.verdicts[0].deciding
    assert (figures.margin_corrected_us, figures.uncertainty_us, figures.safe_nodes) == pytest.approx(
        (895.144, 40.195, 106), abs=1e-3
    )
    _, lines = card_of(answer)
    assert lines["used"] == "105 us of 1000, 10 %"
    assert lines["free"] == "895 us, +/- 40; 100 must stay free"
    # 209.79 us + 44.76 us before SYNC0 at half of the period: 509.1 us, and up.
    assert lines["fastest period"] == "510 us, limited by sync0"
    assert lines["room for"] == "98 more nodes"
    assert lines["assumed"] == "bus.master_us: measure it first"


def test_a_period_mends_no_limit_that_it_plays_no_part_in() -> None:
    _, lines = card_of(busplan.capacity(busplan.load_profile("dvrk", changes={"group.full.nodes": 12})))
    assert lines["limit"].startswith("the hub's block of 2116 bytes")
    assert lines["fastest period"] == "none: no period keeps the limit"
    _, lines = card_of(busplan.capacity("can-servo-8", period_us=1000))
    assert lines["fastest period"] == "3.345 ms"
    _, lines = card_of(busplan.capacity("sercos3-servo-8", period_us=300))
    assert (lines["limit"], lines["fastest period"]) == (
        "the bus allows no period of 300 us; the next are 250 and 500 us",
        "250 us",
    )


def test_the_cure_stands_where_there_is_something_to_cure() -> None:
    verdict, lines = card_of(busplan.capacity("ethercat-servo-8", period_us=500))
    assert verdict == "NOT SHOWN TO FIT"
    assert lines["limit"] == "the last command comes at 209.8 +/- 44.8 us, SYNC0 at 250.0 us"
    assert lines["cure"].startswith("bus.sync_shift = 0.6 (drives act, and sample, later), which leaves 395 us")
    verdict, lines = card_of(busplan.capacity("paper-4ms", period_us=500))
    assert verdict == "DOES NOT FIT"
    assert lines["short by"] == "20 us, +/- 6"
    assert lines["paper model"] == "says otherwise, 207 us needed of 250, but does not decide"
    assert "room for" not in lines
    # Where nodes differ, nobody said which of them are to be more: no change is looked for, and none is spoken of.
    verdict, lines = card_of(busplan.capacity("gantry-24", period_us=800))
    assert (verdict, lines["room for"]) == ("FITS", "no more nodes")
    assert "one more" not in lines
    verdict, lines = card_of(busplan.capacity(busplan.load_profile("paper-1ms", changes={"bus.gap_count": 3})))
    assert verdict == "FITS, BUT"
    assert lines["unsafe"] == "gap count"


@settings(max_examples=30, deadline=None)
@given(
    period_us=st.sampled_from([2500, 4000, 20000]),
    jitters_us=st.lists(st.integers(0, 9000), min_size=3, max_size=3),
    deadlines_us=st.lists(st.sampled_from([812.5, 3000, 5000, 10000]), min_size=3, max_size=3),
)
def test_can_says_its_load_and_the_message_closest_to_its_deadline(
    period_us: int, jitters_us: list[int], deadlines_us: list[float]
) -> None:
    names = ("sdo-request", "sdo-response", "heartbeats")
    changes: dict[str, float] = {"cycle.period_us": period_us}
    changes |= {f"message.{name}.jitter_us": us for name, us in zip(names, jitters_us, strict=True)}
    changes |= {f"message.{name}.deadline_us": us for name, us in zip(names, deadlines_us, strict=True)}
    profile = busplan.load_profile("can-servo-8", changes=changes)
    answer = busplan.capacity(profile)
    _, lines = card_of(answer)
    assert lines["load"] == f"{100 * answer.verdicts[0].deciding.bus_load:.1f} %, 80 allowed".replace(".0 ", " ")
    phases = {
        row.transaction: row.phases
        for row in busplan.latency(profile, timing_model="worst-stuffing").transactions
        if row.transaction in names
    }
    shares = {name: phase.worst_response_us / phase.deadline_us for name, phase in phases.items()}
    latest = lines["latest message"].split(",")[0]
    assert shares[latest] == max(shares.values())
    us, deadline_us = phases[latest].worst_response_us, phases[latest].deadline_us
    assert lines["latest message"] == f"{latest}, {us:.1f} us of {deadline_us:.1f}".replace(".0", "")


def test_can_without_messages_has_none_that_is_late() -> None:
    _, lines = card_of(busplan.capacity(busplan.load_profile("can-servo-8").model_copy(update={"message": ()})))
    assert "load" in lines
    assert "latest message" not in lines


@settings(max_examples=30, deadline=None)
@given(name=st.sampled_from(SHIPPED), period_us=st.sampled_from([250, 1000, 2000, 4000, 64000]))
def test_what_is_used_and_free_fills_what_the_bus_may_use(name: str, period_us: int) -> None:
    answer = busplan.capacity(name, period_us=period_us)
    figures = answer.verdicts[0].deciding
    _, lines = card_of(answer)
    used = float(lines["used"].split()[0])
    free = float(lines["free"].split()[0]) if "free" in lines else -float(lines["short by"].split()[0])
    unit = (
        10.0 ** min(0, floor(log10(figures.uncertainty_us))) if figures.uncertainty_us else figures.available_us / 100
    )
    assert used + free == pytest.approx(figures.available_us, abs=1.01 * unit)


@given(
    used=st.floats(0, 3),
    doubt=st.floats(0, 2),
    most=st.floats(0, 1),
    reserve=st.floats(0, 1),
)
def test_the_parts_of_a_bar_fill_it(used: float, doubt: float, most: float, reserve: float) -> None:
    gauge = Gauge(used, doubt, most * (1 - reserve), most, "passes")
    parts = gauge.parts()
    assert [part.start for part in parts] == [0.0, *(part.end for part in parts[:-1])]
    assert parts[-1].end == 1.0
    assert parts[0].end == min(1.0, used)


def test_a_low_terminal_shows_the_card_alone_unless_all_was_asked_for() -> None:
    report = busplan.capacity("gantry-24").report()._replace(next_commands=(Command("busplan report gantry-24"),))
    low = text(report, width=80, height=24).splitlines()
    assert len(low) < 24
    assert max(map(len, low)) <= 80
    assert low[-2:] == ["  next            busplan report gantry-24", "--all shows the figures behind it."]
    high, whole = text(report, width=80, height=90), text(report._replace(is_whole=True), width=80, height=24)
    assert "corrected margin" in high
    assert "Largest doubt" in whole
    assert "next" not in text(report)


def test_other_forms_have_the_card() -> None:
    answer = busplan.capacity("paper-4ms", period_us=500)
    assert '<p class="answer">DOES NOT FIT</p>' in answer.html
    assert '<rect class="used fails" x="0.000%" y="0" width="' in answer.html
    assert "| short by | 20 us, +/- 6 |" in busplan.forms.render(answer.report(), "markdown")
