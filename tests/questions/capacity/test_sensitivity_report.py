"""What moves the margin: the table, the bars and the sentences of the answer."""

import csv
import io
import json
from typing import Any

import pytest

import busplan
from busplan.forms import render


def paper(**changes: object) -> busplan.Profile:
    """paper-1ms with new values by key, with __ for the dot."""
    return busplan.load_profile("paper-1ms", changes={key.replace("__", "."): value for key, value in changes.items()})


def text_of(profile: busplan.Profile) -> str:
    text = render(busplan.capacity(profile, sensitivity=True).report()._replace(is_whole=True), "table")
    return text[text.index("What moves the corrected margin") :]


def bars(profile: busplan.Profile) -> Any:
    (panel,) = busplan.capacity(profile, sensitivity=True).drawing().panels
    return panel.plot


def test_the_document_is_that_of_capacity_with_three_keys_more() -> None:
    plain = busplan.capacity("paper-1ms", period_us=[1000.0, 500.0])
    answer = busplan.capacity("paper-1ms", period_us=[1000.0, 500.0], sensitivity=True)
    whole = json.loads(answer.to_json())
    for verdict, sensitivity in zip(whole["verdicts"], answer.sensitivities, strict=True):
        rows, following = verdict.pop("sensitivity"), verdict.pop("next_bottleneck")
        assert [reach["most"] for reach in verdict.pop("reach")] == [reach.most for reach in sensitivity.reaches]
        assert [row["margin_change_us"] for row in rows] == [effect.margin_change_us for effect in sensitivity.effects]
        assert [row["note"] for row in rows] == [effect.note or None for effect in sensitivity.effects]
        assert following["next_safe_nodes"] == sensitivity.next_bottleneck.limits[0].next_safe_nodes
        assert following["text"].startswith("Next bottleneck: without execution, now 147 us, the largest term is ")
    assert whole == json.loads(plain.to_json())


def test_a_csv_row_is_a_change_at_a_period() -> None:
    answer = busplan.capacity("paper-1ms", period_us=[1000.0, 500.0], sensitivity=True)
    rows = list(csv.DictReader(io.StringIO(render(answer.report(), "csv"))))
    changes = [effect.change for effect in answer.sensitivities[0].effects]
    assert len(rows) == 2 * len(changes)
    assert [row["change"] for row in rows[: len(changes)]] == changes
    assert {row["period_us"] for row in rows} == {"1000.0", "500.0"}
    assert (rows[0]["profile"], rows[0]["timing_model"], rows[0]["key"]) == ("paper-1ms", "standard", "bus.nodes")
    last = rows[len(changes) - 1]
    assert (last["change"], last["margin_change_us"], last["verdict"]) == ("one more hop", "", "")


def test_it_says_what_moves_the_margin_most_and_what_is_lost() -> None:
    text = text_of(paper())
    moved = "One more node moves the corrected margin most, by -128 us to 102 us. The cycle is shown to fit after each"
    assert moved in text
    assert "A bus reset: it is set so already." in text
    assert "One more hop: in a chain the hops follow the nodes." in text
    assert "The cycle is no longer shown to fit after one more node." in text_of(paper(cycle__period_us=700))
    over = text_of(paper(cycle__period_us=400))
    assert "no longer" not in over
    assert "is shown to fit after" not in over
    # A gap count that is safe for two hops is not for three.
    tight = text_of(paper(bus__gap_count=7))
    assert "Its gap count is unsafe after one more node." in tight
    assert "fits, unsafe gap count" in tight
    assert "does not fit, hops" in text_of(paper(bus__nodes=16, cycle__period_us=10000))


def test_where_nothing_takes_the_largest_term_away_it_says_what_comes_behind() -> None:
    text = text_of(busplan.load_profile("paper-dma"))
    assert "Next bottleneck: no key removes idle, 84.2 us; the next term is execution, 42.4 us;" in text


@pytest.mark.parametrize("name", ["paper-1ms", "ethercat-servo-8"])
def test_a_bar_reaches_from_zero_to_its_figure_on_one_scale(name: str) -> None:
    profile = busplan.load_profile(name)
    (sensitivity,) = busplan.capacity(profile, sensitivity=True).sensitivities
    made = {
        effect.change: effect.margin_change_us for effect in sensitivity.effects if effect.margin_change_us is not None
    }
    plot = bars(profile)
    assert [lane.label for lane in plot.lanes] == list(made)
    for us, lane in zip(made.values(), plot.lanes, strict=True):
        assert [(span.start, span.end) for span in lane.spans] == ([(min(us, 0), max(us, 0))] if us else [])
        assert lane.note == f"{us:+.3f} us".replace("+0.000", "0.000")
    assert (plot.across.low, plot.across.high) == (min(0, *made.values()), max(0, *made.values()))
    assert plot.guides[0].x == 0
