"""What is advised has been seen to work, and is safe."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses.ieee1394.constants import safe_gap_count
from busplan.buses.ieee1394.transactions import gap_count_of, hops_of
from busplan.forms.numbers import sentence_text
from busplan.gate.gate import check_document
from busplan.profile.document import Document
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import override
from busplan.profile.write import profile_text, short_text
from busplan.questions.capacity.sentences import verdict_sentences
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.circle.check import CircleCheck
from busplan.questions.circle.roundness import circle_test
from busplan.questions.fit.certainty import DOES_NOT_FIT, FITS
from busplan.questions.fit.figures import capacity, figures
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.plan.advice import UNTESTED_CIRCLE, Change, cure
from busplan.questions.plan.freedoms import MOST_RATIO
from busplan.questions.plan.planning import plan
from busplan.sections.profile import Profile

Make = Callable[..., Profile]


def is_safe(profile: Profile, change: Change) -> bool:
    network = network_of(override(profile, dict(change.changes))).with_nodes(change.nodes)
    if profile.bus.kind != "ieee1394":
        return bus_of(profile).is_safe(network)
    return bool(gap_count_of(network) >= safe_gap_count(hops_of(network)))


@given(data=st.data())
def test_after_a_change_the_verdict_is_what_it_promises(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    verdict = verdicts(capacity(profile))[0]
    if verdict.change is None:
        assert verdict.no_change or bus_of(profile).limit(verdict.deciding.safe_limited_by or "")
        return
    changed = override(profile, dict(verdict.change.changes))
    after = figures(changed, model="standard")
    assert is_safe(profile, verdict.change)
    assert changed.cycle.slice_ratio <= max(MOST_RATIO, profile.cycle.slice_ratio)
    if verdict.all_well:
        assert verdict.deciding.safe_nodes is not None
        assert after.safe_nodes is not None
        assert verdict.deciding.safe_nodes < verdict.change.nodes <= after.safe_nodes
    else:
        assert (after.verdict, after.safe) == (FITS, True)


def within_limits(profile: Profile) -> Profile:
    """The same with as many nodes, hops and bytes as one bus, one packet and one hub carry."""
    bus, payload = profile.bus, profile.payload
    nodes = min(profile.alike_nodes[0].nodes, 16)
    most = {"S100": 512, "S200": 1024, "S400": 2048}[bus.speed]
    if profile.cycle.schedule == "broadcast":
        most = (most - 4) // nodes // 4 * 4 - 4
    small = {f"payload.{kind}_bytes": min(getattr(payload, f"{kind}_bytes"), most) for kind in ("read", "write")}
    hops = {} if bus.max_hops is None else {"bus.max_hops": min(bus.max_hops, nodes)}
    return override(profile, {"bus.nodes": nodes, "bus.gap_count": "optimal", **small, **hops})


@given(data=st.data())
def test_there_is_always_a_way_where_no_limit_of_the_standard_is_broken(
    data: st.DataObject, any_profile: st.SearchStrategy[Profile]
) -> None:
    # The period may grow; only a broken limit is beyond time.
    profile = within_limits(data.draw(any_profile))
    assert bus_of(profile).broken(network_of(profile)) == ()
    wrong = data.draw(st.sampled_from(["optimal", 0, 63]))
    verdict = verdicts(capacity(override(profile, {"bus.gap_count": wrong})))[0]
    assert verdict.all_well or verdict.change is not None


CASES: list[tuple[dict[str, object], list[str]]] = [
    # The slice must give 287.5 us at gap count 63 and 223.4 us at 7. Short by less than that: a register is enough.
    ({"cycle__period_us": 550.0}, ["bus.gap_count"]),
    ({"cycle__period_us": 350.0, "bus__gap_count": 7}, ["cycle.slice_ratio"]),
    ({"cycle__period_us": 300.0}, ["cycle.slice_ratio", "bus.gap_count"]),
    ({"cycle__period_us": 100.0, "bus__gap_count": 7}, ["cycle.period_us", "cycle.slice_ratio"]),
    ({"bus__gap_count": 0}, ["bus.gap_count"]),
    ({"bus__cable_length_m": 10.0, "cycle__period_us": 500.0}, ["cycle.slice_ratio"]),
    ({"limits": {"max_utilisation": 0.3}, "cycle__period_us": 1200.0}, ["bus.gap_count"]),
    ({"limits": {"min_spare_nodes": 3}, "cycle__period_us": 900.0}, ["cycle.slice_ratio", "bus.gap_count"]),
]


@pytest.mark.parametrize(("changes", "keys"), CASES)
def test_the_cheapest_change_has_these_keys(make: Make, changes: dict[str, object], keys: list[str]) -> None:
    profile = make(**changes)
    verdict = verdicts(capacity(profile))[0]
    assert verdict.change is not None
    assert list(verdict.change.changes) == keys
    assert verdict.change.nodes == profile.bus.nodes
    assert verdict.change.figures == figures(override(profile, dict(verdict.change.changes)), model="standard")
    assert (verdict.change.figures.verdict, verdict.change.figures.safe) == (FITS, True)


@pytest.mark.parametrize("changes", [*(changes for changes, _ in CASES), {}])
def test_capacity_check_and_plan_name_the_same_change(make: Make, changes: dict[str, object]) -> None:
    profile = make(**changes)
    (verdict,) = verdicts(capacity(profile))
    document = Document("a.toml", profile_text(profile))
    messages = [one.message for one in check_document(document).findings if "cheapest cure: " in one.message]
    best = plan(profile).recommended
    assert best is not None
    assert verdict.change is not None
    said = ", ".join(f"{key} = {short_text(value)}" for key, value in best.changes.items())
    assert {message.rpartition("cheapest cure: ")[2] for message in messages} == ({said} if best.changes else set())
    # Where all is well, `capacity` names what `plan` does for another node.
    if not best.changes:
        best = plan(profile, wanted={"bus.nodes": verdict.change.nodes}).recommended
    assert best is not None
    assert verdict.change.changes == best.changes


def test_more_nodes_get_the_gap_count_of_all_of_them(make: Make) -> None:
    (verdict,) = verdicts(capacity(make(cycle__period_us=1000.0)))
    change = verdict.change
    assert change is not None
    # 500 us: three nodes need 424.4 us at gap count 63, four 565.4.
    assert verdict.deciding.safe_nodes == 3
    assert (change.nodes, change.changes) == (4, {"bus.gap_count": safe_gap_count(4)})
    assert (change.figures.safe_nodes or 0) >= 4


def test_more_nodes_of_a_tree_are_as_many_as_the_gap_count_of_its_hops_carries(make: Make) -> None:
    (verdict,) = verdicts(capacity(make(cycle__period_us=1000.0, bus__max_hops=3)))
    assert verdict.change is not None
    assert verdict.change.changes == {"bus.gap_count": 8}
    assert verdict.change.figures.safe_nodes == 4


@pytest.mark.parametrize("name", shipped_names())
def test_advice_for_shipped_profiles_is_safe(name: str) -> None:
    profile = load(name).profile
    change = verdicts(capacity(profile))[0].change
    assert change is None or is_safe(profile, change)


def test_no_gap_count_is_advised_for_cables_that_the_table_does_not_know(make: Make) -> None:
    changes = cure(make(cycle__period_us=550.0, bus__cable_length_m=20.0)).changes
    assert changes is not None
    assert "bus.gap_count" not in changes


def test_nothing_is_advised_where_the_standard_ends(make: Make) -> None:
    (verdict,) = verdicts(capacity(make(cycle__period_us=1e6)))
    assert (verdict.all_well, verdict.change) == (True, None)
    assert verdict.no_change.startswith("17 hops are over the 16 of one bus (a tree with")
    (verdict,) = verdicts(capacity(make(bus__nodes=20)))
    assert verdict.change is None
    assert verdict.no_change.startswith("20 hops are over the 16 of one bus (a tree with")


ROUND_ONE = {"servo": {"step_us": 100.0}, "tolerance": {"max_contour_error_mm": 0.1}}


@pytest.fixture
def tested_us(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Periods of the circles that are simulated; all fail but those of whole milliseconds."""
    found: list[float] = []

    def run(_self: CircleCheck, profile: Profile) -> tuple[str, ...]:
        found.append(profile.cycle.period_us)
        return () if profile.cycle.period_us % 1000.0 == 0 else ("rough",)

    monkeypatch.setattr(CircleCheck, "_run", run)
    return found


@pytest.mark.parametrize("period_us", [200.0, 300.0, 1000.0])
def test_capacity_simulates_no_circle_and_says_so_where_its_change_gives_another(
    make: Make, tested_us: list[float], period_us: float
) -> None:
    profile = make(cycle__period_us=period_us, **ROUND_ONE)
    (verdict,) = verdicts(capacity(profile))
    assert tested_us == []
    assert verdict.change is not None
    # 200 us must become 300, and 300 us are enough with other settings of the bus: the circle of a node is the same.
    assert verdict.change.changes.get("cycle.period_us") == (300.0 if period_us == 200.0 else None)
    assert verdict.change.circle_is_untested == (period_us == 200.0)
    text = " ".join(map(sentence_text, verdict_sentences(verdict, profile)))
    assert (UNTESTED_CIRCLE in text) == (period_us == 200.0)


def test_without_a_circle_nobody_misses_its_test(make: Make) -> None:
    (verdict,) = verdicts(capacity(make(cycle__period_us=200.0)))
    assert verdict.change is not None
    assert "cycle.period_us" in verdict.change.changes
    assert not verdict.change.circle_is_untested


@pytest.mark.parametrize(
    ("circle_steps", "tests_us", "failures"), [(None, [], None), (10, [], None), (10**9, [300.0], ("rough",))]
)
def test_a_cure_is_ranked_by_time_and_one_circle_at_most_is_simulated(
    make: Make, tested_us: list[float], circle_steps: int | None, tests_us: list[float], failures: tuple[str] | None
) -> None:
    found = cure(make(cycle__period_us=200.0, **ROUND_ONE), circle_steps=circle_steps)
    assert found.changes is not None
    assert found.changes["cycle.period_us"] == 300.0
    assert (tested_us, found.circle_failures) == (tests_us, failures)


@pytest.mark.parametrize(
    ("with_circle", "said"),
    [
        (False, f"{UNTESTED_CIRCLE}; cheapest cure: cycle.period_us = 300"),
        (True, "it fits, and then rough; `plan` tries more"),
    ],
)
def test_check_never_says_more_of_the_circle_of_a_cure_than_was_tested(
    make: Make, tested_us: list[float], with_circle: bool, said: str
) -> None:
    document = Document("a.toml", profile_text(make(cycle__period_us=200.0, **ROUND_ONE)))
    (finding,) = (one for one in check_document(document, with_circle=with_circle).findings if one.code == "BP101")
    assert said in finding.message
    assert (finding.cure is None) == with_circle
    assert tested_us == [300.0] * with_circle


def test_a_step_that_does_not_divide_the_period_is_the_cause_and_its_own_cure() -> None:
    profile = override(load("ethercat-servo-8").profile, {"servo.step_us": 300.0})
    (verdict,) = verdicts(capacity(profile))
    assert not verdict.all_well
    assert verdict.change is not None
    assert verdict.change.changes == {"servo.step_us": 250.0}
    assert verdict.change.circle_is_untested
    cause, headline, *_ = map(sentence_text, verdict_sentences(verdict, profile))
    assert cause.startswith("The circle of ethercat-servo-8 cannot be run at 1 ms: servo.step_us = 300")
    assert ", the bus alone: fits." in headline
    best = plan(profile).recommended
    assert best is not None
    assert best.changes == {"servo.step_us": 250.0}
    kept = plan(profile, wanted={"servo.step_us": 300.0}, free=["slice_ratio"])
    assert kept.binding is not None
    assert kept.binding.key == "servo.step_us"
    assert {one.relaxed: one.changes for one in kept.relaxations}["step"] == {"servo.step_us": 250.0}


@pytest.mark.parametrize("own", ["paper", "standard"])
def test_one_model_decides_whichever_leads(make: Make, own: str) -> None:
    # 220 us: paper needs 197.0 and standard 253.2, of which all doubts take no more than 27.7.
    profile = make(cycle__period_us=440.0, bus__timing_model=own)
    verdict = verdicts(capacity(profile))[0]
    assert (verdict.deciding.timing_model, verdict.deciding.verdict) == ("standard", DOES_NOT_FIT)
    assert [(one.timing_model, one.fits, one.verdict) for one in verdict.others] == [("paper", True, None)]
    assert not verdict.models_agree
    assert verdict.change is not None
    after = figures(override(profile, dict(verdict.change.changes)), model="standard")
    assert (after.verdict, after.safe) == (FITS, True)


@pytest.mark.parametrize(("period_us", "agree"), [(4000.0, True), (440.0, False)])
def test_another_model_asked_for_alone_does_not_decide(make: Make, period_us: float, agree: bool) -> None:
    profile = make(cycle__period_us=period_us)
    verdict = verdicts(capacity(profile, timing_models=["paper"]))[0]
    assert verdict.deciding == figures(profile, model="standard")
    assert [one.timing_model for one in verdict.others] == ["paper"]
    assert verdict.models_agree == agree


@pytest.mark.parametrize(("period_us", "keys"), [(560.0, ["bus.gap_count"]), (580.0, [])])
def test_what_fits_but_is_not_shown_to_gets_advice_too(make: Make, period_us: float, keys: list[str]) -> None:
    # 280 and 290 us: both over the 253.2 us that are needed, and only one over the 287.5 us that show it.
    profile = make(cycle__period_us=period_us)
    assert figures(profile, model="standard").fits
    assert list(cure(profile).changes or {}) == keys


@pytest.mark.parametrize("period_us", [300.0, 4000.0])
def test_a_gap_count_that_no_table_cures_is_not_advised_away(make: Make, period_us: float) -> None:
    # The table holds for cables of 4.5 m: nobody knows what is safe at 10 m.
    found = cure(make(bus__gap_count=0, bus__cable_length_m=10.0, cycle__period_us=period_us))
    assert found.changes is None
    assert "for cables of more than 4.5 m none is known to be safe" in found.why


def test_a_loop_on_the_node_that_lacks_its_margin_is_tried_once(make: Make) -> None:
    # Its margins know neither the period nor the bus: no other period is worth a test.
    unstable = make(cycle__period_us=200.0, servo={"step_us": 100.0, "position_gain_per_s": 30_000.0})
    runs = []

    class Counted(CircleCheck):
        def _run(self, profile: Profile) -> tuple[str, ...]:
            runs.append(profile)
            return super()._run(profile)

    circle = Counted()
    failures = [circle(override(unstable, {"cycle.period_us": period_us})) for period_us in (600.0, 900.0, 4000.0)]
    assert len(set(failures)) == 1
    assert failures[0]
    assert len(runs) == 1
    for gain in (14_000.0, 30_000.0):
        one = override(unstable, {"servo.position_gain_per_s": gain})
        margins = {
            (each.stable, each.phase_margin_deg, each.gain_margin_db)
            for each in circle_test(one, periods_us=[600.0, 900.0, 4000.0], explain=False).results
        }
        assert len(margins) == 1


def test_more_nodes_of_a_loaded_can_bus_take_a_longer_period() -> None:
    profile = override(load("can-servo-8").profile, {"limits.max_load": 0.6})
    (verdict,) = verdicts(capacity(profile))
    assert (verdict.all_well, verdict.deciding.safe_limited_by) == (True, "load")
    assert verdict.change is not None
    assert (verdict.change.nodes, verdict.change.changes) == (9, {"cycle.period_us": 4250.0})
