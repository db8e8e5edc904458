"""Derivations: each ends in the figure that the command gives, and each line reads back as its result."""

import re
from collections.abc import Callable, Iterable
from functools import partial
from itertools import groupby
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.buses import kind_named
from busplan.buses.ieee1394.constants import CONSTANTS
from busplan.buses.ieee1394.timing import TIMING_MODELS, TimingModelName
from busplan.elementwise import Traced
from busplan.errors import BusplanError
from busplan.profile.kinds import cycle_keys
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.questions.capacity.report import capacity_document, capacity_records
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.circle.figures import CircleFigures
from busplan.questions.circle.roundness import circle_test
from busplan.questions.explain.bus import VERDICT_KEYS, capacity_figures, latency_figures
from busplan.questions.explain.circle import circle_figures
from busplan.questions.explain.derivation import assumptions, explain, figure_named, figures_of
from busplan.questions.explain.formulas import inputs
from busplan.questions.fit.figures import capacity, figures
from busplan.questions.latency.figures import latency
from busplan.questions.latency.report import latency_records
from busplan.sections.profile import Profile

MODELS = st.sampled_from(["paper", "standard"])
BUS = kind_named("ieee1394")
FIGURES = figures_of(BUS)
Make = Callable[..., Profile]
GRADES = {"published", "derived", "recalled", "measured", "calibrated", "assumed", "given"}
# The keys of the results in their order, once more by hand: they are stable between releases.
CAPACITY_KEYS = (
    "timing_model", "period_us", "nodes", "axes", "hops", "gap_count", "safe_gap_count", "gap_count_safe",
    "available_us", "required_us", "time_slice_us", "required_time_slice_us", "read_latency_us", "write_latency_us",
    "read_transaction_us", "write_transaction_us", "gaps_us", "subaction_gap_us", "arbitration_reset_gap_us", "sync_us",
    "nonperiodic_us", "cycle_starts_us", "cycle_arbitration_us", "cycle_data_us", "cycle_acknowledge_us",
    "cycle_hold_us", "cycle_execution_us", "cycle_worst_extra_us", "cycle_idle_us", "cycle_host_us", "retries_us",
    "binding_term", "utilisation", "margin_us", "nodes_eq11", "max_nodes", "max_axes", "limited_by", "min_period_us",
    "min_slice_ratio", "exceeded", "fits", "circle_refused_by", "bias_us", "margin_corrected_us", "uncertainty_us",
    "safe_required_us", "safe_nodes", "safe_axes", "safe_limited_by", "safe_min_period_us", "not_shown", "verdict",
)  # fmt: skip
OF_STANDARD = CAPACITY_KEYS[CAPACITY_KEYS.index("bias_us") :]
"""How sure the verdict is: figures of the model that decides, and of no other."""
ARITHMETIC = re.compile(r"[-+*/^() .\de]+")


def value_of(found: Any) -> Any:
    return found.value if isinstance(found, Traced) else found


@given(data=st.data(), model=MODELS)
def test_every_figure_of_capacity_is_derived_as_it_is_computed(
    data: st.DataObject, model: TimingModelName, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    derived, plain = capacity_figures(profile, model=model), figures(profile, model=model)
    for key, value in plain.by_key().items():
        if model == "paper" and key in OF_STANDARD:
            assert value is None
            assert key not in derived
            continue
        assert value_of(derived[key]) == value, key
        assert isinstance(derived[key], Traced), key


@given(data=st.data(), model=MODELS, kind=st.sampled_from(["read", "write"]))
def test_every_figure_of_latency_is_derived_as_it_is_computed(
    data: st.DataObject, model: TimingModelName, kind: Any, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    derived = latency_figures(profile, model=model, kind=kind)
    rows = latency_records(latency(profile, timing_models=[model]))
    row = next(row for row in rows if row["transaction"] == kind)
    for key, value in row.items():
        assert value_of(derived[key]) == value, key


@given(data=st.data(), model=MODELS, key=st.sampled_from(sorted(FIGURES["capacity"])))
def test_every_line_in_numbers_reads_back_as_its_result(
    data: st.DataObject, model: TimingModelName, key: str, any_profile: st.SearchStrategy[Profile]
) -> None:
    profile = data.draw(any_profile)
    models = None if key in (*VERDICT_KEYS, *OF_STANDARD) else [model]
    for step in explain(profile, f"capacity.{key}", timing_models=models).derivations[0].steps:
        if ARITHMETIC.fullmatch(step.numbers):
            scale = max(map(abs, map(float, re.findall(r"[\d.]+(?:e[-+]?\d+)?", step.numbers))), default=1.0)
            found = eval(step.numbers.replace("^", "**"))
            assert found == pytest.approx(step.value, rel=1e-5, abs=1e-5 * scale), (step.symbol, step.numbers)


@pytest.mark.parametrize(
    "name", ["paper-1ms", "gantry-24", "dvrk", "can-servo-8", "ethercat-servo-8", "sercos3-servo-8"]
)
def test_every_input_has_a_grade_a_source_and_a_meaning(name: str) -> None:
    profile = load(name).profile
    for key, models in (("fits", list(TIMING_MODELS)), ("verdict", None), ("safe_nodes", None), ("text", None)):
        for one in explain(profile, key, timing_models=models).derivations:
            assert {given.grade for given in one.inputs} <= GRADES
            assert all(given.source and given.meaning and given.name for given in one.inputs)


def test_the_registry_holds_every_key_of_the_results() -> None:
    (row,) = capacity_records(capacity(load("paper-4ms").profile, timing_models=["paper"]))
    assert tuple(row) == CAPACITY_KEYS
    assert set(FIGURES["capacity"]) == {
        *(
            *CAPACITY_KEYS,
            "models_agree",
            "missed_limits",
            "verdict_after_reset",
            "uncertainty_parts",
            "reserve",
            "not_in_it",
            "not_applicable",
        ),
        *("cheapest_change", "warnings", "text", "sensitivity", "next_bottleneck"),
    }
    assert set(FIGURES["circle-test"]) == set(CircleFigures._fields)
    one, broadcast = (latency_records(latency(load(name).profile))[0] for name in ("paper-4ms", "dvrk"))
    assert list(FIGURES["latency"]) == [key for key in broadcast if key != "group"]
    of_broadcasts = ("query_us", "boards_us", "hub_wait_us")
    assert [key for key in FIGURES["latency"] if key not in of_broadcasts] == list(one)


CIRCLES = {
    "paper-1ms": {},
    "host loop": {"servo.loop": "host", "servo.drive_lag_us": 0.0, "circle.radius_mm": 20.0},
    "unstable": {"servo.loop": "host", "servo.position_gain_per_s": 3000.0, "circle.radius_mm": 20.0},
    "bus too slow": {"cycle.period_us": 200.0},
    "short arc": {"circle.radius_mm": 60.0, "circle.feed_mm_per_min": 10_000.0, "circle.ramp_periods": 2000},
    "other axis": {"servo.x": {"position_gain_per_s": 120.0}, "mechanics.backlash_mm": 0.002, "circle.radius_mm": 20.0},
    "turn": {"circle.path": "iso230-4", "circle.radius_mm": 20.0, "tolerance.circular_deviation_mm": 1e-6},
    "on arrival": {"servo.loop": "host", "servo.update": "on_arrival", "circle.radius_mm": 20.0},
    "misses": {"tolerance.max_contour_error_mm": 0.001, "circle.radius_mm": 20.0, "circle.feed_mm_per_min": 5000.0},
}


@pytest.mark.parametrize("changes", CIRCLES.values(), ids=CIRCLES.keys())
def test_every_figure_of_the_circle_test_is_derived_as_it_is_computed(changes: dict[str, Any]) -> None:
    profile = override(load("paper-1ms").profile, changes)
    derived = circle_figures(profile, with_contributions=True)
    (result,) = circle_test(profile, with_contributions=True).results
    for key, value in result._asdict().items():
        if key == "failures":
            assert derived[key].value == [one.document() for one in value]
        elif key == "contributions":
            assert derived[key].value == (None if value is None else [one._asdict() for one in value])
        else:
            assert derived[key].value == (list(value) if isinstance(value, tuple) else value), key


def test_a_circle_on_the_host_rests_on_the_bus_too() -> None:
    host = {"servo.loop": "host", "circle.radius_mm": 20.0, "node.execution.grade": "assumed"}
    # With the next synchronous packet, one period lies inside the loop, and nothing else of the bus.
    (one,) = explain(override(load("paper-1ms").profile, host), "phase_margin_deg").derivations
    assert "bus.gap_count" not in {given.name for given in one.inputs}
    changes = {**host, "servo.update": "on_arrival"}
    for key in ("mean_contour_error_mm", "circular_deviation_mm", "phase_margin_deg"):
        (one,) = explain(override(load("paper-1ms").profile, changes), key).derivations
        assert "MAX_PAYLOAD_BYTES[S400]" not in {given.name for given in one.inputs}
        assert "bus.gap_count" in {given.name for given in one.inputs}
        assert one.weakest_grade == "assumed"


def test_grades_rank_from_the_weakest() -> None:
    order = ["assumed", "recalled", "calibrated", "derived", "measured", "published", "given"]
    ranked = [one.grade for one in assumptions(load("paper-4ms").profile)]
    assert ranked == sorted(ranked, key=order.index)
    assert {"recalled", "calibrated", "derived", "measured", "published"} <= set(ranked)


def test_an_execution_time_that_nobody_graded_comes_first(make: Make) -> None:
    first, *others = assumptions(make())
    assert (first.name, first.grade) == ("node.execution.base_us", "given")
    assert "given" not in {one.grade for one in others[1:]}
    first, second, *_ = assumptions(make(node__execution__grade="measured"))
    assert (first.name, first.grade, second.grade) == ("PHY_DELAY_HALF_WIDTH_US", "assumed", "recalled")


def test_a_warning_of_cables_rests_on_their_length(make: Make) -> None:
    names = {one.name for one in explain(make(bus__cable_length_m=10.0), "warnings").derivations[0].inputs}
    assert {"bus.cable_length_m", "REFERENCE_CABLE_M"} <= names


def test_limits_and_tables_are_among_what_a_plan_starts_from(make: Make) -> None:
    names = {one.name for one in explain(make(bus__gap_count="optimal"), "fits").derivations[0].inputs}
    assert {"MAX_NODES", "MAX_HOPS", "MAX_PAYLOAD_BYTES[S400]", "GAP_COUNT_TABLE_HOPS", "payload.read_bytes"} <= names


@pytest.mark.parametrize(
    ("size", "kind", "sources"),
    [
        (4, "read", {"QUADLET_READ_REQUEST_BYTES", "QUADLET_READ_RESPONSE_BYTES"}),
        (4, "write", {"QUADLET_WRITE_REQUEST_BYTES", "WRITE_RESPONSE_BYTES"}),
        (12, "read", {"BLOCK_READ_REQUEST_BYTES", "BLOCK_READ_RESPONSE_OVERHEAD_BYTES"}),
        (12, "write", {"BLOCK_WRITE_REQUEST_OVERHEAD_BYTES", "WRITE_RESPONSE_BYTES"}),
    ],
)
def test_each_packet_of_the_standard_names_its_own_source(make: Make, size: int, kind: Any, sources: set[str]) -> None:
    profile = make(payload__read_bytes=size, payload__write_bytes=size)
    (one,) = explain(profile, "latency_us", timing_models=["standard"], transactions=[kind]).derivations
    assert {given.name for given in one.inputs if "REQUEST" in given.name or "RESPONSE" in given.name} == sources


def test_the_papers_two_packets_have_names_of_their_own() -> None:
    (one,) = explain(load("paper-4ms").profile, "response_data_us", transactions=["read"]).derivations
    assert one.steps[-1].formula.endswith("8 B_resp / R")


def test_the_binding_term_is_the_largest_of_what_is_listed(make: Make) -> None:
    step = explain(make(), "binding_term").derivations[0].steps[-1]
    assert step.formula == (
        "the largest of starts, sync, arbitration, data, acknowledge, hold, execution, worst_extra, idle, host, "
        "retries, nonperiodic"
    )
    names = step.formula.removeprefix("the largest of ").split(", ")
    sizes = [float(size) for size in step.numbers.removeprefix("the largest of ").split(", ")]
    assert len(names) == len(sizes)
    assert step.value == names[sizes.index(max(sizes))] == "execution"


def test_equation_2_adds_up_every_term_of_the_cycle(make: Make) -> None:
    terms = {
        "paper": "CTS + arbitration + data + acknowledge + execution + worst extra + idle + T_npd",
        "standard": "CTS + arbitration + data + acknowledge + execution + worst extra + idle + host + retries + T_npd",
    }
    for model, formula in terms.items():
        *_, needed, _ = explain(make(), "required_time_slice_us", timing_models=[model]).derivations[0].steps
        assert needed.formula == formula
    *_, needed, each = explain(make(), "required_time_slice_us", timing_models=["paper"]).derivations[0].steps
    assert (needed.symbol, needed.reference) == ("T_need", "(2)")
    assert (each.symbol, each.reference, each.formula) == ("T_cs,needed", "(2)", "T_need / N")


def test_the_own_keys_of_both_axes_are_among_what_a_circle_starts_from() -> None:
    own: dict[str, object] = {"servo.x": {"position_gain_per_s": 120.0}, "servo.y": {"drive_lag_us": 7000.0}}
    names = {one.name for one in assumptions(override(load("paper-1ms").profile, own))}
    assert {"servo.x.position_gain_per_s", "servo.y.drive_lag_us"} <= names


def test_a_default_of_the_servo_is_assumed_whatever_is_known_of_the_others(make: Make) -> None:
    servo = {"grade": "calibrated", "position_gain_per_s": 50.0, "x": {"drive_lag_us": 1000.0}}
    known = {one.name: (one.grade, one.source) for one in assumptions(make(servo=servo, circle={}))}
    assert known["servo.max_velocity_mm_s"] == ("assumed", "default")
    assert known["servo.position_gain_per_s"] == ("calibrated", "profile test; graded by servo.grade")
    assert known["servo.x.drive_lag_us"][0] == "calibrated"
    graded = make(servo={**servo, "grades": {"max_velocity_mm_s": "published"}}, circle={})
    assert {one.name: one.grade for one in assumptions(graded)}["servo.max_velocity_mm_s"] == "published"


LINEAR: dict[str, object] = {"node.execution": {"kind": "linear", "base_us": 30.0, "per_byte_us": 0.35}}
SMALL: dict[str, object] = {"circle.radius_mm": 20.0, "circle.feed_mm_per_min": 5000.0}
WITHOUT_EQUATION = {
    "capacity.max_nodes": "a search: the largest whole N with T_need <= alpha T_s, within the limits of ",
    "capacity.limited_by": "a search: ",
    "capacity.safe_nodes": "a search: the largest whole N with T_safe <= alpha T_s, on a bus set safely for N, ",
    "capacity.safe_limited_by": "a search: ",
    "capacity.cheapest_change": "a search: the least change of gap count, slice ratio and period that ",
    "capacity.models_agree": "a comparison: ",
    "capacity.text": "sentences ",
    "capacity.warnings": "sentences ",
    "circle-test.setpoints": "a count along the path",
    "circle-test.phase_margin_deg": "the linear position loop of both axes",
    "circle-test.max_contour_error_mm": "a simulation of both axes",
    "circle-test.circular_deviation_mm": "a simulation of both axes",
    "circle-test.contributions": "a simulation of the same circle without each error source in turn",
    "circle-test.passed": "a comparison of bus, loop and simulation",
}


@pytest.mark.parametrize("name", WITHOUT_EQUATION)
def test_what_no_equation_gives_is_one_step_that_says_what_gives_it(name: str) -> None:
    profile = override(load("paper-1ms").profile, SMALL)
    (one,) = explain(profile, name).derivations
    (step,) = one.steps
    assert step.formula.startswith(WITHOUT_EQUATION[name])
    assert (step.numbers, step.value, step.key) == ("", one.value, name.partition(".")[2])
    assert one.inputs


def test_a_figure_of_a_search_is_a_step_of_what_is_computed_from_it(make: Make) -> None:
    most, axes = explain(make(), "max_axes").derivations[0].steps
    assert (most.symbol, most.formula.split(":")[0]) == ("N_max", "a search")
    assert (axes.formula, axes.numbers) == ("axes_node N_max", f"4 * {most.value}")


OTHER: dict[str, object] = {
    "bus.gap_count": 21,
    "cycle.period_us": 1200.0,
    "bus.cycle_master": True,
    "bus.speed": "S200",
    "limits.reserve": 0.3,
    "node.read_response": "concatenated",
    "node.write_response": "unified",
    "node.response_us": 0.5,
    "node.execution.residual": "standard",
    "node.execution.grade": "derived",
    "node.execution.measured_gap_count": 21,
    "circle.direction": "cw",
    "servo.interpolation": "hold",
    "servo.step_us": 50.0,
}
"""Another legal value of what has no larger one."""


TWO_WORDS = (("node", "host"), ("next_sync", "on_arrival"), ("trapezoid", "iso230-4"))
"""Words of a key that has two."""


def another(profile: Profile, key: str) -> Profile | None:
    """The profile with another value of a key; None where nothing of it can differ alone."""
    value: Any = profile
    for part in key.split("."):
        value = getattr(value, part)
    if key == "bus.isochronous_us" and not profile.bus.cycle_master:
        return None
    for words in TWO_WORDS:
        if value in words:
            return override(profile, {key: words[1 - words.index(value)]})
    if key in OTHER:
        return override(profile, {key: OTHER[key]})
    if not isinstance(value, (int, float)):
        return None
    return override(profile, {key: value + 1 if isinstance(value, int) else value * 1.25 + 0.001})


def differing(profile: Profile, known: Callable[[Profile], dict[str, Any]], keys: Iterable[str]) -> set[Any]:
    """Figures with the keys that change them: plain ones, which the derived ones equal."""
    before = known(profile)
    others = {key: other for key in keys if (other := another(profile, key)) is not None}
    after = {key: known(other) for key, other in others.items()}
    return {(name, key) for name in before for key in after if after[key][name] != before[name]}


def capacity_of(profile: Profile, model: str) -> dict[str, Any]:
    return figures(profile, model=model).by_key()


def circle_of(profile: Profile) -> dict[str, Any]:
    return circle_test(profile, explain=False).results[0]._asdict()


FORMS = ("bus.speed", "bus.cycle_master", "node.read_response", "node.write_response")
"""Words and truths that choose other formulas: the formulas themselves show them, and no input does."""


def resting(derived: dict[str, Traced], names: Iterable[str]) -> set[Any]:
    """Figures with the keys of the profile among their inputs."""
    return {(name, one.name) for name in names for one in inputs(derived[name]) if "." in one.name}


ALL_IN: dict[str, Any] = {
    "host": {"transaction_us": 25.0},
    "cycle__retries": 1,
    "node__execution__grade": "assumed",
}
"""What makes every time count; a key that is not set is no input."""
OF_CERTAINTY = ("limits.reserve", "node.execution.residual", "node.execution.grade")


@pytest.mark.parametrize("model", TIMING_MODELS)
def test_a_figure_changes_with_each_of_its_inputs_and_with_nothing_else(make: Make, model: str) -> None:
    profile = make(**ALL_IN)
    keys = [key for key in cycle_keys(profile) if key not in FORMS]
    changing = differing(profile, partial(capacity_of, model=model), keys)
    derived = capacity_figures(profile, model=model)
    given = resting(derived, derived)
    exact = ["required_us", "margin_us", "min_slice_ratio", "utilisation", "sync_us", "axes", "read_latency_us"]
    # The others are whole or words: a little more of an input need not show.
    for name in [*exact, "bias_us", "uncertainty_us", "safe_required_us"] if model == "standard" else exact:
        assert {key for one, key in given if one == name} == {key for one, key in changing if one == name}, name
    assert changing <= given
    assert {("max_nodes", "cycle.period_us"), ("max_nodes", "bus.gap_count"), ("fits", "cycle.period_us")} <= given
    assert not {("max_nodes", "bus.nodes"), ("max_nodes", "node.axes")} & given
    if model == "standard":
        assert not {("safe_nodes", "bus.nodes"), ("safe_nodes", "node.axes")} & given
        for key in ("verdict", "safe_nodes", "safe_required_us"):
            assert {(key, one) for one in OF_CERTAINTY} <= given


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"node__execution__uncertainty_us": 0.5}, "node.execution.uncertainty_us"),
        ({"host": {"transaction_us": 30.0, "uncertainty_us": 0.5}}, "host.uncertainty_us"),
        ({"node__execution__grade": "measured"}, "node.execution.grade"),
        ({"node__execution__grade": "derived"}, "node.execution.grade"),
        (
            {"node__execution__residual": "standard", "node__execution__measured_gap_count": 50},
            "node.execution.measured_gap_count",
        ),
        ({"bus__cycle_master": True, "bus__isochronous_us": 10.0}, "bus.isochronous_us"),
        ({"bus__phy_delay_us": 0.144}, "bus.phy_delay_us"),
        ({"node__read_response": "concatenated"}, "node.response_us"),
        ({"cycle__retries": 2}, "cycle.retries"),
        ({"node__execution__worst_extra_us": 3.1}, "node.execution.worst_extra_us"),
    ],
)
def test_each_new_key_is_an_input_of_what_it_changes(make: Make, changes: dict[str, Any], key: str) -> None:
    profile = make(**changes)
    changing = differing(profile, partial(capacity_of, model="standard"), [key]) if "grade" not in key else set()
    derived = capacity_figures(profile, model="standard")
    assert changing <= resting(derived, derived)
    assert {("safe_required_us", key), ("verdict", key), ("safe_nodes", key)} <= resting(derived, derived)


@pytest.mark.parametrize(
    "place",
    [
        {"servo.loop": "node", "circle.path": "iso230-4"},
        {"servo.loop": "host", "servo.update": "on_arrival", "mechanics.backlash_mm": 0.002},
    ],
    ids=["node", "host"],
)
def test_a_figure_of_the_circle_changes_with_each_of_its_inputs_and_with_nothing_else(place: dict[str, Any]) -> None:
    profile = override(load("paper-1ms").profile, {**SMALL, **LINEAR, **place, "servo.drive_lag_us": 2000.0})
    sections = ("circle", "servo", "delivery", "mechanics", "tolerance")
    own = {f"{section}.{key}" for section in sections for key, value in getattr(profile, section) if value}
    changing = differing(profile, circle_of, {*cycle_keys(profile), *own} - set(FORMS))
    given = resting(circle_figures(profile), FIGURES["circle-test"])
    assert changing <= given
    # The lead-in of a turn is a whole number of turns: a loop that settles a little later shows nothing.
    counts = () if "circle.path" in place else ("setpoints", "steps")
    for name in ("max_contour_error_mm", "phase_margin_deg", *counts, "delay_us"):
        # A circle the other way round, a speed never reached, and a host faster than the gaps may show nothing.
        unseen = {"circle.direction", "servo.max_velocity_mm_s", "host.transaction_us"}
        # The delay of a command rests on the cycle, of which some parts come behind it, and is one period at most.
        unseen |= {"cycle.retries", "cycle.nonperiodic_us", *(("cycle.period_us",) if name == "delay_us" else ())}
        assert {key for one, key in given - changing if one == name} <= unseen


def test_periods_models_and_transactions_multiply() -> None:
    profile = load("paper-4ms").profile
    found = explain(profile, "latency_us", periods_us=[1000.0, 2000.0], timing_models=["paper", "standard"])
    assert len({(one.period_us, one.timing_model, one.transaction) for one in found.derivations}) == 8
    for figure in ("circle-test.required_us", "uncertainty_us"):
        for models in (None, ["standard"]):
            decided = explain(profile, figure, timing_models=models)
            assert [one.timing_model for one in decided.derivations] == ["standard"]


@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("circle-test.required_us", {"timing_models": ["paper", "standard"]}),
        ("circular_deviation_mm", {"timing_models": ["paper"]}),
        ("safe_nodes", {"timing_models": ["paper"]}),
        ("required_us", {"transactions": ["read"]}),
        ("models_agree", {"timing_models": ["standard"]}),
    ],
)
def test_what_a_figure_has_no_choice_of_is_refused(name: str, asked: Any) -> None:
    with pytest.raises(BusplanError, match=r"no other, standard|not a figure of latency|no timing model of its own"):
        explain(load("paper-4ms").profile, name, **asked)


def test_the_weakest_grade_is_that_of_the_least_known_input(make: Make) -> None:
    assert explain(make(), "required_us").derivations[0].weakest_grade == "recalled"
    assumed = make(node__execution__grade="assumed")
    assert explain(assumed, "required_us").derivations[0].weakest_grade == "assumed"
    assert explain(assumed, "available_us").derivations[0].weakest_grade == "published"
    assert explain(assumed, "period_us").derivations[0].weakest_grade == "given"


def test_a_default_is_as_well_known_as_its_source(make: Make) -> None:
    by_name = {one.name: one for one in explain(make(bus__timing_model="paper"), "sync_us").derivations[0].inputs}
    assert by_name["cycle.sync.ping_us"].grade == "measured"
    assert by_name["cycle.sync.ping_us"].source == "default, as paper, section IV-A"
    given = make(cycle__sync__ping_us=0.4)
    own = {one.name: one for one in explain(given, "sync_us", timing_models=["paper"]).derivations[0].inputs}
    assert (own["cycle.sync.ping_us"].grade, own["cycle.sync.ping_us"].source) == ("given", "profile test")


def test_assumptions_name_every_constant_of_both_models_and_of_the_circle() -> None:
    found = {one.name: one for one in assumptions(load("paper-4ms").profile)}
    assert {"ARBITRATION_HOLD_US", "DATA_END_US", "BASE_RATE_MBIT_S", "PHY_DELAY_TICKS"} <= set(found)
    assert found["servo.position_gain_per_s"].grade == "calibrated"
    assert found["node.execution.time_us"].grade == "derived"
    for name, one in found.items():
        if name in CONSTANTS:
            assert (one.value, one.grade, one.source) == (
                CONSTANTS[name],
                CONSTANTS[name].grade,
                CONSTANTS[name].source,
            )
    order = [one.grade for one in assumptions(load("paper-4ms").profile)]
    assert [grade for grade, _ in groupby(order)][:3] == ["assumed", "recalled", "calibrated"]
    assert found["servo.encoder_resolution_mm"].grade == "assumed"
    assert found["servo.encoder_resolution_mm"].source.endswith("graded by servo.grades.encoder_resolution_mm")
    assert "given" not in order
    assert found["cycle.sync.ping_us"].grade == "measured"


@pytest.mark.parametrize("name", ["required_us", "capacity.required_us"])
def test_a_figure_is_found_by_its_key(name: str) -> None:
    assert figure_named(name, bus=BUS)[0] == "capacity"


def test_the_command_before_a_key_decides() -> None:
    assert figure_named("circle-test.required_us", bus=BUS)[0] == "circle-test"
    assert figure_named("circular_deviation_mm", bus=BUS)[0] == "circle-test"


@pytest.mark.parametrize(
    ("name", "said"), [("requird_us", "did you mean required_us"), ("", "no such figure"), ("circle-test.fits", "fits")]
)
def test_an_unknown_figure_is_refused_with_what_it_may_have_been(name: str, said: str) -> None:
    with pytest.raises(BusplanError, match=said):
        figure_named(name, bus=BUS)


def test_the_verdicts_keys_are_all_known() -> None:
    profile = load("paper-4ms").profile
    result = capacity(profile)
    verdict = capacity_document(result, verdicts(result))["verdicts"][0]
    assert set(verdict) <= set(FIGURES["capacity"])


def test_a_line_has_the_digits_that_it_takes_to_see_its_answer(make: Make) -> None:
    needed_us = figures(make(), model="paper").required_us
    for factor, fits in ((1 - 1e-9, False), (1 + 1e-9, True)):
        profile = make(cycle__period_us=needed_us * 2 * factor)
        (one,) = explain(profile, "fits", timing_models=["paper"]).derivations
        left, right = re.findall(r"[\d.]+", one.steps[-1].numbers.partition(",")[0])
        assert (float(left) <= float(right)) == fits == one.value
        (one,) = explain(profile, "margin_us", timing_models=["paper"]).derivations
        assert eval(one.steps[-1].numbers) == pytest.approx(one.value, rel=1e-3)
