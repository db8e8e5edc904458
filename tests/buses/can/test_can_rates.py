"""PDOs with every n-th SYNC: the fullest cycle decides, the load is that of the mean cycle."""

from collections.abc import Callable
from math import inf, lcm
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan.questions.fit.network import network_of
from tests.buses.can.machines import WORST, figures, loaded, responses, text_of


def group(name: str, nodes: int, *, size: int = 8, axes: int = 1, **keys: Any) -> dict[str, Any]:
    execution = {"kind": "linear", "grade": "measured", "base_us": 40.0, "per_byte_us": 1.0}
    sizes = {"read_bytes": size, "write_bytes": size}
    return {"name": name, "nodes": nodes, "axes": axes, **sizes, "execution": execution, **keys}


def message(name: str, identifier: int, **keys: Any) -> dict[str, Any]:
    return {"name": name, "identifier": identifier, "payload_bytes": 8, "period_us": 1e5, **keys}


def machine(*groups: dict[str, Any], messages: tuple[dict[str, Any], ...] = (), **bus: Any) -> busplan.Profile:
    data = {
        "schema_version": 1,
        "name": "mixed",
        "bus": {"kind": "can", "bit_rate_kbit_s": 1000, **bus},
        "cycle": {"period_us": 4000.0},
        "group": groups,
        "message": messages,
    }
    return loaded(data)


DRIVES = group("drives", 4)


def mixed(every: int = 4, **keys: Any) -> busplan.Profile:
    return machine(DRIVES, group("io", 6, axes=0, every=every, **keys), messages=(message("sdo", 0x600),))


def load(own: busplan.Profile, model: str = WORST) -> float:
    share: float = figures(own, model).own.bus_load
    return share


@pytest.mark.parametrize("rates", [(1, 1, 1), (1, 4, 2), (3, 4, 6), (2, 2, 2), (5, 1, 240)])
def test_the_load_is_that_of_all_cycles_of_the_common_multiple(rates: tuple[int, ...]) -> None:
    own = machine(*(group(f"g{place}", place + 1, every=every, size=3) for place, every in enumerate(rates)))
    cycles, sent_us = lcm(*rates), 0.0
    for number in range(cycles):
        due = [nodes.nodes for nodes, every in zip(own.group, rates, strict=True) if number % every == 0]
        sent_us += 55 + sum(2 * nodes * 85 for nodes in due)
    assert load(own) == pytest.approx(sent_us / cycles / 4000)


def test_the_fullest_cycle_decides() -> None:
    slow, fast = mixed(every=4), mixed(every=1)
    for model in ("no-stuffing", WORST):
        one, other = figures(slow, model), figures(fast, model)
        assert [term.us for term in one.terms] == [term.us for term in other.terms]
        assert one.own.bus_load < other.own.bus_load
    assert (one.margin_us, one.uncertainty_us) == (other.margin_us, other.uncertainty_us)


def test_every_cycle_is_what_it_was_without_the_key() -> None:
    said, silent = mixed(every=1), machine(DRIVES, group("io", 6, axes=0), messages=(message("sdo", 0x600),))
    assert responses(said) == responses(silent)
    assert busplan.capacity(said).to_dict()["results"] == busplan.capacity(silent).to_dict()["results"]


def test_nodes_that_are_alike_may_all_be_slow() -> None:
    own = busplan.load_profile("can-servo-8", changes={"payload.every": 3})
    assert load(own) < load(busplan.load_profile(own, changes={"payload.every": 1}))


def test_slow_pdos_go_before_a_message_less_often() -> None:
    # At 125 kbit/s 8 us a bit: a message waits for several cycles of PDOs.
    own = machine(
        group("drives", 2),
        group("io", 1, every=4, size=4),
        messages=(message("long", 0x700),),
        bit_rate_kbit_s=125,
    )
    slower = busplan.load_profile(own, changes={"cycle.period_us": 9000.0, "limits.max_load": 0.95})
    slow, fast = (
        responses(busplan.load_profile(slower, changes={"group.io.every": every}))["long"] for every in (4, 1)
    )
    assert slow is not None
    # The message meets each PDO of a late cycle and of the next; those of io once.
    drives_us, io_us, sync_us, own_us = 4 * 1080, 2 * 760, 440, 1080
    assert slow == drives_us + io_us + sync_us + own_us
    assert fast is None or fast >= slow


def test_more_nodes_fit_where_they_are_seldom_due() -> None:
    own = busplan.load_profile(mixed(every=4), changes={"limits.max_load": 0.5})
    for every, fits in ((4, True), (1, False)):
        found = figures(busplan.load_profile(own, changes={"group.io.every": every}))
        assert ("load" not in found.exceeded) is fits
    most = {each.name: each.safe_nodes for each in figures(own).groups}["io"]
    for nodes, fits in ((most, True), (most + 1, False)):
        assert (figures(busplan.load_profile(own, changes={"group.io.nodes": nodes})).verdict == "fits") is fits


def test_no_cycle_lasts_longer_than_the_fullest() -> None:
    # The message goes before the PDOs of io, and is of a lower priority where these are not due. There it may block,
    # but it is still sent once for each time that it is queued.
    own_message = message("between", 0x300, period_us=2000.0)
    drives = group("drives", 1, size=1)
    slow = group("io", 1, size=1, axes=0, every=2, feedback_identifier=0x7F0, command_identifier=0x7F1)
    own, alone = (machine(*groups, messages=(own_message,)) for groups in ((drives, slow), (drives,)))
    fullest_us = figures(busplan.load_profile(own, changes={"group.io.every": 1})).required_us
    assert fullest_us == 55 + 2 * 41 + 4 * 65 + 135
    # By its deadline alone it could block twice, and the two missing PDOs of one byte are shorter.
    assert figures(alone).required_us == fullest_us - 2 * 65 + 135
    assert figures(own).required_us == fullest_us
    assert busplan.timeline(own).used_us == pytest.approx(fullest_us)
    assert busplan.timeline(own, cycle=2).used_us == pytest.approx(fullest_us - 4 * 65 + 2 * 65)


def test_a_cycle_of_sync_alone_waits_for_a_single_frame() -> None:
    low = tuple(message(f"low{number}", 0x7F0 + number) for number in range(3))
    own = machine(group("io", 2, size=8, every=2), messages=low, pipeline_cycles=0, host_us=20, host_write_us=30)
    assert busplan.timeline(own, cycle=1).used_us == 55 + 2 * 48 + 4 * 135 + 3 * 135 + 20 + 30
    # Without feedback neither the host nor its adapter has anything to do.
    assert busplan.timeline(own, cycle=2).used_us == 55 + 135


def beside_one_node(period_us: float, *, every: int, deadline_us: float = 1e5) -> busplan.Profile:
    """A node without execution time, and messages before and behind its PDOs; each frame takes 135 us, SYNC 55."""
    execution = {"kind": "linear", "grade": "measured", "base_us": 0, "per_byte_us": 0, "uncertainty_us": 0}
    one = group("io", 1, axes=0, every=every) | {"execution": execution}
    messages = message("first", 0x10), message("last", 0x600, deadline_us=deadline_us)
    return busplan.load_profile(machine(one, messages=messages), changes={"cycle.period_us": period_us})


@pytest.mark.parametrize(("every", "period_us", "rounds"), [(1, 865, 2), (1, 866, 1), (2, 865, 1)])
def test_a_message_meets_late_pdos_again_when_they_are_due(every: int, period_us: float, rounds: int) -> None:
    """A cycle takes 730 us: SYNC, two PDOs, the first message, and two frames of the last one, which may block.

    Late feedback and commands come 460 us behind SYNC. They and the first message take 405 us and a bit, and the next
    SYNC comes with the next PDOs from 866 - 460 on.
    """
    assert figures(beside_one_node(866, every=1)).required_us == 55 + 2 * 135 + 135 + 2 * 135
    alone_us = 55 + 4 * 135
    assert responses(beside_one_node(period_us, every=every))["last"] == alone_us + (rounds - 1) * 2 * 135


def test_the_smallest_period_keeps_a_deadline() -> None:
    """One frame of the last message blocks then: late PDOs come 325 us behind SYNC, and 406 us later it has gone."""
    network = network_of(beside_one_node(500, every=1, deadline_us=595))
    (limit,) = (one for one in network.bus.limits if one.key == "deadline")
    assert limit.shown.shortest_period_us(network) == pytest.approx(325 + 406, rel=1e-9)
    for period_us, is_late in ((730.9, True), (731.0, False)):
        assert limit.shown.is_broken(network._replace(period_us=period_us)) == is_late
    never = network_of(beside_one_node(500, every=1, deadline_us=594))
    assert limit.shown.shortest_period_us(never) == inf


def test_a_loop_waits_for_the_cycle_in_which_its_commands_are_due() -> None:
    loops = {}
    for pipeline in (0, 1, 4, 5):
        own = busplan.load_profile(mixed(every=4), changes={"bus.pipeline_cycles": pipeline})
        loops[pipeline] = responses(own)["loop"]
    cycle_us = loops[0]
    assert cycle_us is not None
    assert loops == {0: cycle_us, 1: cycle_us + 16_000, 4: cycle_us + 16_000, 5: cycle_us + 32_000}


def test_the_circle_needs_a_set_point_in_every_cycle() -> None:
    assert busplan.circle_test(mixed(every=4)).results[0].max_contour_error_mm is not None
    own = busplan.load_profile(mixed(), changes={"group.drives.every": 2})
    with pytest.raises(busplan.BusplanError, match=r"group\.drives\.every = 2: the circle test has a set-point in"):
        busplan.circle_test(own)


def test_rates_of_groups_go_along_where_the_other_kind_has_them(run: Callable[..., Any], tmp_path: Path) -> None:
    answer = busplan.compare(mixed(), buses=["ethercat", "sercos3"])
    left_out = {bus["kind"]: bus["left_out"] for bus in answer.to_dict()["buses"]}
    assert ("group.io.every" in left_out["sercos3"], "group.io.every" in left_out["ethercat"]) == (True, False)
    (tmp_path / "mixed.toml").write_text(text_of(mixed()), encoding="utf-8")
    said = run("compare", "mixed.toml", "--buses", "ethercat,sercos3", "--all", cwd=tmp_path).stdout
    assert "Data at a slower rate go in every cycle there" in " ".join(said.split())
