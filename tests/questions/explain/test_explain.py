"""Derivations: each ends in the figure that the command gives, and each line reads back as its result."""

import re
from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses.ieee1394.constants import c
from busplan.forms import terminal
from busplan.profile.kinds import cycle_keys
from busplan.questions.fit.figures import capacity_figures
from busplan.questions.fit.network import network_of
from busplan.sections.base import value_at
from tests.registers import shipped_of_each_kind

Make = Callable[..., busplan.Profile]
GRADES = ("assumed", "recalled", "calibrated", "derived", "measured", "published", "given")
ARITHMETIC = re.compile(r"[-+*/^() .\de]+")
SHOWN = ["paper-1ms", "gantry-24", "dvrk", "can-servo-8", "ethercat-servo-8", "sercos2-servo-8", "sercos3-servo-8"]
DECIDED = {"bias_us", "margin_corrected_us", "uncertainty_us", "safe_required_us", "safe_min_period_us"}
"""Figures of the timing model that decides, and of no other."""


def derived(profile: Any, figure: str, **asked: Any) -> Any:
    """The first derivation of a figure."""
    return busplan.explain(profile, figure, **asked).derivations[0]


def figures(profile: busplan.Profile, model: str) -> dict[str, Any]:
    """Figures under a timing model, also where it has no term for a key, which `capacity` refuses."""
    return capacity_figures(network_of(profile), model=model).values()


def names(derivation: Any) -> set[str]:
    return {given.name for given in derivation.inputs}


# --- what is derived is what was computed -----------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_of_each_kind())
def test_every_figure_of_every_kind_ends_in_its_value_and_begins_at_graded_inputs(name: str) -> None:
    profile = busplan.load_profile(name)
    results = {one.timing_model: one.values() for one in busplan.capacity(profile).results}
    for command, figure in busplan.explain(profile).figures:
        for one in busplan.explain(profile, f"{command}.{figure.key}").derivations:
            if command == "capacity":
                assert one.value == pytest.approx(results[one.timing_model][one.figure.key], rel=1e-12)
            assert not one.steps or (one.steps[-1].key, one.steps[-1].value) == (one.figure.key, one.value)
            assert {given.grade for given in one.inputs} <= set(GRADES)
            assert all(given.source and given.meaning and given.name for given in one.inputs)
            assert one.weakest_grade == min((given.grade for given in one.inputs), key=GRADES.index, default="given")


@given(data=st.data())
def test_every_line_in_numbers_reads_back_as_its_result(
    data: st.DataObject, any_profile: st.SearchStrategy[busplan.Profile]
) -> None:
    profile = data.draw(any_profile)
    command, figure = data.draw(st.sampled_from(busplan.explain(profile).figures))
    for step in derived(profile, f"{command}.{figure.key}").steps:
        if ARITHMETIC.fullmatch(step.numbers):
            scale = max(map(abs, map(float, re.findall(r"[\d.]+(?:e[-+]?\d+)?", step.numbers))), default=1.0)
            found = eval(step.numbers.replace("^", "**"))
            assert found == pytest.approx(step.value, rel=1e-5, abs=1e-5 * scale), (step.symbol, step.numbers)


def test_a_line_has_the_digits_that_it_takes_to_see_its_answer(make: Make) -> None:
    needed_us = figures(make(), "paper")["required_us"]
    for factor in (1 - 1e-9, 1 + 1e-9):
        one = derived(make(cycle__period_us=needed_us * 2 * factor), "margin_us", timing_model="paper")
        assert eval(one.steps[-1].numbers) == pytest.approx(one.value, rel=1e-3)


def test_equation_2_adds_up_every_term_of_the_cycle(make: Make) -> None:
    both = "CTS + arbitration + data + acknowledge + execution + worst extra + idle"
    terms = {
        "paper": f"{both} + T_npd",
        "standard": f"J + cycle starts + {both} + host + retries + T_npd",
    }
    for model, formula in terms.items():
        needed = derived(make(), "required_us", timing_model=model).steps[-1]
        assert (needed.symbol, needed.reference, needed.formula) == ("T_need", "(2)", formula)
        each = derived(make(), "required_time_slice_us", timing_model=model).steps[-1]
        added = "" if model == "paper" else " + (J + cycle starts + retries) / N"
        assert (each.symbol, each.reference) == ("T_cs,needed", "(2)")
        assert each.formula == f"(T_r + T_w + T_npd + CTS) / N{added}"


def test_all_equations_are_explained_by_their_numbers() -> None:
    for number in range(1, 16):
        assert busplan.explain("paper-4ms", f"({number})").derivations


def test_equations_are_those_of_the_kind_whatever_was_loaded() -> None:
    with_all, shared = (
        {row["function"] for row in busplan.explain(name).equations} for name in ("paper-1ms", "can-servo-8")
    )
    assert shared == {"time_slice_us", "required_time_slice_us"}
    assert with_all > shared


def test_the_rows_of_csv_are_the_steps_of_json() -> None:
    answer = busplan.explain("paper-4ms", "required_us", timing_model=["paper", "standard"])
    keys = ("reference", "symbol", "formula", "numbers", "value", "unit")
    steps = [
        (derivation["timing_model"], number, *(step[key] for key in keys))
        for derivation in answer.to_dict()["derivations"]
        for number, step in enumerate(derivation["steps"], start=1)
    ]
    rows = [tuple(row[key] for key in ("timing_model", "step", *keys)) for row in answer.report().records or ()]
    assert rows == steps
    assert len(rows) > 30


def test_the_corrected_margin_comes_with_its_uncertainty() -> None:
    found = busplan.explain("paper-1ms", "margin_corrected_us").derivations
    assert [one.figure.key for one in found] == ["margin_corrected_us", "uncertainty_us"]


@pytest.mark.parametrize(
    ("size", "kind", "sources"),
    [
        (4, "read", {"QUADLET_READ_REQUEST_BYTES", "QUADLET_READ_RESPONSE_BYTES"}),
        (4, "write", {"QUADLET_WRITE_REQUEST_BYTES", "WRITE_RESPONSE_BYTES"}),
        (12, "read", {"BLOCK_READ_REQUEST_BYTES", "BLOCK_READ_RESPONSE_OVERHEAD_BYTES"}),
        (12, "write", {"BLOCK_WRITE_REQUEST_OVERHEAD_BYTES", "WRITE_RESPONSE_BYTES"}),
    ],
)
def test_each_packet_of_the_standard_names_its_own_source(make: Make, size: int, kind: str, sources: set[str]) -> None:
    profile = make(payload__read_bytes=size, payload__write_bytes=size)
    one = derived(profile, "latency_us", timing_model="standard", transaction=kind)
    assert {name for name in names(one) if "REQUEST" in name or "RESPONSE" in name} == sources


# --- a figure changes with its inputs, and with nothing else ----------------------------------------------

OTHER: dict[str, object] = {
    "bus.gap_count": 21,
    "cycle.period_us": 1200.0,
    "bus.cycle_master": True,
    "limits.reserve": 0.3,
    "node.response_us": 0.5,
    "node.execution.residual": "standard",
    "node.execution.grade": "derived",
    "node.execution.measured_gap_count": 21,
}
"""Another legal value of what has no larger one."""
FORMS = ("bus.speed", "bus.cycle_master", "node.read_response", "node.write_response")
"""Words and truths that choose other formulas: the formulas themselves show them, and no input does."""
ALL_IN: dict[str, Any] = {"host": {"transaction_us": 25.0}, "cycle__retries": 1, "node__execution__grade": "assumed"}
"""What makes every time count; a key that is not set is no input."""
EXACT = ("required_us", "margin_us", "min_slice_ratio", "utilisation", "sync_us", "read_latency_us")


def another(profile: busplan.Profile, key: str) -> busplan.Profile | None:
    """The profile with another value of a key; None where nothing of it can differ alone."""
    value: Any = profile
    for part in key.split("."):
        value = getattr(value, part)
    if key == "bus.isochronous_us" and not value_at(profile, "bus.cycle_master"):
        return None
    if key in OTHER:
        return busplan.load_profile(profile, changes={key: OTHER[key]})
    if not isinstance(value, (int, float)):
        return None
    larger = value + 1 if isinstance(value, int) else value * 1.25 + 0.001
    return busplan.load_profile(profile, changes={key: larger})


def changing(profile: busplan.Profile, model: str, keys: Iterable[str]) -> set[tuple[str, str]]:
    """Figures with the keys that change them."""
    before = figures(profile, model)
    others = {key: other for key in keys if (other := another(profile, key)) is not None}
    after = {key: figures(other, model) for key, other in others.items()}
    return {(name, key) for name in before for key in after if after[key][name] != before[name]}


@pytest.mark.parametrize("model", ["paper", "standard"])
def test_a_figure_changes_with_each_of_its_inputs_and_with_nothing_else(make: Make, model: str) -> None:
    given = ALL_IN if model == "standard" else {}
    # What takes time longer may bring one more cycle start: an input of each sum, though it seldom does.
    alone = make(**given, bus__cycle_master=False)
    decided = ("bias_us", "uncertainty_us", "safe_required_us") if model == "standard" else ()
    for profile, figures in ((make(**given), EXACT), (alone, (*EXACT, *decided))):
        found = changing(profile, model, [key for key in cycle_keys(profile) if key not in FORMS])
        for figure in figures:
            keys = {name for name in names(derived(profile, figure, timing_model=model)) if "." in name}
            assert keys == {key for name, key in found if name == figure}, figure


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"node__execution__uncertainty_us": 0.5}, "node.execution.uncertainty_us"),
        ({"host": {"transaction_us": 30.0, "uncertainty_us": 0.5}}, "host.uncertainty_us"),
        ({"node__execution__grade": "measured"}, "node.execution.grade"),
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
def test_each_key_is_an_input_of_what_it_changes(make: Make, changes: dict[str, Any], key: str) -> None:
    assert key in names(derived(make(**changes), "safe_required_us"))


# --- how well it is known ---------------------------------------------------------------------------------


def test_the_weakest_grade_is_that_of_the_least_known_input(make: Make) -> None:
    assert derived(make(bus__cycle_master=False), "required_us").weakest_grade == "recalled"
    assumed = make(node__execution__grade="assumed")
    assert derived(assumed, "required_us").weakest_grade == "assumed"
    assert derived(assumed, "available_us").weakest_grade == "published"
    assert derived(assumed, "period_us").weakest_grade == "given"


def test_a_default_is_as_well_known_as_its_source(make: Make) -> None:
    for profile, known in (
        (make(), ("measured", "default, as paper, section IV-A")),
        (make(cycle__sync__ping_us=0.4), ("given", "profile test")),
    ):
        inputs = {one.name: one for one in derived(profile, "sync_us", timing_model="paper").inputs}
        assert (inputs["cycle.sync.ping_us"].grade, inputs["cycle.sync.ping_us"].source) == known


def test_the_verdict_rests_on_constants_of_both_models_and_on_limits_the_least_known_first() -> None:
    found = {one.name: one for one in busplan.explain("paper-4ms").assumptions}
    assert {"ARBITRATION_HOLD_US", "BASE_RATE_MBIT_S", "PHY_DELAY_TICKS", "MAX_PAYLOAD_BYTES[S400]"} <= set(found)
    assert found["node.execution.time_us"].grade == "derived"
    for name, one in found.items():
        if name in c:
            known = c[name]
            assert (one.value, one.grade, one.source) == (known, known.grade, known.source)
    grades = [grade for grade, _ in groupby(one.grade for one in found.values())]
    assert grades == sorted(grades, key=GRADES.index)
    assert "given" not in grades
    assert not [name for name in found if name.startswith(("servo.", "circle."))]


def test_an_execution_time_that_nobody_graded_comes_first(make: Make) -> None:
    first, *others = busplan.explain(make()).assumptions
    assert (first.name, first.grade) == ("node.execution.base_us", "given")
    assert "given" not in {one.grade for one in others[1:]}
    measured = make(node__execution__grade="measured", bus__cycle_master=False)
    first, second, *_ = busplan.explain(measured).assumptions
    assert (first.name, first.grade, second.grade) == ("PHY_DELAY_HALF_WIDTH_US", "assumed", "recalled")


# --- finding a figure -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("profile", "name", "figures", "transactions"),
    [
        ("paper-1ms", "required_us", ["required_us"], [None]),
        ("paper-1ms", "capacity.required_us", ["required_us"], [None]),
        ("paper-1ms", "latency.gaps_us", ["gaps_us"], ["read", "write"]),
        ("paper-1ms", "(11)", ["nodes_eq11"], [None]),
        ("paper-1ms", "11", ["nodes_eq11"], [None]),
        ("paper-1ms", "(12)", ["interval_latency_us"], ["read", "write"]),
        ("paper-1ms", "arbitration", ["cycle_arbitration_us"], [None]),
        ("paper-1ms", "synchronous packet CTS", ["sync_us"], [None]),
        ("paper-1ms", "T_sum", ["gaps_us"], [None]),
        ("paper-1ms", "read", ["transaction_us"], ["read"]),
        ("gantry-24", "drives", ["transaction_us"], ["drives read", "drives write"]),
        ("can-servo-8", "sdo-request", ["worst_response_us"], ["sdo-request"]),
        ("can-servo-8", "SDO request", ["worst_response_us"], ["sdo-request"]),
        ("can-servo-8", "blocking", ["cycle_blocking_us"], [None]),
        ("ethercat-servo-8", "loop", ["end_to_end_us"], ["loop"]),
    ],
)
def test_a_figure_is_found_by_what_it_is_called(
    profile: str, name: str, figures: list[str], transactions: list[str | None]
) -> None:
    found = busplan.explain(profile, name).derivations
    assert list(dict.fromkeys(one.figure.key for one in found)) == figures
    assert [one.transaction for one in found] == transactions


@pytest.mark.parametrize(
    ("profile", "name", "said"),
    [
        ("paper-1ms", "requird_us", "requird_us: no such figure, did you mean required_us"),
        ("can-servo-8", "sdo", "did you mean sdo-request or sdo-response?"),
        ("can-servo-8", "heart", "did you mean heartbeats?"),
        ("gantry-24", "drive", "did you mean drives"),
        ("paper-1ms", "", "'': no such figure; without one, explain --all lists them"),
        ("paper-1ms", "circle-test.required_us", "no such figure"),
        ("paper-1ms", "(99)", "no such figure"),
        # Searches, comparisons and words have no equation.
        *(("paper-1ms", name, f"{name}: no equation leads to it in paper-1ms") for name in ("max_nodes", "verdict")),
        ("sercos2-servo-8", "bias_us", "bias_us: no equation leads to it in sercos2-servo-8"),
    ],
)
def test_what_has_no_equation_is_refused_with_what_it_may_have_been(profile: str, name: str, said: str) -> None:
    with pytest.raises(busplan.BusplanError, match=re.escape(said)):
        busplan.explain(profile, name)


def test_only_what_can_be_explained_is_listed() -> None:
    listed = {name: {figure.key for _, figure in busplan.explain(name).figures} for name in SHOWN}
    for keys in listed.values():
        assert {"required_us", "uncertainty_us", "available_us"} <= keys
        assert not {"max_nodes", "fits", "verdict", "limited_by", "timing_model", "transaction"} & keys
    assert "bias_us" in listed["paper-1ms"]
    assert "bias_us" not in listed["sercos2-servo-8"]


def test_periods_models_and_transactions_multiply() -> None:
    found = busplan.explain("paper-4ms", "latency_us", period_us=[1000, 2000], timing_model=["paper", "standard"])
    assert len({(one.period_us, one.timing_model, one.transaction) for one in found.derivations}) == 8
    assert {derived("paper-4ms", key).timing_model for key in DECIDED} == {"standard"}
    assert derived("paper-4ms", "uncertainty_us", timing_model=["paper", "standard"]).timing_model == "standard"


@pytest.mark.parametrize(
    ("figure", "asked", "said"),
    [
        ("uncertainty_us", {"timing_model": "paper"}, "exists only in the timing model that decides, standard"),
        ("required_us", {"transaction": "read"}, "required_us: a figure of capacity, which has no transactions"),
        ("gaps_us", {"transaction": "read"}, "which has no transactions; latency.gaps_us has"),
        ("latency_us", {"transaction": "raed"}, "transaction 'raed': expected 'read' or 'write'"),
        (None, {"period_us": 100, "transaction": "read"}, "period_us and transaction: needs a figure"),
        (3, {}, 'figure 3: expected a key of the JSON, as "required_us"'),
    ],
)
def test_what_a_figure_has_no_choice_of_is_refused(figure: Any, asked: Any, said: str) -> None:
    with pytest.raises(busplan.BusplanError, match=re.escape(said)):
        busplan.explain("paper-4ms", figure, **asked)


# --- how it is shown --------------------------------------------------------------------------------------


def test_a_step_says_nothing_twice_and_inputs_that_are_the_same_stand_once() -> None:
    text = str(busplan.explain("paper-1ms", "hops"))
    assert "H = N: a chain with the host at its end\n                      = 2\n" in text
    both = str(busplan.explain("paper-1ms", "latency.gaps_us", timing_model="standard"))
    assert both.count("Inputs of this figure") == 1
    assert "Inputs: as for gaps_us, read, standard model." in both


@pytest.mark.slow
@pytest.mark.parametrize("width", [40, 60, 80])
def test_no_line_is_longer_than_the_terminal(width: int) -> None:
    for name in ("gantry-24", "can-servo-8"):
        for figure in (None, "margin_corrected_us", "uncertainty_us"):
            lines = terminal.text(busplan.explain(name, figure).report(), width=width).splitlines()
            assert max(map(len, lines)) <= width, figure


def test_the_lines_of_the_card_are_names_and_the_margin_names_the_one_that_decides() -> None:
    def keys(name: str) -> list[str]:
        return [found.figure.key for found in busplan.explain("gantry-24", name).derivations]

    assert keys("used") == ["required_us", "bias_us"]
    assert keys("free") == ["margin_corrected_us", "uncertainty_us"]
    assert keys("fastest period") == ["safe_min_period_us"]
    assert "The verdict uses margin_corrected_us, 932.012 us." in str(busplan.explain("gantry-24", "margin"))
