"""What moves the margin: from results to answers."""

import csv
import io
import json
from collections.abc import Callable

import pytest

from busplan.forms import render
from busplan.forms.blocks import Report
from busplan.printable import to_json
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.capacity.report import capacity_document
from busplan.questions.capacity.sensitivity import sensitivities, sensitivity
from busplan.questions.capacity.sensitivity_report import sensitivity_document, sensitivity_report
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.fit.figures import capacity
from busplan.sections.profile import Profile


@pytest.fixture
def profile() -> Profile:
    return load("paper-1ms").profile


def made(profile: Profile, *periods_us: float) -> Report:
    result = capacity(profile, periods_us=periods_us or None)
    return sensitivity_report(result, verdicts(result), sensitivities(result))


def lines(profile: Profile) -> list[str]:
    text = render(made(profile), "table")
    return text[text.index("What moves the margin") :].splitlines()


@pytest.mark.parametrize("name", ["paper-1ms", "gantry-24", "can-servo-8", "ethercat-servo-8", "sercos3-servo-8"])
def test_a_figure_stands_at_its_place_at_every_period(
    name: str, values_of_the_document: Callable[[Report], int]
) -> None:
    one = load(name).profile
    assert values_of_the_document(made(one, 4000.0, 300.0)) > 100
    nodes = one.alike_nodes[0]
    tree: dict[str, object] = {"bus.max_hops": 3, "bus.charge_hops": "farthest"} if one.bus.kind == "ieee1394" else {}
    assert values_of_the_document(made(override(one, {**tree, nodes.payload_key("write"): 16}))) > 60


def test_the_document_is_that_of_capacity_with_two_keys_more(profile: Profile) -> None:
    result = capacity(profile, periods_us=[1000.0, 500.0])
    plain, found = capacity_document(result, verdicts(result)), sensitivities(result)
    whole = json.loads(to_json(sensitivity_document(result, verdicts(result), found)))
    for verdict, one in zip(whole["verdicts"], found, strict=True):
        rows, following = verdict.pop("sensitivity"), verdict.pop("next_bottleneck")
        assert [row["margin_change_us"] for row in rows] == [effect.margin_change_us for effect in one.effects]
        assert [row["note"] for row in rows] == [effect.note or None for effect in one.effects]
        assert following["next_safe_nodes"] == one.next_bottleneck.limits[0].next_safe_nodes
        assert following["text"].startswith("Next bottleneck: without execution, now 146.933 us, the largest term is ")
    assert whole == json.loads(to_json(plain))


def test_a_csv_row_is_a_change_at_a_period(profile: Profile) -> None:
    rows = list(csv.DictReader(io.StringIO(render(made(profile, 1000.0, 500.0), "csv"))))
    found = sensitivity(profile).effects
    assert len(rows) == 2 * len(found)
    assert [row["change"] for row in rows[: len(found)]] == [one.change for one in found]
    assert {row["period_us"] for row in rows} == {"1000.0", "500.0"}
    assert (rows[0]["profile"], rows[0]["timing_model"], rows[0]["key"]) == ("paper-1ms", "standard", "bus.nodes")
    assert (rows[-1]["change"], rows[-1]["margin_change_us"], rows[-1]["verdict"]) == ("one hop more", "", "")


def test_it_says_what_moves_the_margin_most_and_what_is_lost(profile: Profile) -> None:
    text = "\n".join(lines(profile))
    assert "One node more moves the margin most, by -128.100 us to 101.964 us. The cycle is shown to fit after" in text
    assert "A bus reset: it is set so already." in text
    assert "One hop more: in a chain the hops follow the nodes." in text
    narrow = "\n".join(lines(override(profile, {"cycle.period_us": 700})))
    assert "The cycle is no longer shown to fit after one node more." in narrow
    over = "\n".join(lines(override(profile, {"cycle.period_us": 400})))
    assert "no longer" not in over
    assert "is shown to fit after" not in over
    # A gap count that is safe for two hops is not for three.
    tight = "\n".join(lines(override(profile, {"bus.gap_count": 7})))
    assert "Its gap count is unsafe after one node more." in tight
    assert "fits, unsafe gap count" in tight
    many = "\n".join(lines(override(profile, {"bus.nodes": 16, "cycle.period_us": 10000})))
    assert "does not fit, hops" in many


def test_where_nothing_takes_the_largest_term_away_it_says_what_comes_behind() -> None:
    text = "\n".join(lines(load("paper-dma").profile))
    assert "Next bottleneck: after idle, 84.188 us, which no key takes away, comes execution, 42.400 us;" in text


def test_the_table_is_no_wider_than_a_terminal(profile: Profile) -> None:
    table = lines(override(profile, {"bus.gap_count": "optimal"}))
    assert max(len(line) for line in table if not line.startswith("Next bottleneck")) <= 130
    rows = [line for line in table if "->" in line or "---" in line]
    assert max(map(len, rows)) <= 80


@pytest.mark.parametrize("form", ["markdown", "html", "json", "csv", "table"])
def test_every_form_has_it(profile: Profile, form: str) -> None:
    text = render(made(profile), form)  # type: ignore[arg-type]
    assert "one node more" in text
    assert ("Next bottleneck" in text) == (form != "csv")
    assert ("moves the margin most" in text) == (form in ("markdown", "html", "table"))
    assert ("NaN" in text, "Infinity" in text) == (False, False)
    assert ("<svg" in text) == (form == "html")
