"""A CAN bus: its cycle by hand, its identifiers, its limits and rules, and every question in some form."""

import importlib.util
import json
import re
from collections.abc import Callable
from math import ceil, inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named
from busplan.buses.can.frames import streams, traffic_of_profile
from busplan.buses.can.rules import shared_identifiers
from busplan.buses.can.section import CanProfile
from busplan.buses.can.waiting import responses
from busplan.elementwise import plain
from busplan.errors import BusplanError
from busplan.profile.edit import profile_text
from busplan.questions.fit.circle_refusal import loop_delays_us
from busplan.questions.fit.network import network_of

if TYPE_CHECKING:
    from tests.oracles import can_textbook as textbook
else:
    path = Path(__file__).parents[2] / "oracles" / "can_textbook.py"
    spec = importlib.util.spec_from_file_location("can_textbook", path)
    textbook = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(textbook)

Run = Callable[..., Any]

DATA: dict[str, Any] = {
    "schema_version": 1,
    "name": "press",
    "bus": {"kind": "can", "bit_rate_kbit_s": 500, "nodes": 3},
    "cycle": {"period_us": 6000.0},
    "payload": {"read_bytes": 10, "write_bytes": 6},
    "node": {"axes": 2, "execution": {"kind": "linear", "grade": "measured", "base_us": 40.0, "per_byte_us": 1.0}},
    "message": [{"name": "alarm", "identifier": 0x90, "payload_bytes": 2, "period_us": 2000.0, "jitter_us": 100.0}],
}
BIT_US = 2


def profile(**changes: Any) -> busplan.Profile:
    """That profile with other values by dotted key, __ for the dot."""
    return busplan.load_profile(
        CanProfile.model_validate(DATA), changes={key.replace("__", "."): one for key, one in changes.items()}
    )


def own_figures(one: busplan.Profile, model: str = "worst-stuffing") -> dict[str, Any]:
    (found,) = busplan.capacity(one, timing_model=[model]).results
    return dict(found.own)


def terms(one: busplan.Profile, model: str = "worst-stuffing") -> dict[str, float]:
    (found,) = busplan.capacity(one, timing_model=[model]).results
    return {term.name: plain(term.us) for term in found.terms}


def test_its_cycle_is_that_by_hand() -> None:
    pdo_in, pdo_out, alarm = (135 + 75) * BIT_US, 115 * BIT_US, 75 * BIT_US
    others = 55 * BIT_US + (50 + 46) + 3 * (pdo_in + pdo_out)
    assert others == 2156  # within 2000 us less the jitter two alarms arrive, and go before all PDOs
    assert terms(profile()) == {
        "sync": 110,
        "wait": 96,
        "feedback": 3 * pdo_in,
        "host": 0,
        "command": 3 * pdo_out,
        "blocking": 0,
        "interference": 2 * alarm,
        "nonperiodic": 0,
    }
    assert terms(profile(), "no-stuffing")["feedback"] == 3 * (47 + 64 + 47 + 16) * BIT_US
    assert terms(profile(bus__sync_counter=True))["sync"] == 65 * BIT_US
    assert terms(profile(bus__identifier_bits=29))["command"] == 3 * 140 * BIT_US


@pytest.mark.parametrize("load", [0.5, 0.975, 0.985, 0.9895, 0.9905, 0.995, 0.9998, 1.0, 1.2])
def test_a_cycle_behind_a_nearly_full_bus_is_a_bound_in_closed_form(load: float) -> None:
    # One message goes before all PDOs, and one behind them may block: three frames of it, in a cycle so long.
    frame, period_us, others = 135 * BIT_US, 135 * BIT_US / load, (55 + 3 * (135 + 75) + 3 * 115) * BIT_US
    urgent = {"name": "urgent", "identifier": 0x10, "payload_bytes": 8, "period_us": period_us}
    low = {"name": "low", "identifier": 0x7FF, "payload_bytes": 0, "period_us": 50_000.0, "deadline_us": 50_000.0}
    own = profile(message=[urgent, low], node__execution__base_us=0, node__execution__per_byte_us=0)

    def blocked(span: float) -> float:
        return ceil(min((span + 50_000) / 50_000, 3)) * 55 * BIT_US

    if load > 0.99:
        span = (others + blocked(inf) + frame + load * BIT_US) / (1 - min(load, 0.9999))
    else:
        span = float(others)
        while span < (wider := others + blocked(span) + ceil((span + BIT_US) / period_us) * frame):
            span = wider
    found = terms(own)
    assert found["interference"] == pytest.approx(ceil((span + BIT_US) / period_us) * frame)
    assert found["blocking"] == blocked(span)


def test_a_pdo_for_each_axis_shares_the_payload() -> None:
    one = terms(profile(payload__pdo_per="axis"))
    assert (one["feedback"], one["command"]) == (6 * 105 * BIT_US, 6 * 85 * BIT_US)


def test_its_load_counts_every_message() -> None:
    (found,) = busplan.capacity(profile(), timing_model=["worst-stuffing"]).results
    assert found.own["bus_load"] == pytest.approx((110 + 3 * 420 + 3 * 230) / 6000 + 150 / 2000)
    assert (found.verdict, found.bias_us) == ("fits", None)
    assert found.uncertainty_us == pytest.approx(2 * 2 * 0.1 / 12**0.5)


def test_identifiers_follow_those_of_the_pre_defined_connection_set() -> None:
    each = streams(traffic_of_profile(profile()), is_stuffed=True)
    assert [(one.name, one.first, one.last, one.data_bytes) for one in each] == [
        ("SYNC", 0x80, 0x80, 0),
        ("feedback", 0x181, 0x183, 8),
        ("feedback", 0x281, 0x283, 2),
        ("command", 0x201, 0x203, 6),
        ("alarm", 0x90, 0x90, 2),
    ]


def test_a_payload_beyond_all_pdos_has_no_more_streams_than_it_takes_to_break_the_limit() -> None:
    huge = profile(payload__read_bytes=100_000)
    each = streams(traffic_of_profile(huge), is_stuffed=True)
    assert [one.first for one in each if one.name == "feedback"] == [0x181, 0x281, 0x381, 0x481, 0x581]
    assert terms(huge)["feedback"] == 3 * 12_500 * 135 * BIT_US
    (found,) = busplan.capacity(huge, timing_model=["worst-stuffing"]).results
    assert "payload" in found.exceeded


def test_a_latency_says_nothing_of_the_profiles_own_load_with_another_payload(run: Run) -> None:
    said = run("latency", "can-servo-8", "--payload", "4").stdout
    assert "worst case of SYNC" in said
    assert "load" not in said


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        ("33", "a PDO of 33 bytes is over the 32 bytes of four frames"),
        ("25", "feedback and sdo-response share the identifier 0x481"),
    ],
)
def test_a_latency_says_what_a_payload_breaks(run: Run, payload: str, said: str) -> None:
    changed = ("--set", "message.sdo-response.identifier=0x481")
    assert said in run("latency", "can-servo-8", *changed, "--payload", payload).stdout
    assert "Warning" not in run("latency", "can-servo-8", *changed).stdout


def test_groups_follow_each_other_and_may_have_identifiers_of_their_own() -> None:
    node = {**DATA["node"], "axes": 1}
    groups = [
        {**node, "name": "drives", "nodes": 2, "read_bytes": 8, "write_bytes": 8},
        {**node, "name": "io", "nodes": 3, "axes": 0, "read_bytes": 2, "write_bytes": 1, "command_identifier": 0x301},
    ]
    data = {key: one for key, one in DATA.items() if key not in ("payload", "node")}
    data["bus"] = {key: one for key, one in DATA["bus"].items() if key != "nodes"}
    found = CanProfile.model_validate({**data, "group": groups})
    each = streams(traffic_of_profile(found), is_stuffed=True)
    assert [(one.label, one.first, one.last) for one in each[1:-1]] == [
        ("drives feedback", 0x181, 0x182),
        ("io feedback", 0x183, 0x185),
        ("drives command", 0x201, 0x202),
        ("io command", 0x301, 0x303),
    ]
    one, _ = busplan.capacity(found).results
    assert [group.name for group in one.groups] == ["drives", "io"]
    assert one.required_us == sum(event.duration_us for event in busplan.timeline(found).cycle_events if event.term)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"bus.nodes": 120, "payload.feedback_identifier": 0x1F0},
            "feedback and command share 103 identifiers from 0x201",
        ),
        (
            {"bus.nodes": 257, "payload.read_bytes": 32},
            "frames of feedback PDOs share the identifier 0x281 and 2 more",
        ),
    ],
)
def test_collisions_of_one_key_are_one_finding(changes: dict[str, Any], words: str) -> None:
    found = shared_identifiers(traffic_of_profile(busplan.load_profile(profile(), changes=changes)))
    assert len({key for key, _ in found}) == len(found)
    assert words in [said for _, said in found]


@pytest.mark.parametrize(
    ("changes", "exceeded"),
    [
        ({}, ()),
        ({"limits.max_load": 0.4}, ("load",)),
        ({"message.alarm.identifier": 0x80}, ("identifiers",)),
        ({"message.alarm.deadline_us": 200.0}, ("deadline",)),
        ({"payload.read_bytes": 33}, ("payload", "load")),
        ({"cycle.period_us": 2400.0}, ("load", "time")),
        ({"payload.command_identifier": 0x7FE}, ("range",)),
        ({"payload.feedback_identifier": 0x202}, ("identifiers",)),
    ],
)
def test_what_it_breaks_does_not_fit(changes: dict[str, Any], exceeded: tuple[str, ...]) -> None:
    (found,) = busplan.capacity(
        busplan.load_profile(profile(), changes=changes), timing_model=["worst-stuffing"]
    ).results
    assert found.exceeded == exceeded
    assert (found.verdict == "does not fit") == bool(exceeded)


def test_responses_are_those_by_hand_and_their_parts_add_up() -> None:
    found = {one.transaction: one for one in busplan.latency(profile(), timing_model=["worst-stuffing"]).transactions}
    assert list(found) == ["SYNC", "feedback", "command", "alarm", "loop"]
    # The alarm waits for one full frame and SYNC; the last command for everything, but the second feedback frames.
    assert found["alarm"].phases["worst_response_us"] == 100 + 270 + 110 + 150
    assert found["command"].phases["worst_response_us"] == 150 + 110 + 3 * 270 + 2 * 230 + 230 + 150
    for one in found.values():
        parts = ("jitter_us", "blocking_us", "interference_us", "backlog_us", "frame_us", "execution_us", "pipeline_us")
        assert one.phases["worst_response_us"] == sum(one.phases[key] or 0.0 for key in parts)


@given(st.data())
def test_the_last_pdo_of_a_group_answers_last_of_it(data: st.DataObject) -> None:
    sizes = st.integers(1, 24)
    changes: dict[str, Any] = {
        "bus.nodes": data.draw(st.integers(1, 5)),
        "payload.read_bytes": data.draw(sizes),
        "payload.write_bytes": data.draw(sizes),
        "message.alarm.identifier": data.draw(st.sampled_from([0x10, 0x190, 0x1F0, 0x210, 0x2A0, 0x7FF])),
        "message.alarm.period_us": float(data.draw(st.integers(700, 3000))),
        "cycle.period_us": float(data.draw(st.integers(4000, 9000))),
    }
    traffic = traffic_of_profile(busplan.load_profile(profile(), changes=changes))
    sent = {
        identifier: textbook.Sender(int(one.frame_us), int(one.period_us), int(one.jitter_us))
        for one in streams(traffic, is_stuffed=True)
        for identifier in range(one.first, one.last + 1)
    }
    for own, worst in responses(traffic, is_stuffed=True):
        # No PDO of a cycle that fits blocks the next SYNC.
        alarm = changes["message.alarm.identifier"]
        blocking = sent if own.name != "SYNC" else {alarm: sent[alarm]}
        alone = [
            textbook.response_us(
                sent[identifier],
                [one for other, one in sent.items() if other < identifier],
                blocking_us=max((one.frame_us for other, one in blocking.items() if other > identifier), default=0),
                bit_us=BIT_US,
                most_us=500_000,
            )
            for identifier in range(own.first, own.last + 1)
        ]
        us, instance = alone[-1] or (inf, worst.instance)
        # A message may also meet a late cycle, and the next one soon behind it.
        assert (worst.us, worst.instance) == (us, instance) or (own.is_message and worst.us > us)
        assert worst.us == inf or all(one is not None and one[0] <= worst.us for one in alone)


def test_a_full_bus_says_that_there_is_no_response_time(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "press.toml"
    path.write_text(profile_text(profile(cycle__period_us=2000.0, message__alarm__identifier=0x600)), encoding="utf-8")
    done = run("latency", path.name, cwd=tmp_path)
    assert "from 100% on messages of low priority have no worst-case response time" in " ".join(done.stdout.split())
    assert "alarm has no worst-case response time." in done.stdout
    document = json.loads(run("latency", path.name, "--format", "json", cwd=tmp_path).stdout)
    by_name = {(one["timing_model"], one["transaction"]): one["worst_response_us"] for one in document["transactions"]}
    assert by_name["worst-stuffing", "SYNC"] == 110 + 150  # blocked by a message alone
    assert by_name["worst-stuffing", "alarm"] is None
    for form in ("table", "json", "csv"):
        explained = run("explain", path.name, "latency.worst_response_us", "--format", form, cwd=tmp_path)
        assert (explained.returncode, "inf" in explained.stdout) == (0, False)


def test_latency_says_first_whether_all_messages_are_in_time_and_shows_the_latest_of_many(
    run: Run, tmp_path: Path
) -> None:
    first = run("latency", "can-servo-8").stdout.partition("\n")[0]
    assert first == "Every message keeps its deadline by the worst-stuffing model; command takes up to 2350 us of 4000."
    many = "".join(
        f'[[message]]\nname = "m{number}"\nidentifier = {0x400 + number}\npayload_bytes = 8\nperiod_us = 20000\n'
        f"deadline_us = {19000 - 450 * number}\n"
        for number in range(41)
    )
    path = tmp_path / "many.toml"
    path.write_text(profile_text(busplan.load_profile("can-servo-8")) + many, encoding="utf-8")
    said = run("latency", path.name, "--timing-model", "worst-stuffing", cwd=tmp_path).stdout
    assert "22 of 47 messages miss their deadlines by the worst-stuffing model; m40 takes up to " in said
    assert "Not shown: 18 rows. --all shows all." in said
    assert [word for word in ("m0 ", "m20 ", "m40 ") if f"\n{word}" in said] == ["m20 ", "m40 "]
    whole = run("latency", path.name, "--timing-model", "worst-stuffing", "--all", cwd=tmp_path).stdout
    assert "\nm0 " in whole


def test_its_verdict_says_by_how_much_the_model_errs_to_the_safe_side(run: Run) -> None:
    errs = "this timing model takes 8 to 15% more than classical frames that were measured"
    assert f"  bias            none corrected: {errs}\n" in run("capacity", "can-servo-8").stdout


def test_a_cure_of_the_load_is_a_longer_period(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "press.toml"
    path.write_text(profile_text(profile(limits__max_load=0.4)), encoding="utf-8")
    said = run("check", path.name, cwd=tmp_path).stdout
    assert "BP121 error: limits.max_load: the bus load is 41.8%, 40.0% allowed; the period must change; " in said
    cured = float(said.rpartition("cheapest cure: cycle.period_us = ")[2].split("\n")[0])
    assert (
        busplan.capacity(busplan.load_profile(profile(limits__max_load=0.4), changes={"cycle.period_us": cured}))
        .results[0]
        .fits
    )
    assert cured < 6400


def test_the_circle_has_its_set_points_from_sync() -> None:
    host = busplan.load_profile("can-servo-8", changes={"servo.loop": "host", "bus.pipeline_cycles": 0})
    at_sync, on_arrival = (
        loop_delays_us(network_of(busplan.load_profile(host, changes={"servo.update": update})))
        for update in ("next_sync", "on_arrival")
    )
    # The first and the last command are executed behind SYNC, the wait for feedback, nine, or sixteen, frames, and
    # three others, of which two have 8 bytes.
    assert at_sync == (4000, 4000)
    assert on_arrival == tuple(55 + 200 + frames * 135 + (135 + 135 + 65) + 200 for frames in (9, 16))
    next_cycle = {"bus.pipeline_cycles": 1, "servo.update": "on_arrival"}
    assert loop_delays_us(network_of(busplan.load_profile(host, changes=next_cycle))) == tuple(
        us + 4000 for us in on_arrival
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"message.alarm.burst": 0}, "1 or more"),
        ({"message.alarm.identifier": 0x800}, "is over 2047, the largest of 11 bits"),
        ({"message.alarm.payload_bytes": 65}, "64 or less"),
        ({"bus.bit_rate_kbit_s": 4}, "5 to 1000|5 or more"),
    ],
)
def test_what_no_bus_has_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(BusplanError, match=words):
        busplan.load_profile(profile(), changes=changes)


def test_groups_with_one_identifier_are_refused() -> None:
    node = {**DATA["node"], "read_bytes": 8, "write_bytes": 8, "nodes": 2, "feedback_identifier": 0x190}
    data = {key: one for key, one in DATA.items() if key not in ("payload", "node")}
    data["bus"] = {key: one for key, one in DATA["bus"].items() if key != "nodes"}
    with pytest.raises(ValueError, match="an earlier group has it"):
        CanProfile.model_validate({**data, "group": [{**node, "name": "a"}, {**node, "name": "b"}]})


@pytest.mark.parametrize("name", ["alarm", "SYNC", "feedback"])
def test_messages_have_names_of_their_own(name: str) -> None:
    messages = [*DATA["message"], {**DATA["message"][0], "name": name}]
    with pytest.raises(ValueError, match=r"of this name|are called"):
        CanProfile.model_validate({**DATA, "message": messages})


def test_init_writes_a_profile_of_it_that_fits(run: Run, tmp_path: Path) -> None:
    done = run("init", "press", "--bus", "can", "--axes", "10", cwd=tmp_path)
    assert done.returncode == 0
    assert "--period 10ms" in done.stderr
    assert re.search(r"\npress  CAN, 4 nodes, 10 axes, 10 ms +FITS\n", done.stderr)
    found = busplan.load_profile(tmp_path / "press.toml")
    assert (found.bus.kind, len(found.group)) == ("can", 2)
    done = run("init", "other", "--bus", "lon", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("--bus lon: no kind of bus; there are ieee1394, can")


def test_constants_have_sources() -> None:
    assert all(one.source and one.grade for one in kind_named("can").constants.values())


@pytest.mark.parametrize("nodes", [12, 20, 28])
def test_a_plan_holds_load_deadlines_and_time(nodes: int) -> None:
    many = busplan.load_profile("can-servo-8", changes={"bus.nodes": nodes})
    found = busplan.plan(many)
    assert found.recommended_changes is not None
    planned, _ = busplan.capacity(busplan.load_profile(many, changes=dict(found.recommended_changes))).results
    assert (planned.verdict, planned.exceeded) == ("fits", ())


def test_no_plan_is_made_where_no_period_keeps_a_deadline() -> None:
    many = busplan.load_profile("can-servo-8", changes={"bus.nodes": 40})
    found = busplan.plan(many)
    assert found.recommended_changes is None
    assert "the worst-case response time of sdo-response is" in str(found)


@pytest.mark.parametrize("nodes", [8, 12, 20])
def test_the_smallest_period_keeps_the_load(nodes: int) -> None:
    many = busplan.load_profile("can-servo-8", changes={"bus.nodes": nodes})
    smallest_us = busplan.capacity(many).results[0].safe_min_period_us or 0.0
    at, _ = busplan.capacity(busplan.load_profile(many, changes={"cycle.period_us": smallest_us})).results
    assert (at.verdict, at.exceeded) == ("fits", ())
    below, _ = busplan.capacity(
        busplan.load_profile(many, changes={"cycle.period_us": smallest_us * (1 - 1e-6)})
    ).results
    assert below.verdict != "fits"


def test_six_nodes_with_service_messages_fit_four_milliseconds(run: Run, tmp_path: Path) -> None:
    """A usual machine: 21 messages at 500 kbit/s, with a load of 0.79."""
    line = ("init", "six", "--bus", "can", "--nodes", "6", "--axes", "6", "--period", "4ms", "--bytes-per-axis", "6")
    assert run(*line, cwd=tmp_path).returncode == 0
    path = tmp_path / "six.toml"
    sdo = [("request", 0x601), ("response", 0x581)]
    service = [(f"sdo-{name}", identifier, 8, 10_000) for name, identifier in sdo]
    service += [(f"heartbeat-{node}", 0x700 + node, 1, 50_000) for node in range(1, 7)]
    sections = [
        f'[[message]]\nname = "{name}"\nidentifier = {identifier:#x}\npayload_bytes = {size}\nperiod_us = {period_us}\n'
        for name, identifier, size, period_us in service
    ]
    text = path.read_text(encoding="utf-8").replace("bit_rate_kbit_s = 1000", "bit_rate_kbit_s = 500")
    text = text.replace("base_us = 20 ", "base_us = 100").replace("reserve = 0.15", "reserve = 0")
    path.write_text("\n".join((text, *sections)), encoding="utf-8")
    found, _ = busplan.capacity(path).results
    assert found.own["bus_load"] == pytest.approx(0.787, abs=1e-3)
    assert (found.verdict, found.exceeded) == ("fits", ())
    # Three service frames block: one of a kind may be late by its period, and the next be there.
    assert {term.name: term.us for term in found.terms}["blocking"] == 3 * 270
    answers = busplan.latency(path, timing_model=["worst-stuffing"]).transactions
    assert sum(1 if one.transaction in ("SYNC", *(name for name, *_ in service)) else 6 for one in answers[:-1]) == 21
    for one in answers[:-1]:
        response_us, deadline_us = one.phases["worst_response_us"], one.phases["deadline_us"]
        assert response_us is not None
        assert deadline_us is not None
        assert response_us <= deadline_us
    assert run("check", "six.toml", cwd=tmp_path).returncode == 0


def test_a_machine_of_many_axes_starts_with_pdos_of_each_axis(run: Run, tmp_path: Path) -> None:
    line = "init one --bus can --nodes 2 --axes 10 --period 10ms --bytes-per-axis 8"
    assert re.search(r"\none  CAN, 2 nodes, 10 axes, 10 ms +FITS\n", run(*line.split(), cwd=tmp_path).stderr)
    text = (tmp_path / "one.toml").read_text(encoding="utf-8")
    assert 'pdo_per = "axis"           # assumed: without it no period carries the machine' in text
    # So does a plan that begins without it.
    alone = busplan.load_profile(tmp_path / "one.toml", changes={"payload.pdo_per": "node"})
    assert busplan.plan(alone).recommended_changes == {"payload.pdo_per": "axis"}


def test_settings_are_what_is_not_set_yet() -> None:
    def tried(**changes: Any) -> dict[str, Any]:
        network = network_of(profile(**changes))
        return {one.name: one.values for one in kind_named("can").settings(network)}

    rates = ({"bus.bit_rate_kbit_s": 800}, {"bus.bit_rate_kbit_s": 1000})
    assert tried() == {"pdo_per": ({"payload.pdo_per": "axis"},), "bit_rate": rates, "identifier_bits": ()}
    assert tried(payload__pdo_per="axis")["pdo_per"] == ()
    assert "pdo_per" not in tried(node__axes=1)
    assert tried(bus__identifier_bits=29)["identifier_bits"] == ({"bus.identifier_bits": 11},)
    assert tried(bus__identifier_bits=29, message__alarm__identifier=0x800)["identifier_bits"] == ()


def test_the_hosts_own_time_is_in_the_cycle_that_it_computes_in() -> None:
    hosted = profile(bus__host_us=500.0)
    assert terms(hosted)["host"] == 500
    assert terms(busplan.load_profile(hosted, changes={"bus.pipeline_cycles": 1}))["host"] == 0
    (found,) = busplan.capacity(hosted, timing_model=["worst-stuffing"]).results
    # Half of what nobody has measured is in doubt, beside the execution time.
    own_us = 2 * 0.1 / 12**0.5
    assert found.uncertainty_us == pytest.approx(2 * (own_us**2 + 250**2) ** 0.5)
    measured = busplan.load_profile(hosted, changes={"bus.host_grade": "measured", "bus.host_uncertainty_us": 5.0})
    (found,) = busplan.capacity(measured, timing_model=["worst-stuffing"]).results
    assert found.uncertainty_us == pytest.approx(2 * (own_us**2 + 5**2) ** 0.5)
    later = busplan.load_profile(hosted, changes={"bus.pipeline_cycles": 2})
    loop = busplan.latency(later, timing_model=["worst-stuffing"]).transactions[-1]
    assert loop.transaction == "loop"
    assert loop.phases["worst_response_us"] == sum(terms(later).values()) + 2 * 6000


def test_the_jitter_of_sync_reaches_the_circle() -> None:
    servo = busplan.load_profile("can-servo-8")
    # SYNC ends behind 55 us, or 135 us later: half of that either way.
    assert busplan.circle_test(servo).results[0].jitter_us == 67.5
    own = busplan.load_profile(servo, changes={"delivery.jitter_us": 10.0})
    assert busplan.circle_test(own).results[0].jitter_us == 77.5
    assert (
        busplan.circle_test(busplan.load_profile(servo, changes={"message.sdo-request.identifier": 0x10}))
        .results[0]
        .jitter_us
        == 135
    )


def test_the_expected_load_lies_between_no_stuff_bits_and_the_most() -> None:
    least, most = (own_figures(profile(), model) for model in ("no-stuffing", "worst-stuffing"))
    expected = least["bus_load"] + 0.4 * (most["bus_load"] - least["bus_load"])
    assert (least["expected_load"], most["expected_load"]) == pytest.approx((expected, expected))


def test_events_are_the_terms_with_what_blocks_and_what_interferes() -> None:
    servo = busplan.load_profile("can-servo-8", changes={"message.sdo-request.identifier": 0x10, "bus.host_us": 70.0})
    servo = busplan.load_profile(servo, changes={"bus.pipeline_cycles": 0})
    sums: dict[str, float] = {}
    for event in busplan.timeline(servo).cycle_events:
        if event.term:
            sums[event.term] = sums.get(event.term, 0.0) + event.duration_us
    (found,) = busplan.capacity(servo, timing_model=["worst-stuffing"]).results
    assert {key: us for key, us in sums.items() if us} == {term.key: term.us for term in found.terms if term.us}
    assert sums["cycle_blocking_us"] == 135 + 2 * 65  # a heartbeat may be late by its period, and one more be there
    assert sums["cycle_interference_us"] == 135


@pytest.mark.parametrize("load", [0.5, 0.9, 0.985, 0.992])
def test_a_cycle_waits_for_the_messages_that_arrive_in_it_and_for_no_more(load: float) -> None:
    # Six messages before SYNC: w is the smallest with w = SYNC + PDOs + sum of ceil((w + bit) / T) C, one by one.
    frame_us, number = 135.0, 6
    periods_us = [round(number * frame_us / load, 3) + place for place in range(number)]
    data = {
        "schema_version": 1,
        "name": "busy",
        "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "nodes": 1},
        "cycle": {"period_us": 1e6},
        "payload": {"read_bytes": 8, "write_bytes": 8},
        "node": {"axes": 1, "execution": {"kind": "linear", "base_us": 0.0, "per_byte_us": 0.0}},
        "message": [
            {"name": f"m{place}", "identifier": place + 1, "payload_bytes": 8, "period_us": period_us}
            for place, period_us in enumerate(periods_us)
        ],
    }
    own = CanProfile.model_validate(data)
    own_us = 55.0 + 2 * frame_us
    lasts_us, before_us = own_us, 0.0
    while lasts_us != before_us:
        before_us = lasts_us
        lasts_us = own_us + sum(ceil((before_us + 1) / period_us) * frame_us for period_us in periods_us)
    assert 0.48 < own_figures(own)["bus_load"] < 0.99
    assert sum(terms(own).values()) == pytest.approx(lasts_us, rel=1e-12)
