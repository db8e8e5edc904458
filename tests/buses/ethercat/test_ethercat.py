"""An EtherCAT segment: its cycle by hand, latencies, clocks, limits and rules, and every question in some form."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.analysis.capacity.cycle import cycle_of, limits_with_time
from busplan.analysis.circle.delays import loop_delays_us, skew_us
from busplan.analysis.evidence import bus_evidence
from busplan.analysis.network import network_of
from busplan.buses import kind_named
from busplan.buses.ethercat.section import EthercatProfile
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.profile.shipped import load
from busplan.profile.toml import override
from busplan.profile.write import profile_text
from busplan.sections.profile import Profile

Run = Callable[..., Any]

DATA: dict[str, Any] = {
    "schema_version": 1,
    "name": "press",
    "bus": {"kind": "ethercat", "nodes": 3, "master_us": 20.0},
    "cycle": {"period_us": 500.0},
    "payload": {"read_bytes": 20, "write_bytes": 12},
    "node": {
        "axes": 2,
        "port": "E-bus",
        "execution": {"kind": "linear", "grade": "measured", "base_us": 40.0, "per_byte_us": 0.0},
    },
}
BYTE_US = 0.08


def profile(**changes: Any) -> Profile:
    """That profile with other values by dotted key, __ for the dot."""
    return override(EthercatProfile.model_validate(DATA), {key.replace("__", "."): one for key, one in changes.items()})


def grouped(*groups: dict[str, Any], **bus: Any) -> Profile:
    """The same segment with groups."""
    node = {**DATA["node"], "axes": 1}
    data = {key: one for key, one in DATA.items() if key not in ("payload", "node")}
    data["bus"] = {**{key: one for key, one in DATA["bus"].items() if key != "nodes"}, **bus}
    return EthercatProfile.model_validate({**data, "group": [{**node, **one} for one in groups]})


def terms(one: Profile, model: str = "last-byte") -> dict[str, float]:
    (found,) = busplan.capacity(one, timing_model=[model]).results
    return {term.name: plain(term.us) for term in found.terms}


def test_its_cycle_is_that_by_hand() -> None:
    frame = 8 + 14 + 2 + 10 + 3 * 20 + 2 + 4 + 12
    assert terms(profile()) == pytest.approx(
        {
            "master": 20,
            "frames": (frame - 60) * BYTE_US,
            "data": 60 * BYTE_US,
            "mailbox": 0,
            "devices": 3 * 0.3,
            "cable": 0,
            "receive": 0,
            "nonperiodic": 0,
        }
    )
    assert terms(profile(), "vendors")["receive"] == pytest.approx(frame * BYTE_US)


def test_options_add_datagrams_frames_and_ways() -> None:
    plain_ = terms(profile())
    apart = terms(profile(bus__command="LRD-LWR"))
    assert apart["data"] == pytest.approx(3 * (20 + 12) * BYTE_US)
    assert apart["frames"] == pytest.approx(plain_["frames"] + 12 * BYTE_US)
    assert terms(profile(bus__distributed_clocks=True))["frames"] == pytest.approx(plain_["frames"] + 20 * BYTE_US)
    polled = terms(profile(bus__mailbox_polls=2, bus__mailbox_bytes=100))
    assert polled["mailbox"] == pytest.approx(2 * (40 + 12 + 100) * BYTE_US)
    assert terms(profile(bus__mailbox_polls=1, bus__mailbox_bytes=1), "vendors")["receive"] == pytest.approx(84 * 0.08)
    assert terms(profile(node__port="100BASE-TX"))["devices"] == pytest.approx(3 * (0.485 + 0.725))
    assert terms(profile(node__delay_us=0.7))["devices"] == pytest.approx(3 * 2 * 0.7)
    assert terms(profile(node__cable_m=10.0))["cable"] == pytest.approx(3 * 10 * 2 * 0.005)


def test_three_frames_in_a_cycle() -> None:
    one = grouped(
        {"name": "drives", "nodes": 100, "read_bytes": 20, "write_bytes": 12},
        {"name": "cameras", "nodes": 2, "axes": 0, "read_bytes": 900, "write_bytes": 1},
    )
    (found,) = busplan.capacity(one, timing_model=["last-byte"]).results
    # 74 drives fill the first frame with 1480 bytes, 26 go with a camera, and the other camera has no room beside it.
    assert (found.frames, found.process_bytes) == (3, 100 * 20 + 2 * 900)
    last = 52 + 900
    sent = (3 * 52 + 3800) * BYTE_US
    assert found.required_us == pytest.approx(20 + sent + 102 * 0.3)
    (vendors,) = busplan.capacity(one, timing_model=["vendors"]).results
    assert vendors.required_us == pytest.approx(20 + sent + 102 * 0.3 + last * BYTE_US)
    events = busplan.timeline(one).cycle_events
    assert [one.label for one in events if one.kind == "overhead"] == [f"headers of frame {n}" for n in (1, 2, 3)]
    assert sum(one.duration_us for one in events if one.term) == pytest.approx(found.required_us, rel=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 1474), st.booleans(), st.booleans(), st.integers(0, 1))
def test_what_most_devices_rest_on_never_falls_and_is_no_less_than_any_cycle_so_far(
    size: int, clocks: bool, apart: bool, polls: int
) -> None:
    one = profile(
        payload__read_bytes=size,
        payload__write_bytes=1,
        bus__distributed_clocks=clocks,
        bus__command="LRD-LWR" if apart and size < 1474 else "LRW",
        bus__mailbox_polls=polls,
    )
    for model in ("last-byte", "vendors"):
        longest = before = 0.0
        for nodes in range(1, 120):
            cycle = cycle_of(one, model=model, nodes=nodes)
            longest, most = max(longest, plain(cycle.required_us)), plain(cycle.most_required_us)
            # What it is more than the longest are the devices of the last frame.
            assert longest - 1e-9 <= most <= longest + nodes * 0.3 + 1e-9
            assert before <= most
            assert model == "vendors" or most == longest == plain(cycle.required_us)
            before = most


def test_the_delay_of_a_port_is_not_known_exactly_and_a_measured_one_is() -> None:
    (by_port,) = busplan.capacity(profile(node__port="100BASE-TX"), timing_model=["last-byte"]).results
    doubts = {one.key: plain(one.us) for one in by_port.doubts}
    assert doubts == pytest.approx({"node.delay_us": 3 * 2 * 0.12 / 3**0.5, "bus.master_us": 2.0})
    (measured,) = busplan.capacity(
        profile(node__delay_us=0.7, bus__master_uncertainty_us=0.0), timing_model=["last-byte"]
    ).results
    assert measured.uncertainty_us == 0


def test_a_loop_takes_whole_periods_with_distributed_clocks() -> None:
    def loops(one: Profile) -> dict[str, float]:
        found = busplan.latency(one, timing_model=["last-byte"]).transactions
        for each in found:
            parts = ("drive", "frame_wait", "pipeline", "master", "sending", "path", "sync_wait")
            assert each.end_to_end_us == pytest.approx(sum(getattr(each, f"{key}_us") for key in parts))
        return {each.transaction: each.end_to_end_us for each in found}

    clocked = profile(bus__distributed_clocks=True)
    own_us = 20 + (52 + 20 + 60) * BYTE_US + 3 * 0.15
    # SYNC0 at 250 us: feedback is ready at 290, goes with the frame at 500; a command sent at 500 acts at 750.
    assert loops(clocked) == pytest.approx({"command": 750, "feedback": 250 + own_us + 3 * 0.15, "loop": 1000})
    assert loops(profile(bus__distributed_clocks=True, bus__pipeline_cycles=3))["loop"] == pytest.approx(2000)
    # SYNC0 before the frames: a command waits for the next one.
    assert loops(profile(bus__distributed_clocks=True, bus__sync_shift=0.0))["command"] == pytest.approx(1000)
    # At 50 us the drive, which needs 40 us, has not taken its command.
    assert loops(profile(bus__distributed_clocks=True, bus__sync_shift=0.1))["command"] == pytest.approx(1050)
    free = loops(profile())
    assert free["command"] == pytest.approx(500 + own_us - 20 * BYTE_US + 40)
    assert free["feedback"] == pytest.approx(500 + own_us - 20 * BYTE_US + 3 * 0.15)


@pytest.mark.parametrize("shift", [0.0, 0.1, 0.3, 0.9])
@pytest.mark.parametrize("pipeline", [0, 1, 2])
def test_the_circle_has_the_delay_of_the_loop(shift: float, pipeline: int) -> None:
    one = profile(bus__distributed_clocks=True, bus__sync_shift=shift, bus__pipeline_cycles=pipeline)
    host = override(one, {"servo.loop": "host"})
    found = busplan.latency(host, timing_model=["last-byte"]).transactions
    (loop,) = (each for each in found if each.transaction == "loop")
    assert loop_delays_us(host) == pytest.approx((loop.end_to_end_us,) * 2)
    assert loop_delays_us(one) == (0, 0)


def test_set_points_reach_the_drives_at_one_time_with_clocks_and_one_after_the_other_without() -> None:
    many = {"payload__read_bytes": 600, "payload__write_bytes": 600}
    assert skew_us(profile(bus__distributed_clocks=True, **many)) == 0
    # Two devices have the first frame, the third is behind the second frame; each device on the way adds 0.15 us.
    assert skew_us(profile(**many)) == pytest.approx((52 + 600) * BYTE_US + 2 * 0.15)
    arrival = override(profile(**many), {"servo.loop": "host", "servo.update": "on_arrival"})
    first, last = loop_delays_us(arrival)
    assert last - first == pytest.approx((52 + 600) * BYTE_US + 2 * 0.15)
    # Feedback waits for the next frame, the master has one cycle, and the command comes with the first frame.
    assert first == pytest.approx(1000 + 20 + (52 + 1200) * BYTE_US + 0.15)


def test_a_circle_with_more_than_a_period_in_its_loop_is_not_simulated(run: Run, tmp_path: Path) -> None:
    done = run("circle-test", "ethercat-servo-8", "--set", "servo.loop=host", cwd=tmp_path)
    assert done.returncode == 2
    assert 'servo.loop = "host": the bus puts 2000 us into a loop over it' in done.stderr
    checked = run("check", "ethercat-servo-8", "--set", "servo.loop=host", cwd=tmp_path)
    assert checked.returncode in (1, 2)
    assert "the bus puts 2000 us into a loop" in checked.stdout + checked.stderr
    assert "Traceback" not in checked.stderr


def test_a_missing_clock_moves_the_axes_of_a_circle_apart() -> None:
    one = override(load("ethercat-servo-8").profile, {"payload.read_bytes": 700, "cycle.period_us": 2000.0})
    apart = override(one, {"bus.distributed_clocks": False})
    together_mm, apart_mm = (busplan.circle_test(each).results[0].max_contour_error_mm or 0 for each in (one, apart))
    assert apart_mm > together_mm > 0


@pytest.mark.parametrize(
    ("changes", "exceeded"),
    [
        ({}, ()),
        ({"payload.read_bytes": 1486}, ()),
        ({"payload.read_bytes": 1487}, ("payload",)),
        ({"payload.read_bytes": 1463, "bus.command": "LRD-LWR"}, ("payload",)),
        ({"node.cable_m": 100.5}, ("cable",)),
        ({"bus.nodes": 65536, "cycle.period_us": 1e7}, ("nodes",)),
        ({"cycle.period_us": 25.0}, ("time",)),
    ],
)
def test_what_it_breaks_does_not_fit(changes: dict[str, Any], exceeded: tuple[str, ...]) -> None:
    (found,) = busplan.capacity(override(profile(), changes), timing_model=["last-byte"]).results
    assert found.exceeded == exceeded
    assert (found.verdict == "does not fit") == bool(exceeded)


def test_a_plan_may_let_inputs_and_outputs_share_their_bytes(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "press.toml"
    path.write_text(profile_text(override(load("ethercat-servo-8").profile, {"bus.command": "LRD-LWR"})))
    options = ("--nodes", "300", "--free", "command", "--no-circle", "--format", "json")
    done = run("plan", path.name, *options, cwd=tmp_path)
    assert done.returncode == 0, done
    assert json.loads(done.stdout)["recommended_changes"]["bus.command"] == "LRW"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"bus.command": "APRW"}, "LRW"),
        ({"bus.sync_shift": 1.0}, "0.999 or less"),
        ({"bus.mailbox_bytes": 1487}, "1,486 or less"),
        ({"node.port": "fibre"}, "E-bus"),
    ],
)
def test_what_no_segment_has_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(BusplanError, match=words):
        override(profile(), changes)


PUBLISHED = {
    # figure, method: tolerance of the computed one [share], as far as the source's own rounding and silence go
    ("most process data", "frame layout"): 0.0,
    ("most process data beside the clocks' datagram", "frame layout"): 0.0,
    ("shortest frame on the wire", "frame layout"): 0.0,
    ("longest frame on the wire", "frame layout"): 0.0,
    ("1000 digital I/O", "vendors model"): 0.06,
    ("1486 bytes", "vendors model"): 0.18,
    ("100 servo axes", "last-byte model"): 0.32,
    ("time on the wire", "last-byte model"): 0.004,
    ("E-bus, there and back", "constant of busplan"): 0.0,
    ("command to drive", "one cycle in the master"): 0.0,
}


def test_published_figures_are_met_within_what_their_sources_leave_open() -> None:
    found = {
        (one.quantity, one.method): one.relative_residual
        for section in bus_evidence(kind_named("ethercat"))
        for one in section.comparisons
    }
    assert set(PUBLISHED) <= set(found)
    for key, tolerance in PUBLISHED.items():
        residual = found[key]
        assert residual is not None
        assert abs(residual) <= tolerance + 1e-12, (key, residual)
    # What propagation explains is missing, never too much.
    assert all((found[name, "vendors model"] or 0) < 0 for name in ("1000 digital I/O", "1486 bytes"))


def test_delays_are_within_what_was_measured() -> None:
    constants = kind_named("ethercat").constants
    assert 0.485 <= constants["DELAY_US[100BASE-TX]"] <= 0.725
    assert 0.97 <= 2 * constants["DELAY_US[100BASE-TX]"] <= 1.45
    assert 0.145 <= constants["DELAY_US[E-bus]"] <= 0.155
    # Two standard uncertainties reach the ends of the range.
    assert constants["DELAY_US[100BASE-TX]"] + 2 * constants["DELAY_UNCERTAINTY_US[100BASE-TX]"] > 0.725
    assert all(one.source and one.grade for one in constants.values())


FORMS = {
    "capacity --sensitivity": ("table", "json", "csv"),
    "latency": ("table", "csv"),
    "plan": ("table", "json"),
    "timeline": ("table", "markdown", "svg"),
    "map": ("markdown", "svg"),
    "report": ("html", "markdown"),
    "check": ("text", "sarif"),
    "explain": ("table", "json"),
    "diff can-servo-8 --no-circle": ("table", "json"),
    "circle-test": ("table",),
    "sweep --vary bus.command=LRW,LRD-LWR --vary bus.distributed_clocks=true,false --vary bus.nodes=1,200": ("csv",),
    "sweep --vary node.cable_m=0:100:50 --vary node.port=100BASE-TX,E-bus --vary cycle.period_us=250,1000": ("table",),
}


@pytest.mark.parametrize(("line", "form"), [(one, form) for one, forms in FORMS.items() for form in forms])
def test_every_question_is_answered(run: Run, tmp_path: Path, line: str, form: str) -> None:
    command, *options = line.split()
    done = run(command, "ethercat-servo-8", *options, "--format", form, cwd=tmp_path)
    assert done.returncode in (0, 1) if command == "check" else done.returncode == 0, done
    assert "gap count" not in done.stdout or command in ("check", "diff")
    assert "nan" not in done.stdout.lower().split()


@pytest.mark.parametrize("figure", ["required_us", "command_us", "frames", "latency.end_to_end_us", "max_nodes"])
def test_every_figure_is_derived(run: Run, tmp_path: Path, figure: str) -> None:
    done = run("explain", "ethercat-servo-8", figure, cwd=tmp_path)
    assert done.returncode == 0, done
    assert "Traceback" not in done.stderr


def test_groups_are_answered_one_by_one() -> None:
    one = grouped(
        {"name": "drives", "nodes": 4, "read_bytes": 12, "write_bytes": 8, "port": "100BASE-TX", "cable_m": 2.0},
        {"name": "io", "nodes": 20, "axes": 0, "read_bytes": 1, "write_bytes": 1},
    )
    (found,) = busplan.capacity(one, timing_model=["last-byte"]).results
    assert [group.name for group in found.groups] == ["drives", "io"]
    network = network_of(one)
    for group in found.groups:
        asked = network.asking(group.name)
        limits = limits_with_time(asked, model="last-byte")
        assert not any(limit.is_broken(asked.with_nodes(group.max_nodes)) for limit in limits)
        assert any(limit.is_broken(asked.with_nodes(group.max_nodes + 1)) for limit in limits)
    transactions = busplan.latency(one, timing_model=["last-byte"]).transactions
    assert {each.group for each in transactions} == {"drives", "io"}


def test_init_writes_a_profile_of_it_that_fits(run: Run, tmp_path: Path) -> None:
    done = run("init", "press", "--bus", "ethercat", "--nodes", "4", "--axes", "10", cwd=tmp_path)
    assert done.returncode == 0
    assert "press at 1 ms: fits" in done.stderr
    found = busplan.load_profile(tmp_path / "press.toml")
    assert (found.bus.kind, len(found.group), found.bus.distributed_clocks) == ("ethercat", 2, True)
    assert run("check", "press.toml", "--no-circle", cwd=tmp_path).returncode == 0


def test_its_evidence_says_where_figures_come_from(run: Run) -> None:
    document = json.loads(run("evidence", "ethercat", "--format", "json").stdout)
    assert document["without"] == []
    assert {one["data"] for one in document["figures"]} == {"ethercat"}
