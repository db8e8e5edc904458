"""The circle test of a profile: bus first, then stability, then tolerances, and what to attack."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from math import cos
from typing import Any

import pytest

import busplan
from tests.registers import shipped_of_each_kind

Make = Callable[..., busplan.Profile]

# Section IV-B: mean and largest contour error in mm, execution time in s.
PUBLISHED = {"paper-4ms": (0.0036, 0.0187, 48.656), "paper-1ms": (0.0049, 0.0219, 12.164)}


@pytest.fixture
def small(make: Make) -> busplan.Profile:
    """A quick circle: 25 mm at 3 m/min, a P loop on an ideal drive."""
    return make(
        circle={"radius_mm": 25.0, "feed_mm_per_min": 3000.0, "ramp_periods": 20},
        cycle__period_us=2000.0,
        servo={"velocity_feedforward": 0.0, "position_gain_per_s": 50.0},
    )


def changed(profile: busplan.Profile | str, changes: Mapping[str, object]) -> busplan.Profile:
    return busplan.load_profile(profile, changes=changes)


def only(profile: busplan.Profile, *, contributions: bool = False) -> Any:
    return busplan.circle_test(profile, contributions=contributions).results[0]


def figures(profile: busplan.Profile, model: str = "standard") -> Any:
    return busplan.capacity(profile, timing_model=model).results[0]


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_papers_test(name: str) -> None:
    mean_mm, max_mm, duration_s = PUBLISHED[name]
    result = only(busplan.load_profile(name))
    assert result.duration_s == duration_s
    assert result.setpoints == 12164
    assert result.mean_contour_error_mm == pytest.approx(mean_mm, rel=0.02)
    assert result.max_contour_error_mm == pytest.approx(max_mm, rel=0.02)
    # The weakest of calibrated, published and assumed values.
    assert result.servo_grade == "assumed"
    assert result.passed
    # The paper's move is no whole turn.
    assert (result.path, result.circular_deviation_mm, result.settled) == ("trapezoid", None, None)


@pytest.mark.parametrize("name", shipped_of_each_kind())
def test_every_shipped_profile_runs_and_passes_what_it_asks_for(name: str) -> None:
    profile = busplan.load_profile(name)
    result = only(profile)
    assert result.failures == ()
    assert result.passed is (True if profile.asks_for_circle and result.sources_matter else None)


def test_steady_radius_of_two_p_loops_is_the_closed_form(small: busplan.Profile) -> None:
    result = only(small)
    w_over_kp = 3000 / 60 / 25 / 50
    assert result.radius_deviation_mm == pytest.approx(25 * (1 / (1 + w_over_kp**2) ** 0.5 - 1), rel=0.01)
    assert result.failures == ()


def test_a_cycle_that_does_not_fit_fails_before_any_simulation(small: busplan.Profile) -> None:
    test = busplan.circle_test(changed(small, {"bus.nodes": 16, "cycle.period_us": 500}))
    result = test.results[0]
    capacity = figures(changed(small, {"bus.nodes": 16, "cycle.period_us": 500}))
    assert test.runs == (None,)
    assert (result.bus_fits, result.passed, result.stable) == (False, False, None)
    assert [(failure.name, failure.value, failure.limit) for failure in result.failures] == [
        ("required_us", capacity.required_us, capacity.available_us)
    ]
    assert (result.max_contour_error_mm, result.phase_margin_deg, result.centre_offset_mm) == (None, None, None)
    assert result.setpoints > 0


def test_one_model_decides_whether_there_is_a_circle(small: busplan.Profile) -> None:
    # 250 us lie between the 197.0 that paper needs and the 253.2 of standard.
    tight = changed(small, {"cycle.period_us": 500, "servo.step_us": 100})
    result = only(tight)
    assert (result.timing_model, result.bus_fits, result.stable) == ("standard", False, None)
    assert figures(tight, "paper").fits


def test_a_circle_that_the_bus_is_not_shown_to_carry_is_simulated_and_fails(small: busplan.Profile) -> None:
    # 280 us: over the 253.2 that are needed, under the 287.5 that show it.
    tight = changed(small, {"cycle.period_us": 560, "servo.step_us": 80, "bus.cycle_master": False})
    result, capacity = only(tight), figures(tight)
    assert (result.bus_fits, result.verdict, result.stable, result.passed) == (True, "not shown to fit", True, False)
    assert [(failure.name, failure.value, failure.limit) for failure in result.failures] == [
        ("safe_required_us", capacity.safe_required_us, capacity.available_us)
    ]
    assert result.failures[0].text == (
        "the cycle is not shown to fit the bus: with bias, uncertainty and reserve it needs 287.499 us of 280.000 us"
    )
    # 290 us show it.
    assert only(changed(tight, {"cycle.period_us": 580, "servo.step_us": 20})).verdict == "fits"


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"bus.nodes": 63, "bus.max_hops": 2, "cycle.period_us": 100_000}, "nodes"),
        ({"bus.nodes": 17, "cycle.period_us": 100_000}, "hops"),
        ({"payload.write_bytes": 3000, "cycle.period_us": 100_000}, "payload"),
    ],
)
def test_limits_of_the_standard_fail_by_name(small: busplan.Profile, changes: dict[str, object], name: str) -> None:
    result = only(changed(small, {**changes, "circle.feed_mm_per_min": 10, "circle.ramp_periods": 1}))
    assert [failure.name for failure in result.failures] == [name]


def test_an_unstable_loop_fails_whatever_its_circle(small: busplan.Profile) -> None:
    # A P loop on an ideal drive is unstable from kp T = 2 on.
    unstable = changed(small, {"servo.position_gain_per_s": 25_000})
    result = only(unstable)
    assert (result.stable, result.passed) == (False, False)
    assert [failure.name for failure in result.failures] == ["stability"]
    assert result.phase_margin_deg is result.gain_margin_db is None


def test_a_loop_with_too_little_margin_fails_however_round_its_circle(small: busplan.Profile) -> None:
    result = only(changed(small, {"servo.position_gain_per_s": 15_000, "servo.velocity_feedforward": 1.0}))
    assert result.stable
    assert {failure.name for failure in result.failures} >= {"min_gain_margin_db"}
    assert result.max_contour_error_mm is not None
    assert result.max_contour_error_mm < 1e-3


def test_the_host_loop_has_one_period_of_delay_inside(small: busplan.Profile) -> None:
    # Paper, III-C: the synchronous packet triggers the sample and the update with the last command.
    node, host = (only(changed(small, {"servo.loop": loop})) for loop in ("node", "host"))
    assert (host.update, host.delay_us, host.delay_x_us, host.delay_y_us) == ("next_sync", 2000.0, 2000.0, 2000.0)
    assert node.delay_us == 0.0
    assert node.phase_margin_deg is not None
    assert host.phase_margin_deg is not None
    assert host.phase_margin_deg < node.phase_margin_deg
    # The delay makes the circle better while it eats the margin.
    assert abs(host.radius_deviation_mm or 0.0) < abs(node.radius_deviation_mm or 0.0)


def test_the_papers_loop_on_the_host_fails_by_its_margin_and_names_the_key() -> None:
    result = only(changed("paper-4ms", {"servo.loop": "host"}))
    assert result.delay_us == 4000.0
    assert result.phase_margin_deg == pytest.approx(12.93, abs=0.005)
    failures = {failure.name: failure for failure in result.failures}
    assert failures["min_phase_margin_deg"].is_default
    text = " ".join(failure.text for failure in result.failures)
    assert "under its 30 deg (default)" in text
    assert text.count("servo.update") == 1


def test_a_command_applied_on_arrival_costs_each_node_its_own_time(small: busplan.Profile) -> None:
    on_arrival = changed(small, {"servo.loop": "host", "servo.update": "on_arrival", "bus.nodes": 3})
    result = only(on_arrival)
    commands: dict[int | None, float] = {}
    for event in busplan.timeline(on_arrival).cycle_events:
        if event.transaction == "write" and event.kind in ("request_data", "execution"):
            commands[event.node] = event.end_us
    assert (result.delay_x_us, result.delay_y_us) == pytest.approx((commands[1], commands[3]))
    assert 0 < result.delay_x_us < result.delay_y_us == result.delay_us < result.required_us
    # Nodes without an execution on the bus have their command with its packet.
    unified = only(changed(on_arrival, {"node.write_response": "unified"}))
    assert 0 < unified.delay_y_us < result.delay_y_us
    # Two delays make an ellipse of two equal loops; one delay leaves the chords, (F T)^2 / (8 r) = 50 nm inside.
    turned = changed(on_arrival, {"circle.path": "iso230-4"})
    assert (only(turned).circular_deviation_mm or 0.0) > 200e-6
    assert (only(changed(turned, {"bus.nodes": 1})).circular_deviation_mm or 1.0) < 50e-6


def test_matched_axes_do_not_see_a_delay_outside_the_loop(small: busplan.Profile) -> None:
    # A skew of the two axes does show; the same skew of both would not.
    small = changed(small, {"circle.path": "iso230-4"})
    skewed = changed(small, {"delivery.skew_us": 50})
    assert (only(skewed).circular_deviation_mm or 0.0) > (only(small).circular_deviation_mm or 0.0) + 1e-4


def test_tolerances_fail_by_name_value_and_limit(small: busplan.Profile) -> None:
    tight = changed(
        small,
        {
            "circle.path": "iso230-4",
            "tolerance.mean_contour_error_mm": 1e-6,
            "tolerance.max_contour_error_mm": 1e-6,
            "tolerance.circular_deviation_mm": 1e-9,
            "tolerance.min_phase_margin_deg": 179.0,
        },
    )
    result = only(tight)
    assert [failure.name for failure in result.failures] == [
        "min_phase_margin_deg",
        "mean_contour_error_mm",
        "max_contour_error_mm",
        "circular_deviation_mm",
    ]
    for failure in result.failures[1:]:
        assert failure.value == getattr(result, failure.name)
        assert failure.limit == getattr(tight.tolerance, failure.name)
    # A contour that fails asks for its sources by itself.
    assert result.contributions is not None


def test_a_tolerance_of_exactly_the_error_holds(small: busplan.Profile) -> None:
    error_mm = only(small).max_contour_error_mm
    assert only(changed(small, {"tolerance.max_contour_error_mm": error_mm})).passed


def test_contributions_find_the_one_source(small: busplan.Profile) -> None:
    ideal = changed(small, {"servo.velocity_feedforward": 1.0})
    cases: tuple[tuple[dict[str, object], str], ...] = (
        ({"mechanics.backlash_mm": 0.01}, "backlash"),
        ({"mechanics.squareness_um_per_m": 200}, "squareness"),
        ({"mechanics.scale_x_ppm": 200}, "scale"),
        ({"servo.y.drive_offset_mm_s": 0.5}, "drive_offset"),
        ({"servo.interpolation": "hold"}, "hold"),
        ({"delivery.skew_us": 100}, "skew"),
        ({"delivery.loss_probability": 0.1}, "loss"),
    )
    for changes, source in cases:
        result = only(changed(ideal, changes), contributions=True)
        assert result.contributions is not None
        first = result.contributions[0]
        assert first.source == source, changes
        assert first.removed_mm == pytest.approx((result.max_contour_error_mm or 0.0) - first.max_contour_error_mm)
        assert first.removed_mm > 0


def test_contributions_are_ranked_and_only_of_sources_that_are_there(small: busplan.Profile) -> None:
    rough = changed(
        small, {"servo.drive_lag_us": 3000, "servo.drive_offset_mm_s": 0.3, "servo.y.position_gain_per_s": 45.0}
    )
    result = only(rough, contributions=True)
    assert result.contributions is not None
    removed = [source.removed_mm for source in result.contributions]
    assert removed == sorted(removed, reverse=True)
    assert {source.source for source in result.contributions} == {
        "velocity_feedforward",
        "drive_lag",
        "drive_offset",
        "axis_mismatch",
        "period",
    }
    chords = only(changed(small, {"servo.velocity_feedforward": 1.0}), contributions=True).contributions
    assert [source.source for source in chords or ()] == ["period"]


def test_the_chords_of_the_period_are_a_source(small: busplan.Profile) -> None:
    # Set-points w T apart on an ideal drive: chords that lie r (1 - cos(w T / 2)) inside.
    coarse = changed(small, {"servo.velocity_feedforward": 1.0, "cycle.period_us": 20_000, "circle.ramp_periods": 2})
    result = only(coarse, contributions=True)
    chord_mm = 25 * (1 - cos(50 / 25 * 0.02 / 2))
    assert result.max_contour_error_mm == pytest.approx(chord_mm, rel=0.02)
    (source,) = result.contributions
    assert source.source == "period"
    assert source.removed_mm == pytest.approx(chord_mm, rel=0.02)


def test_acceleration_feedforward_is_a_source(small: busplan.Profile) -> None:
    wrong = changed(small, {"servo.velocity_feedforward": 1.0, "servo.acceleration_feedforward_s": 0.01})
    assert only(wrong, contributions=True).contributions[0].source == "acceleration_feedforward"


def test_what_is_attacked_first_takes_most_of_the_measure_that_failed(small: busplan.Profile) -> None:
    # The lag makes the circle too small, which G does not see; the scale makes it oval.
    rough = changed(
        small,
        {
            "circle.path": "iso230-4",
            "servo.velocity_feedforward": 0.0,
            "mechanics.scale_x_ppm": 300,
            "mechanics.scale_y_ppm": -300,
        },
    )
    for measure, source in (("max_contour_error_mm", "velocity_feedforward"), ("circular_deviation_mm", "scale")):
        result = only(changed(rough, {f"tolerance.{measure}": 1e-4}))
        contribution, removed_mm = result.to_attack
        assert contribution.source == source
        assert removed_mm == pytest.approx(getattr(result, measure) - getattr(contribution, measure))
        assert removed_mm > 0


def test_a_margin_that_fails_has_no_source(small: busplan.Profile) -> None:
    result = only(changed(small, {"tolerance.min_phase_margin_deg": 179.0}), contributions=True)
    assert not result.passed
    assert result.to_attack is None


def test_a_bus_that_does_not_fit_needs_no_path(small: busplan.Profile) -> None:
    # A path of so many steps has no room in memory.
    huge = {"cycle.period_us": 1.0, "servo.step_us": 1.0, "circle.radius_mm": 10_000.0}
    result = only(changed(small, huge))
    assert [failure.name for failure in result.failures] == ["required_us"]
    assert result.setpoints == result.steps > 1e9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"delivery.jitter_us": 1500}, "jitter_us = 1500"),
        ({"servo.y.max_velocity_mm_s": 10}, "axis y reaches"),
        ({"servo.step_us": 0.001}, "step_us = 0.001"),
        (
            {"servo.step_us": 0.4},
            r"circles of 2 periods take [0-9,]{10} steps together, more than 12,000,000; give fewer",
        ),
    ],
)
def test_all_periods_are_checked_before_the_first_is_simulated(
    small: busplan.Profile, changes: dict[str, object], message: str
) -> None:
    simulated: list[int] = []
    with pytest.raises(busplan.BusplanError, match=message):
        busplan.circle_test(
            changed(small, changes), period_us=[4000.0, 2000.0], progress=lambda done, _total: simulated.append(done)
        )
    assert simulated == []


def test_progress_never_runs_back_and_ends_at_its_total(small: busplan.Profile) -> None:
    seen: list[tuple[int, int]] = []
    busplan.circle_test(
        changed(small, {"servo.drive_offset_mm_s": 0.1}),
        contributions=True,
        progress=lambda done, total: seen.append((done, total)),
    )
    assert seen == sorted(seen)
    assert seen[-1][0] == seen[-1][1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"circle.feed_mm_per_min": 60_000}, "feed_mm_per_min = 60000"),
        ({"servo.y.max_velocity_mm_s": 10}, "axis y reaches"),
        ({"circle.feed_mm_per_min": 29_999, "circle.ramp_periods": 1000}, "ramp"),
    ],
)
def test_what_cannot_be_simulated_is_refused_by_name(
    small: busplan.Profile, changes: dict[str, object], message: str
) -> None:
    with pytest.raises(busplan.BusplanError, match=message):
        busplan.circle_test(changed(small, changes))


def dial_of(test: busplan.CircleTestAnswer) -> Any:
    """The drawn circle: smallest and largest radius of the path in each sector, the nominal radius is 1."""
    return next(panel.plot for panel in test.drawing().panels if hasattr(panel.plot, "inner"))


def test_the_error_around_the_circle_lies_between_f_min_and_f_max(small: busplan.Profile) -> None:
    test = busplan.circle_test(changed(small, {"servo.reversal_mm_s": 2.0}))
    result, dial = test.results[0], dial_of(test)
    least, most = (
        min(radius for radius in dial.inner if radius is not None) - 1,
        max(radius for radius in dial.outer if radius is not None) - 1,
    )
    assert result.radial_deviation_min_mm is not None
    assert result.radial_deviation_max_mm is not None
    assert least / most == pytest.approx(result.radial_deviation_min_mm / result.radial_deviation_max_mm)


@pytest.mark.parametrize("ramp_periods", [20, 600])
def test_the_ramps_leave_a_part_of_the_circle_without_an_error(small: busplan.Profile, ramp_periods: int) -> None:
    test = busplan.circle_test(changed(small, {"circle.ramp_periods": ramp_periods}))
    gaps = [radius is None for radius in dial_of(test).inner]
    assert 0 < sum(gaps) < len(gaps)
    # It is one part, about the x axis.
    assert sum(here != after for here, after in pairwise((*gaps, gaps[0]))) == 2
    assert (gaps[0] or gaps[-1], gaps[len(gaps) // 2]) == (True, False)


@pytest.mark.parametrize(
    "changes",
    [
        {"servo.velocity_feedforward": 1e6},
        {"delivery.loss_probability": 1.0},
        {"mechanics.backlash_mm": 100.0},
        {"servo.position_gain_per_s": 1e-9},
    ],
)
def test_a_table_that_does_not_go_round_fails(small: busplan.Profile, changes: dict[str, object]) -> None:
    result = only(changed(small, changes))
    assert result.stable
    (failure,) = (failure for failure in result.failures if failure.name == "circle_not_followed")
    assert failure.limit == 360
    assert "did not follow the circle" in failure.text


@pytest.mark.parametrize("direction", ["ccw", "cw"])
@pytest.mark.parametrize("ramp_periods", [0, 20])
def test_a_following_error_is_no_lack_of_following(small: busplan.Profile, direction: str, ramp_periods: int) -> None:
    lagging = {"circle.direction": direction, "circle.ramp_periods": ramp_periods, "servo.position_gain_per_s": 10}
    assert only(changed(small, lagging)).failures == ()


def test_each_margin_is_the_smaller_one_of_both_axes(small: busplan.Profile) -> None:
    # A high gain costs x its gain margin, a lag costs y its phase margin.
    x = {"servo.x.position_gain_per_s": 15_000}
    y = {"servo.y.position_gain_per_s": 50, "servo.y.drive_lag_us": 60_000}
    both = only(changed(small, {**x, **y}))
    on_x, on_y = (
        only(changed(small, {key.replace(".x.", ".").replace(".y.", "."): value for key, value in axis.items()}))
        for axis in (x, y)
    )
    phases, gains = ([getattr(axis, name) for axis in (on_x, on_y)] for name in ("phase_margin_deg", "gain_margin_db"))
    assert phases.index(min(phases)) != gains.index(min(gains))
    assert (both.phase_margin_deg, both.gain_margin_db) == (min(phases), min(gains))
    assert both.crossover_hz == (on_x, on_y)[phases.index(min(phases))].crossover_hz


def test_a_short_arc_at_constant_speed_has_no_centre(small: busplan.Profile) -> None:
    # Ramps of 0.6 s take a good half turn between them.
    result = only(changed(small, {"circle.ramp_periods": 600}))
    assert result.failures == ()
    assert result.constant_speed_deg is not None
    assert 100 < result.constant_speed_deg < 270
    assert (result.centre_offset_mm, result.radius_deviation_mm) == (None, None)


def test_a_tolerance_of_g_fails_without_a_whole_turn_and_names_the_way_out(small: busplan.Profile) -> None:
    arc = changed(small, {"tolerance.circular_deviation_mm": 1.0})
    result = only(arc)
    (failure,) = result.failures
    assert (failure.name, failure.value, failure.limit) == ("circular_deviation_mm", None, 1.0)
    assert 'set circle.path = "iso230-4"' in failure.text
    # It is no error of the circle: nothing is to be attacked.
    assert (result.to_attack, result.contributions) == (None, None)
    assert only(changed(arc, {"circle.path": "iso230-4"})).failures == ()


@pytest.mark.parametrize("gain", [10, 50])
def test_equal_axes_have_no_circular_deviation_however_slowly_they_settle(small: busplan.Profile, gain: float) -> None:
    # R 50 mm at 6000 mm/min and 1 ms: chords lie (F T)^2 / (8 r) = 25 nm inside.
    turn = {
        "circle.path": "iso230-4",
        "circle.radius_mm": 50,
        "circle.feed_mm_per_min": 6000,
        "cycle.period_us": 1000,
        "servo.position_gain_per_s": gain,
        "tolerance.circular_deviation_mm": 0.02,
    }
    result = only(changed(small, turn))
    assert (result.settled, result.failures, result.constant_speed_deg) == (True, (), 360.0)
    assert (result.circular_deviation_mm or 1.0) <= 25e-6


def test_a_lead_in_as_long_as_the_tolerance_asks_for(small: busplan.Profile) -> None:
    slow = {"circle.path": "iso230-4", "circle.radius_mm": 1.0, "servo.position_gain_per_s": 5.0}
    longest, shorter, shortest = (
        only(changed(small, {**slow, **tolerance})).setpoints
        for tolerance in (
            {"tolerance.circular_deviation_mm": 0.001, "tolerance.mean_contour_error_mm": 0.5},
            {},
            {"tolerance.circular_deviation_mm": 1.0, "tolerance.mean_contour_error_mm": 0.0},
        )
    )
    assert longest > shorter > shortest


def test_a_loop_that_does_not_settle_fails_and_its_turn_is_not_measured(small: busplan.Profile) -> None:
    # The pole of a small integral gain lies near ki / kp = 0.01 1/s.
    slow = {
        "circle.path": "iso230-4",
        "servo.integral_gain_per_s2": 0.5,
        "tolerance.circular_deviation_mm": 1.0,
    }
    result = only(changed(small, slow))
    assert (result.settled, result.stable, result.passed) == (False, True, False)
    (failure,) = result.failures
    assert (failure.name, failure.limit, failure.text) == (
        "not_settled",
        60.0,
        "the loops and their friction take more than 60 s to settle, so that the turn is not measured",
    )
    assert (result.circular_deviation_mm, result.max_contour_error_mm, result.centre_offset_mm) == (None, None, None)
    # Nor is it said how far the table went on it.
    behind = changed(small, {**slow, "servo.integral_gain_per_s2": 0.0, "servo.drive_lag_us": 1e9})
    assert "not_settled" in (names := [failure.name for failure in only(behind).failures])
    assert "circle_not_followed" not in names
    # The paper's move has no turn to settle for.
    assert only(changed(small, {**slow, "circle.path": "trapezoid"})).settled is None


def test_a_profile_that_asks_for_nothing_is_not_judged(make: Make) -> None:
    profile = make()
    assert not profile.asks_for_circle
    result = only(profile)
    assert (result.passed, result.failures, result.ideal_drive) == (None, (), True)
    # What always judges still does.
    assert only(make(servo={"position_gain_per_s": 25_000.0})).passed is False


def test_the_weakest_grade_of_the_values_that_are_given_counts(make: Make) -> None:
    given = {"position_gain_per_s": 50.0, "drive_lag_us": 1000.0, "grade": "measured"}
    for grades, weakest in (
        ({}, "measured"),
        ({"drive_lag_us": "assumed"}, "assumed"),
        ({"drive_lag_us": "calibrated", "position_gain_per_s": "published"}, "calibrated"),
        # A default may be graded, too, but not what is not there.
        ({"velocity_feedforward": "calibrated", "dac_bits": "assumed"}, "calibrated"),
    ):
        assert only(make(servo={**given, "grades": grades})).servo_grade == weakest
    assert only(make(servo={"x": {"drive_lag_us": 1.0}, "grades": {"drive_lag_us": "published"}})).servo_grade == (
        "published"
    )


def test_a_long_test_says_what_it_costs_before_it_runs(
    small: busplan.Profile, caplog: pytest.LogCaptureFixture
) -> None:
    class StoppedError(Exception):
        pass

    def stop(_done: int, _total: int) -> None:
        raise StoppedError

    only(small, contributions=True)
    assert caplog.messages == []
    long = {"circle.radius_mm": 3_500.0, "servo.step_us": 50.0, "servo.drive_offset_mm_s": 0.1}
    with pytest.raises(StoppedError):
        busplan.circle_test(changed(small, long), contributions=True, progress=stop)
    (message,) = caplog.messages
    # 219,932 set-points, 40 steps each, both axes; the same without each of two sources.
    assert message.startswith("circle test: 52,783,680 steps, about ")
    assert message.endswith(("GB", "GB, in plain Python"))


def test_a_failure_without_a_value_is_null_and_says_why() -> None:
    # Behind the load of 2.23 no message of a low priority has a worst-case response time.
    test = busplan.circle_test(changed("can-servo-8", {"cycle.period_us": 1000.0}), contributions=True)
    (result,) = test.to_dict()["results"]
    assert "null" in test.to_json()
    late = {failure["name"]: failure for failure in result["failures"]}
    assert late["deadline"]["value"] is None
    assert late["deadline"]["text"] == "sdo-request and 2 more have no worst-case response time"
    assert late["required_us"]["value"] == 2950.0


def findings(profile: busplan.Profile) -> Any:
    (file,) = busplan.check(profile).files
    return file.findings


def test_a_skew_that_is_too_long_is_refused_at_the_clock_that_is_missing() -> None:
    # Twenty devices with frames of their own: the last frame arrives most of a period behind the first.
    changes = {"bus.nodes": 20, "payload.write_bytes": 400, "payload.read_bytes": 1000, "cycle.period_us": 3000.0}
    profile = changed("ethercat-servo-8", {**changes, "bus.distributed_clocks": False})
    with pytest.raises(
        busplan.BusplanError, match=r"bus\.distributed_clocks = false: the last axis then takes its set-points"
    ):
        busplan.circle_test(profile)
    assert [finding.key for finding in findings(profile) if finding.code == "BP203"] == ["bus.distributed_clocks"]


@pytest.mark.parametrize("key", ["skew_us", "jitter_us"])
def test_a_circle_that_is_refused_names_the_key_that_was_set(key: str) -> None:
    found = findings(changed("paper-1ms", {"delivery": {key: 600.0}}))
    assert [finding.key for finding in found if finding.code == "BP203"] == [f"delivery.{key}"]


def test_what_the_bus_lacks_is_said_of_the_bus_alone() -> None:
    profile = changed("gantry-24", {"limits.reserve": 0.6})
    assert "safe_required_us" in {failure.name for failure in busplan.circle_test(profile).results[0].failures}
    found = {finding.code for finding in findings(profile)}
    assert "BP114" in found
    assert "BP201" not in found
