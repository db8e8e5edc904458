"""A CAN bus: its cycle by hand, its identifiers, its limits and rules, and every question in some form."""

import json
import re
from collections.abc import Callable
from math import ceil, inf
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import busplan
from busplan.questions.fit.certainty import deciding_cycle
from busplan.questions.fit.network import network_of
from tests.buses.can.machines import figures, last_frames, loaded, phases, responses, terms, text_of
from tests.oracles import can_textbook as textbook

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
    return loaded(DATA, **changes)


def in_groups(*groups: dict[str, Any]) -> busplan.Profile:
    """The same network with groups of nodes."""
    data = {key: section for key, section in DATA.items() if key not in ("payload", "node")}
    data["bus"] = {key: value for key, value in DATA["bus"].items() if key != "nodes"}
    return loaded({**data, "group": [{**DATA["node"], **group} for group in groups]})


def test_its_cycle_is_that_by_hand() -> None:
    pdo_in, pdo_out, alarm = (135 + 75) * BIT_US, 115 * BIT_US, 75 * BIT_US
    others = 55 * BIT_US + (50 + 46) + 3 * (pdo_in + pdo_out)
    assert others == 2156  # within 2000 us less the jitter two alarms arrive, and go before all PDOs
    assert terms(profile()) == {
        "jitter": 0,
        "sync": 110,
        "wait": 96,
        "feedback": 3 * pdo_in,
        "adapter": 0,
        "host": 0,
        "command": 3 * pdo_out,
        "blocking": 0,
        "interference": 2 * alarm,
        "nonperiodic": 0,
    }
    assert terms(profile(), "no-stuffing")["feedback"] == 3 * (47 + 64 + 47 + 16) * BIT_US
    assert terms(profile(bus__sync_counter=True))["sync"] == 65 * BIT_US
    assert terms(profile(bus__identifier_bits=29))["command"] == 3 * 140 * BIT_US


@pytest.mark.parametrize("load", [0.5, 0.985, 0.9895, 0.9905, 0.9998, 1.0, 1.2])
def test_a_cycle_behind_a_nearly_full_bus_is_a_bound_in_closed_form(load: float) -> None:
    # One message goes before all PDOs, and one behind them may block: three frames of it, in a cycle so long.
    frame, period_us, others = 135 * BIT_US, 135 * BIT_US / load, (55 + 3 * (135 + 75) + 3 * 115) * BIT_US
    urgent = {"name": "urgent", "identifier": 0x10, "payload_bytes": 8, "period_us": period_us}
    low = {"name": "low", "identifier": 0x7FF, "payload_bytes": 0, "period_us": 50_000.0, "deadline_us": 50_000.0}
    busy = loaded({**DATA, "message": [urgent, low]}, node__execution__base_us=0, node__execution__per_byte_us=0)

    def blocked(span: float) -> float:
        return ceil(min((span + 50_000) / 50_000, 3)) * 55 * BIT_US

    if load > 0.99:
        span = (others + blocked(inf) + frame + load * BIT_US) / (1 - min(load, 0.9999))
    else:
        span = float(others)
        while span < (wider := others + blocked(span) + ceil((span + BIT_US) / period_us) * frame):
            span = wider
    us = terms(busy)
    assert us["interference"] == pytest.approx(ceil((span + BIT_US) / period_us) * frame)
    assert us["blocking"] == blocked(span)


def test_a_pdo_for_each_axis_shares_the_payload() -> None:
    us = terms(profile(payload__pdo_per="axis"))
    assert (us["feedback"], us["command"]) == (6 * 105 * BIT_US, 6 * 85 * BIT_US)


def test_its_load_counts_every_message() -> None:
    found = figures(profile())
    assert found.own.bus_load == pytest.approx((110 + 3 * 420 + 3 * 230) / 6000 + 150 / 2000)
    assert (found.verdict, found.bias_us) == ("fits", None)
    assert found.uncertainty_us == pytest.approx(2 * 2 * 0.1 / 12**0.5)


def test_identifiers_follow_those_of_the_pre_defined_connection_set() -> None:
    # The last frame of each: that of the third node, which has a second one for the last 2 bytes of feedback.
    assert last_frames(profile()) == [
        ("SYNC", 0x80, 0),
        ("feedback", 0x283, 2),
        ("command", 0x203, 6),
        ("alarm", 0x90, 2),
    ]


def test_a_payload_beyond_all_pdos_breaks_the_limit_and_is_counted_in_full() -> None:
    huge = profile(payload__read_bytes=100_000)
    assert terms(huge)["feedback"] == 3 * 12_500 * 135 * BIT_US
    assert "payload" in figures(huge).exceeded


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
    drives = {"name": "drives", "axes": 1, "nodes": 2, "read_bytes": 8, "write_bytes": 8}
    io = {"name": "io", "axes": 0, "nodes": 3, "read_bytes": 2, "write_bytes": 1, "command_identifier": 0x301}
    own = in_groups(drives, io)
    assert last_frames(own)[1:-1] == [
        ("drives feedback", 0x182, 8),
        ("io feedback", 0x185, 2),
        ("drives command", 0x202, 8),
        ("io command", 0x303, 1),
    ]
    assert [group.name for group in figures(own).groups] == ["drives", "io"]
    assert [doubt.key for doubt in figures(own).doubts] == ["group.execution", "bus.host_us"]
    assert [doubt.key for doubt in figures(profile()).doubts] == ["node.execution", "bus.host_us"]
    events = busplan.timeline(own).cycle_events
    assert figures(own).required_us == sum(event.duration_us for event in events if event.term)


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
    findings = busplan.check(busplan.load_profile(profile(), changes=changes)).findings
    collisions = [one.finding for one in findings if one.finding.code == "BP122"]
    assert len({finding.key for finding in collisions}) == len(collisions)
    assert any(words in finding.message for finding in collisions)


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
    found = figures(busplan.load_profile(profile(), changes=changes))
    assert found.exceeded == exceeded
    assert (found.verdict == "does not fit") == bool(exceeded)


def test_responses_are_those_by_hand_and_their_parts_add_up() -> None:
    answers = phases(profile())
    assert list(answers) == ["SYNC", "feedback", "command", "alarm", "loop"]
    # The alarm waits for one full frame and SYNC; the last command for everything, but the second feedback frames.
    assert answers["alarm"]["worst_response_us"] == 100 + 270 + 110 + 150
    assert answers["command"]["worst_response_us"] == 150 + 110 + 3 * 270 + 2 * 230 + 230 + 150
    parts = ("jitter", "blocking", "interference", "backlog", "frame", "execution", "pipeline", "sync_wait")
    for answer in answers.values():
        assert answer["worst_response_us"] == sum(answer[f"{key}_us"] or 0.0 for key in parts)


@pytest.mark.parametrize(("identifier", "before"), [(0x80, 0), (0x190, 3), (0x210, 6), (0x2A0, 9)])
def test_sync_waits_for_pdos_of_smaller_identifiers(identifier: int, before: int) -> None:
    """Three nodes with feedback from 0x181 on, commands from 0x201 on, and the second feedback from 0x281 on."""
    late = {"message__alarm__identifier": 0x600, "message__alarm__jitter_us": 0.0, "cycle__period_us": 20_000.0}
    frames = [135 * BIT_US] * 3 + [115 * BIT_US] * 3 + [75 * BIT_US] * 3
    found = responses(profile(bus__sync_identifier=identifier, **late))["SYNC"]
    assert found == 75 * BIT_US + sum(frames[:before]) + 55 * BIT_US


@given(st.data())
def test_the_last_pdo_of_a_group_answers_last_of_it(data: st.DataObject) -> None:
    sizes = {"feedback": data.draw(st.integers(1, 24)), "command": data.draw(st.integers(1, 24))}
    nodes, period_us = data.draw(st.integers(1, 5)), data.draw(st.integers(4000, 9000))
    alarm, alarm_us = (
        data.draw(st.sampled_from([0x10, 0x190, 0x1F0, 0x210, 0x2A0, 0x7FF])),
        data.draw(st.integers(700, 3000)),
    )
    answers = phases(
        profile(
            bus__nodes=nodes,
            payload__read_bytes=sizes["feedback"],
            payload__write_bytes=sizes["command"],
            message__alarm__identifier=alarm,
            message__alarm__period_us=float(alarm_us),
            cycle__period_us=float(period_us),
        )
    )

    def sender(size: int, us: int, jitter_us: int = 0) -> textbook.Sender:
        return textbook.Sender((55 + 10 * size) * BIT_US, us, jitter_us)

    sent = {0x80: sender(0, period_us), alarm: sender(2, alarm_us, 100)}
    each = {"SYNC": [0x80], "alarm": [alarm]}
    for first, (name, size) in zip((0x181, 0x201), sizes.items(), strict=True):
        for number, left in enumerate(range(size, 0, -8)):
            each[name] = [first + 0x100 * number + node for node in range(nodes)]
            sent |= dict.fromkeys(each[name], sender(min(left, 8), period_us))
    for name, identifiers in each.items():
        # No PDO of a cycle that fits blocks the next SYNC.
        blocking = sent if name != "SYNC" else {alarm: sent[alarm]}
        alone = [
            textbook.response_us(
                sent[identifier],
                [higher for other, higher in sent.items() if other < identifier],
                blocking_us=max((lower.frame_us for other, lower in blocking.items() if other > identifier), default=0),
                bit_us=BIT_US,
                most_us=500_000,
            )
            for identifier in identifiers
        ]
        worst_us, instance = answers[name]["worst_response_us"], answers[name]["instance"]
        # A message may also meet a late cycle, and the next one soon behind it.
        late = name == "alarm" and (worst_us is None or alone[-1] is None or worst_us > alone[-1][0])
        assert late or (None if worst_us is None else (worst_us, instance)) == alone[-1]
        assert worst_us is None or all(answer is not None and answer[0] <= worst_us for answer in alone)


def test_a_full_bus_says_that_there_is_no_response_time(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "press.toml"
    path.write_text(text_of(profile(cycle__period_us=2000.0, message__alarm__identifier=0x600)), encoding="utf-8")
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
    path.write_text(text_of(busplan.load_profile("can-servo-8")) + many, encoding="utf-8")
    said = run("latency", path.name, "--timing-model", "worst-stuffing", cwd=tmp_path).stdout
    assert "22 of 47 messages miss their deadlines by the worst-stuffing model; m40 takes up to " in said
    assert "Not shown: 33 rows. --all shows all." in said
    assert [word for word in ("m0 ", "m27 ", "m28 ", "m40 ") if f"\n{word}" in said] == ["m28 ", "m40 "]
    whole = run("latency", path.name, "--timing-model", "worst-stuffing", "--all", cwd=tmp_path).stdout
    assert "\nm0 " in whole


@pytest.mark.parametrize(
    ("rate_kbit_s", "load", "allowed", "key", "least", "most"),
    # At 500 kbit/s the next rate; at the highest rate a period of 6000 us by 20.9 to 20, and a little.
    [(500, "41.8%", 0.4, "bus.bit_rate_kbit_s", 800, 800), (1000, "20.9%", 0.2, "cycle.period_us", 6270, 6400)],
)
def test_a_cure_of_the_load_is_a_higher_rate_or_a_longer_period(
    rate_kbit_s: int, load: str, allowed: float, key: str, least: float, most: float, run: Run, tmp_path: Path
) -> None:
    busy = profile(limits__max_load=allowed, bus__bit_rate_kbit_s=rate_kbit_s)
    path = tmp_path / "press.toml"
    path.write_text(text_of(busy), encoding="utf-8")
    said = run("check", path.name, cwd=tmp_path).stdout
    assert f"BP121 error: limits.max_load: the bus load with the longest bits is {load}, {allowed:.1%} allowed" in said
    cured = float(said.rpartition(f"cheapest cure: {key} = ")[2].split("\n")[0])
    assert busplan.capacity(busplan.load_profile(busy, changes={key: cured})).verdict == "fits"
    assert least <= cured <= most


def test_the_circle_has_its_set_points_from_sync() -> None:
    def delays_us(**changes: Any) -> tuple[float, float]:
        (circle,) = busplan.circle_test(
            busplan.load_profile("can-servo-8", changes={"servo.loop": "host", "bus.pipeline_cycles": 0, **changes})
        ).results
        return circle.delay_x_us, circle.delay_y_us

    # The first and the last command are executed behind SYNC, the wait for feedback, nine, or sixteen, frames, and
    # three others, of which two have 8 bytes.
    on_arrival = tuple(55 + 200 + frames * 135 + (135 + 135 + 65) + 200 for frames in (9, 16))
    assert delays_us(**{"servo.update": "next_sync"}) == (4000, 4000)
    assert delays_us(**{"servo.update": "on_arrival"}) == on_arrival
    late = delays_us(**{"servo.update": "on_arrival", "bus.pipeline_cycles": 1})
    assert late == tuple(us + 4000 for us in on_arrival)


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
    with pytest.raises(busplan.BusplanError, match=words):
        busplan.load_profile(profile(), changes=changes)


def test_groups_with_one_identifier_are_refused() -> None:
    node = {"axes": 1, "read_bytes": 8, "write_bytes": 8, "nodes": 2, "feedback_identifier": 0x190}
    with pytest.raises(busplan.BusplanError, match=r"group\.b\.feedback_identifier = 400: an earlier group has it"):
        in_groups({**node, "name": "a"}, {**node, "name": "b"})


@pytest.mark.parametrize("name", ["alarm", "SYNC", "feedback"])
def test_messages_have_names_of_their_own(name: str) -> None:
    messages = [*DATA["message"], {**DATA["message"][0], "name": name}]
    with pytest.raises(busplan.BusplanError, match=r"of this name|are called"):
        loaded({**DATA, "message": messages})


def test_all_that_does_not_agree_is_said_at_once() -> None:
    messages = [{**DATA["message"][0], "name": name, "identifier": 0x800, "fd": True} for name in ("SYNC", "alarm")]
    with pytest.raises(busplan.BusplanError) as refused:
        loaded({**DATA, "message": messages})
    problems = "\n".join(refused.value.problems)
    for words, times in (("are called", 1), ("is over 2047", 2), ("asks for bus.data_bit_rate_kbit_s", 2)):
        assert problems.count(words) == times


def test_init_writes_a_profile_of_it_that_fits(run: Run, tmp_path: Path) -> None:
    done = run("init", "press", "--bus", "can", "--axes", "10", cwd=tmp_path)
    assert done.returncode == 0
    assert "--period 10ms" in done.stderr
    assert re.search(r"\npress  CAN, 3 nodes, 10 axes, 10 ms +FITS\n", done.stderr)
    found = busplan.load_profile(tmp_path / "press.toml")
    assert (found.bus.kind, len(found.group)) == ("can", 2)
    done = run("init", "other", "--bus", "lon", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("--bus lon: no kind of bus; there are ieee1394, can")


@pytest.mark.parametrize("nodes", [12, 28])
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


@pytest.mark.parametrize("nodes", [8, 20])
def test_the_smallest_period_keeps_the_load(nodes: int) -> None:
    many = busplan.load_profile("can-servo-8", changes={"bus.nodes": nodes})
    smallest_us = figures(many).safe_min_period_us or 0.0
    at = figures(busplan.load_profile(many, changes={"cycle.period_us": smallest_us}))
    assert (at.verdict, at.exceeded) == ("fits", ())
    below = figures(busplan.load_profile(many, changes={"cycle.period_us": smallest_us * (1 - 1e-6)}))
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
    # A guess is not enough.
    path.write_text("\n".join((text, *sections)), encoding="utf-8")
    assert busplan.capacity(path).verdict == "not shown to fit"
    text = text.replace('grade = "assumed"          # between 0', 'grade = "measured" # not between 0')
    path.write_text("\n".join((text, *sections)), encoding="utf-8")
    found, _ = busplan.capacity(path).results
    assert busplan.CanFigures.of(found).bus_load == pytest.approx(0.787, abs=1e-3)
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


def test_identifiers_of_11_bits_are_a_setting_where_all_are_small_enough() -> None:
    long = {"bus__identifier_bits": 29, "limits__max_load": 0.45, "message__alarm__deadline_us": 6000.0}

    def plan(**changes: Any) -> Any:
        return busplan.plan(profile(**long, **changes), free=["identifier_bits"])

    assert plan().recommended_changes == {"bus.identifier_bits": 11}
    assert plan(message__alarm__identifier=0x7FF).recommended_changes == {"bus.identifier_bits": 11}
    assert plan(message__alarm__identifier=0x800).recommended_changes is None


def test_the_hosts_own_time_is_in_the_cycle_that_it_computes_in() -> None:
    hosted = profile(bus__host_us=500.0)
    assert terms(hosted)["host"] == 500
    assert terms(busplan.load_profile(hosted, changes={"bus.pipeline_cycles": 1}))["host"] == 0
    found = figures(hosted)
    # What nobody has measured is between 0 and twice its value, beside the execution time.
    own_us = 2 * 0.1 / 12**0.5
    assert found.uncertainty_us == pytest.approx(2 * (own_us**2 + 500**2 / 3) ** 0.5)
    measured = busplan.load_profile(hosted, changes={"bus.host_grade": "measured", "bus.host_uncertainty_us": 5.0})
    found = figures(measured)
    assert found.uncertainty_us == pytest.approx(2 * (own_us**2 + 5**2) ** 0.5)
    later = busplan.load_profile(hosted, changes={"bus.pipeline_cycles": 2})
    assert responses(later)["loop"] == 3 * 6000
    on_arrival = busplan.load_profile(later, changes={"servo.update": "on_arrival"})
    assert responses(on_arrival)["loop"] == sum(terms(later).values()) + 2 * 6000


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
    models = "no-stuffing", "worst-stuffing"
    least, most = (busplan.CanFigures.of(figures(profile(), model)) for model in models)
    expected = least.bus_load + 0.4 * (most.bus_load - least.bus_load)
    assert (least.expected_load, most.expected_load) == pytest.approx((expected, expected))


def test_events_are_the_terms_with_what_blocks_and_what_interferes() -> None:
    servo = busplan.load_profile("can-servo-8", changes={"message.sdo-request.identifier": 0x10, "bus.host_us": 70.0})
    servo = busplan.load_profile(servo, changes={"bus.pipeline_cycles": 0})
    sums: dict[str, float] = {}
    for event in busplan.timeline(servo).cycle_events:
        if event.term:
            sums[event.term] = sums.get(event.term, 0.0) + event.duration_us
    assert {key: us for key, us in sums.items() if us} == {
        term.key: term.us for term in figures(servo).terms if term.us
    }
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
    own = loaded(data)
    own_us = 55.0 + 2 * frame_us
    lasts_us, before_us = own_us, 0.0
    while lasts_us != before_us:
        before_us = lasts_us
        lasts_us = own_us + sum(ceil((before_us + 1) / period_us) * frame_us for period_us in periods_us)
    assert 0.48 < figures(own).own.bus_load < 0.99
    assert sum(terms(own).values()) == pytest.approx(lasts_us, rel=1e-12)


@pytest.mark.parametrize("name", ["can-servo-8", "canopen-6", "can-fd-arm-7", "can-motors-8"])
@pytest.mark.parametrize("pdo_per", ["node", "axis"])
def test_the_largest_payload_is_four_frames_of_each_pdo(name: str, pdo_per: str) -> None:
    axes = 3 if pdo_per == "axis" else 1
    plan = busplan.load_profile(name, changes={"node.axes": axes, "payload.pdo_per": pdo_per})
    network = network_of(plan)
    most_bytes = network.bus.payloads(network).most_bytes
    for size, is_kept in ((most_bytes, True), (most_bytes + 1, False)):
        larger = network_of(busplan.load_profile(plan, changes={"payload.write_bytes": size}))
        (limit,) = (one for one in larger.bus.limits if one.key == "payload")
        assert (limit.value(larger) <= limit.most(larger)) == is_kept


@pytest.mark.parametrize(("extra_us", "alarms"), [(100.0, 0), (1500.0, 1), (3900.0, 2)])
def test_a_longer_wait_lets_more_messages_go_before_the_commands(extra_us: float, alarms: int) -> None:
    # 2110 us without alarms and without the commands' execution: two alarms, ceil((w + 100 + 2) / 2000), go first.
    cycle = deciding_cycle(network_of(profile()))
    assert cycle.added_us(extra_us) == pytest.approx(extra_us + alarms * 75 * BIT_US)
