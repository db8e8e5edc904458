"""Why a circle cannot be run: by its key, before any is run, and alike in every answer that is about the circle."""

from pathlib import Path

import pytest

import busplan
from busplan.errors import BusplanError
from busplan.questions.fit.circle_setup import delivery_of, loop_delays_us
from busplan.questions.fit.network import network_of

CAUSES: dict[str, dict[str, object]] = {
    "circle.feed_mm_per_min": {"circle.feed_mm_per_min": 1e6},
    "servo.y.drive_offset_mm_s": {"servo.y": {"drive_offset_mm_s": 1e6}},
    "servo.encoder_resolution_mm": {"servo.encoder_resolution_mm": 1e-12},
    "servo.step_us": {"servo.step_us": 0.01},
    "delivery.jitter_us": {"delivery.jitter_us": 501.0},
}


def changed(changes: dict[str, object]) -> busplan.Profile:
    return busplan.load_profile("paper-1ms", changes=changes)


def refused_keys(profile: busplan.Profile) -> list[str]:
    """Keys that a check names, without running a circle."""
    (file,) = busplan.check(profile, circle=False).files
    return sorted(finding.message.partition(": ")[0] for finding in file.findings if finding.code == "BP203")


@pytest.mark.parametrize(("key", "changes"), CAUSES.items())
def test_every_answer_about_the_circle_names_the_key(key: str, changes: dict[str, object]) -> None:
    profile = changed(changes)
    with pytest.raises(BusplanError) as caught:
        busplan.circle_test(profile)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{key} = ")
    (file,) = busplan.check(profile, circle=False).files
    (finding,) = (finding for finding in file.findings if finding.code == "BP203")
    cause = problem.removeprefix(f"{key} = ").partition("; ")[0]
    assert key in finding.message
    assert cause in finding.message
    with pytest.raises(BusplanError) as caught:
        busplan.sweep(profile, vary={"bus.nodes": [1, 2]}, circle=True)
    assert caught.value.problems == (f"at bus.nodes = 1: {problem}",)
    own = busplan.map_(profile, x={"bus.nodes": [1, 2]}, y={"cycle.period_us": [1000]}, circle=True).design
    assert own is not None
    assert (own.state, own.reasons) == ("circle cannot be run", (key,))


def test_messages_alone_have_no_circle(tmp_path: Path) -> None:
    file = tmp_path / "car.toml"
    file.write_text("""schema_version = 1
name = "car"
bus = {kind = "can", bit_rate_kbit_s = 500}
message = [{name = "m", identifier = 1, payload_bytes = 8, period_us = 10000}]
""")
    with pytest.raises(BusplanError) as caught:
        busplan.circle_test(busplan.load_profile(file))
    assert caught.value.problems == ("bus.nodes = none: messages alone have no axes that could move",)


@pytest.mark.parametrize("changes", CAUSES.values())
def test_answers_about_the_bus_say_nothing_of_a_circle(changes: dict[str, object]) -> None:
    own, plain = changed(changes), busplan.load_profile("paper-1ms")
    assert busplan.capacity(own).to_dict()["verdicts"] == busplan.capacity(plain).to_dict()["verdicts"]
    assert busplan.plan(own).recommended_changes == busplan.plan(plain).recommended_changes


@pytest.mark.parametrize(
    ("changes", "keys"),
    [
        ({"circle.path": "trapezoid", "circle.radius_mm": 0.01}, ["circle.feed_mm_per_min"]),
        ({"circle.path": "trapezoid", "circle.radius_mm": 1e6}, ["circle.feed_mm_per_min", "servo.step_us"]),
        ({"circle.path": "iso230-4", "circle.radius_mm": 1e6}, ["circle.feed_mm_per_min", "servo.step_us"]),
        # Too long for memory with the longest lead-in that there is, and not with its own.
        ({"circle.path": "iso230-4", "servo.step_us": 4}, []),
    ],
)
def test_a_move_is_too_short_or_too_long_as_the_simulation_has_it(changes: dict[str, object], keys: list[str]) -> None:
    assert refused_keys(changed(changes)) == keys


def test_a_cycle_that_does_not_fit_has_no_circle_to_be_refused() -> None:
    late: dict[str, object] = {"delivery.jitter_us": 90.0, "circle.feed_mm_per_min": 1e6}
    assert refused_keys(changed({**late, "cycle.period_us": 100.0})) == []
    assert refused_keys(changed(late)) == ["circle.feed_mm_per_min"]


def test_a_step_that_does_not_divide_the_period_is_the_longest_that_does() -> None:
    # 1000 us in steps of up to 300 us: four of 250 us.
    shorter, given = (busplan.circle_test(changed({"servo.step_us": step_us})) for step_us in (300.0, 250.0))
    assert shorter.results == given.results
    assert refused_keys(changed({"servo.step_us": 300.0})) == []


@pytest.mark.parametrize("loop", ["node", "host"])
@pytest.mark.parametrize("has_clocks", [False, True])
def test_nodes_with_a_common_clock_or_a_loop_on_the_host_add_no_skew(loop: str, has_clocks: bool) -> None:
    changes = {"servo.loop": loop, "bus.distributed_clocks": has_clocks, "delivery.skew_us": 2.0}
    network = network_of(busplan.load_profile("ethercat-servo-8", changes=changes))
    added_us = delivery_of(network).skew_us - 2
    # From the first node to the last there are seven cables and ports.
    assert added_us > 7 * 0.5 if loop == "node" and not has_clocks else added_us == 0


def test_a_slower_drive_of_sercos_samples_sooner_and_acts_later() -> None:
    changes = {"servo.loop": "host", "servo.update": "on_arrival"}
    execution = {"kind": "linear", "per_byte_us": 0, "grade": "measured"}
    before_us, after_us = (
        loop_delays_us(
            network_of(
                busplan.load_profile(
                    "sercos2-servo-8", changes={**changes, "node.execution": {**execution, "base_us": us}}
                )
            )
        )
        for us in (100, 130)
    )
    assert after_us == pytest.approx([us + 2 * 30 for us in before_us])
