"""Why a circle cannot be run: by its key, before any is run, and alike in every answer that is about the circle."""

from math import log, pi
from pathlib import Path

import pytest

import busplan
from busplan.buses import kind_named
from busplan.errors import BusplanError
from busplan.questions.fit.circle_setup import (
    delivery_of,
    loop_delays_us,
    path_setpoints,
    path_settling_us,
    path_steps,
    refusals,
)
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
        # Too long with its own: of a loop of 0.5 / s, 42 s.
        ({"circle.path": "iso230-4", "servo.step_us": 4, "servo.position_gain_per_s": 0.5}, ["servo.step_us"]),
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


def refused(name: str, changes: dict[str, object]) -> list[tuple[str, object, str]]:
    """Key, value and reason of each cause that the circle cannot be run."""
    causes = refusals(network_of(busplan.load_profile(name, changes=changes)))
    return [(cause.name, cause.value, cause.right) for cause in causes]


HOST: dict[str, object] = {"servo.loop": "host"}
LONG = "us into a loop closed over it, and the circle test models at most 16 periods, 16000 us; "
ON_NODE = 'close the loop on the node, servo.loop = "node"'
HALF = "and the circle test models jitter and skew up to half the period, "


@pytest.mark.parametrize(
    ("name", "changes", "causes"),
    [
        # A period from SYNC0 to SYNC0, and those of the pipeline.
        ("ethercat-servo-8", {**HOST, "bus.pipeline_cycles": 15}, []),
        (
            "ethercat-servo-8",
            {**HOST, "bus.pipeline_cycles": 16},
            [
                (
                    "servo.loop",
                    '"host"',
                    f"the bus puts 17000 {LONG}less bus.pipeline_cycles, now 16, or {ON_NODE}",
                )
            ],
        ),
        # 16.896 ms of execution behind the write, in a period of 1 ms: the bus knows no pipeline that could be less.
        (
            "paper-1ms",
            {
                **HOST,
                "node.write_response": "unified",
                "payload": {"read_bytes": 4, "write_bytes": 512},
                "node.execution": {"kind": "linear", "grade": "measured", "base_us": 0, "per_byte_us": 33},
            },
            [("servo.loop", '"host"', f"the bus puts 18000 {LONG}{ON_NODE}")],
        ),
        (
            "paper-1ms",
            {**HOST, "payload.write_bytes": 0},
            [("payload.write_bytes", 0, "an axis that gets no commands moves along no circle")],
        ),
        (
            "paper-1ms",
            {**HOST, "payload.read_bytes": 0},
            [("payload.read_bytes", 0, f"a loop on the host needs feedback; {ON_NODE.replace('the loop', 'it')}")],
        ),
        ("paper-1ms", {"payload.read_bytes": 0}, []),
        # Jitter of the profile, and what the bus adds: half a frame of 135 us that is in the way of SYNC.
        (
            "can-servo-8",
            {"delivery.jitter_us": 1950.0},
            [
                (
                    "cycle.period_us",
                    4000.0,
                    f"the bus adds +/- 67.5 us of jitter, {HALF}2000 us, together; a longer period has room",
                )
            ],
        ),
        ("can-servo-8", {"delivery.jitter_us": 1932.5}, []),
        (
            "can-servo-8",
            {"delivery.jitter_us": 2001.0},
            [
                (
                    "delivery.jitter_us",
                    "2001.0 and skew_us = 0.0",
                    "together they must not exceed half the period, 2000 us",
                )
            ],
        ),
        # What is wrong with the loop is said alone: a move along no circle is not looked at.
        (
            "ethercat-servo-8",
            {**HOST, "bus.pipeline_cycles": 16, "circle.radius_mm": 1e6},
            [
                (
                    "servo.loop",
                    '"host"',
                    f"the bus puts 17000 {LONG}less bus.pipeline_cycles, now 16, or {ON_NODE}",
                )
            ],
        ),
    ],
)
def test_a_circle_is_refused_with_the_cause_and_the_way_out(
    name: str, changes: dict[str, object], causes: list[tuple[str, object, str]]
) -> None:
    assert refused(name, changes) == causes


def test_set_points_in_some_cycles_alone_are_refused_with_the_period_that_gives_them_in_each() -> None:
    drives = busplan.load_profile("ethercat-servo-8", changes=HOST).model_dump(exclude_unset=True)
    payload, node, _ = drives.pop("payload"), drives.pop("node"), drives["bus"].pop("nodes")
    for every, said in (
        ((2, 4), ["1 with a period of 2000 us gives the same set-points"]),
        ((4, 1), []),
    ):
        drives["group"] = [
            {**node, **payload, "nodes": 1, "name": name, "every": one} for name, one in zip("ab", every, strict=True)
        ]
        network = network_of(kind_named("ethercat").profile_model().model_validate(drives))
        causes = refusals(network)
        assert [cause.right for cause in causes] == [
            f"the circle test has a set-point in every cycle; {one}" for one in said
        ]
        assert [(cause.name, cause.value) for cause in causes] == [("group.a.every", 2)][: len(said)]


def test_a_lead_in_lasts_until_the_loop_is_a_thousandth_of_the_smallest_tolerance_from_rest() -> None:
    """A loop of gain K settles as exp(-K t): a tolerance ten times smaller takes ln(10) / K more, here 46 ms."""

    def settling_us(tolerance: dict[str, float]) -> float:
        us = path_settling_us(network_of(busplan.load_profile("ethercat-servo-8", changes={"tolerance": tolerance})))
        assert us is not None
        return us

    coarse_us, fine_us = (settling_us({"circular_deviation_mm": mm}) for mm in (0.02, 0.002))
    assert fine_us - coarse_us == pytest.approx(log(10) / 50 * 1e6, rel=0.02)
    # The smallest of some tolerances counts; one of 0 asks for nothing that a loop could reach.
    assert settling_us({"circular_deviation_mm": 0.02, "max_contour_error_mm": 0.002}) == fine_us
    assert settling_us({"circular_deviation_mm": 0.02, "mean_contour_error_mm": 0.2}) == coarse_us
    # Without any, it rests at a tenth of a micrometre: five times the thousandth of 20 um.
    assert coarse_us - settling_us({}) == pytest.approx(log(5) / 50 * 1e6, rel=0.02)


@pytest.mark.parametrize(("radius_mm", "turns"), [(100, 1), (2, 2), (1, 3)])
def test_a_lead_in_is_whole_turns_behind_its_ramp(radius_mm: float, turns: int) -> None:
    """255.7 ms to settle, behind half a ramp of 100 ms: a turn takes 125.66 ms for each millimetre of the radius."""
    network = network_of(busplan.load_profile("ethercat-servo-8", changes={"circle.radius_mm": radius_mm}))
    # The ramps take 100 ms each, and go half as far. Measured is from a whole period on.
    least_ms = (turns + 1) * 2 * pi * radius_mm / 50 * 1000 + 100
    assert 0 <= path_setpoints(network) - least_ms - 50 <= 2
    assert path_steps(network) == 8 * path_setpoints(network)


def test_a_trapezoid_goes_round_once_and_ramps_without_a_lead_in() -> None:
    network = network_of(busplan.load_profile("paper-1ms"))
    # 2 pi 320 mm at 10 m/min take 12,063.7 periods of 1 ms; a ramp up and one down of 100 cost half of each.
    assert path_settling_us(network) is None
    assert path_setpoints(network) == 12_064 + 100
    assert path_steps(network) == 10 * path_setpoints(network)
