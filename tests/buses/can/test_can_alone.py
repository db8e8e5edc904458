"""Networks of messages alone, as a car's: no nodes, no SYNC, no cycle; loads, response times and deadlines."""

import json
import tomllib
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from tests.buses.can import machines
from tests.buses.can.machines import figures, loaded, phases
from tests.registers import at_least

Run = Callable[..., Any]
CAR = """\
schema_version = 1
name = "car"

[bus]
kind = "can"
bit_rate_kbit_s = 33.3
identifier_bits = 29

[[message]]
name = "wake"
identifier = 0x100
identifier_bits = 11
payload_bytes = 0
period_us = 1000000

[[message]]
name = "lights"
identifier = 0x10024040
payload_bytes = 2
period_us = 100000
jitter_us = 2000

[[message]]
name = "doors"
identifier = 0x10030060
payload_bytes = 6
period_us = 100000
deadline_us = 50000
"""


def car(**changes: Any) -> Any:
    return loaded(tomllib.loads(CAR), **changes)


def network(
    *messages: dict[str, Any], bit_rate_kbit_s: float = 500, data_bit_rate_kbit_s: float | None = None
) -> busplan.Profile:
    data = {} if data_bit_rate_kbit_s is None else {"data_bit_rate_kbit_s": data_bit_rate_kbit_s}
    named = [{"name": f"m{number}", **message} for number, message in enumerate(messages)]
    bus = {"kind": "can", "bit_rate_kbit_s": bit_rate_kbit_s, **data}
    return loaded({"schema_version": 1, "name": "alone", "bus": bus, "message": named})


def responses(own: Any) -> list[float | None]:
    return [*machines.responses(own).values()]


# --- outside oracles --------------------------------------------------------------------------------------------------


def test_a_published_network_of_five_messages() -> None:
    """A series on robot communication, part 10: 500 kbit/s, A 420, D and E 1230 us, a load of 13.9 %."""
    sizes, periods_us = (2, 8, 8, 8, 8), (10_000, 5000, 5000, 20_000, 100_000)
    own = network(
        *(
            {"identifier": number, "payload_bytes": size, "period_us": us}
            for number, (size, us) in enumerate(zip(sizes, periods_us, strict=True), start=1)
        )
    )
    us = responses(own)
    assert (us[0], us[3], us[4]) == (420, 1230, 1230)
    assert busplan.CanMessageFigures.of(busplan.capacity(own).verdicts[0].figures).bus_load == pytest.approx(
        0.139, abs=5e-4
    )


def test_the_worst_instance_is_not_the_first() -> None:
    """Davis, Burns, Bril and Lukkien 2007, Table 2: 2000, 3000 and 3500 us at 125 kbit/s."""
    periods_us = (2500, 3500, 3500)
    own = network(
        *({"identifier": number, "payload_bytes": 7, "period_us": us} for number, us in enumerate(periods_us)),
        bit_rate_kbit_s=125,
    )
    assert responses(own) == [2000, 3000, 3500]


class Sent(NamedTuple):
    """A message as an arbiter has it."""

    place: str
    """Its bits in the arbitration, of which the smaller wins: 11, RTR and IDE, or 11, SRR, IDE, 18 and RTR."""
    frame_us: float
    period_us: float
    jitter_us: float


def frames_by_identifier(own: Any) -> list[Sent]:
    frames_us = [each["frame_us"] for each in phases(own).values()]
    return [
        Sent(
            f"{message.identifier:011b}00"
            if (message.identifier_bits or own.bus.identifier_bits) == 11
            else f"{message.identifier >> 18:011b}11{message.identifier & 0x3FFFF:018b}0",
            us,
            message.period_us,
            message.jitter_us,
        )
        for message, us in zip(own.message, frames_us, strict=True)
    ]


def simulated(own: Any) -> list[float]:
    """The longest response of each message by an arbiter, from its critical instant to the end of its busy period.

    All messages of higher priorities are queued at once, as late as they may be and then as early, just after the
    longest frame of a lower priority has started.
    """
    each = frames_by_identifier(own)
    return [_simulated(message, each, 1000 / own.bus.bit_rate_kbit_s) for message in each]


def _simulated(own: Sent, each: Sequence[Sent], bit_us: float) -> float:
    lower = [message.frame_us for message in each if message.place > own.place]
    rivals = sorted(message for message in each if message.place <= own.place)
    now_us, sent, longest_us = max(lower, default=0.0), dict.fromkeys(range(len(rivals)), 0), 0.0
    for _ in count():
        # What is queued within a bit of the start still takes part in the arbitration; our own frame is the last.
        for number, message in enumerate(rivals):
            queued_us = max(sent[number] * message.period_us - message.jitter_us, 0.0) if sent[number] else 0.0
            if queued_us < now_us + bit_us - 1e-9 if message is not own else queued_us <= now_us + 1e-9:
                break
        else:
            return longest_us
        now_us += message.frame_us
        if message is own:
            due_us = sent[number] * message.period_us - message.jitter_us
            longest_us = max(longest_us, now_us - due_us)
        sent[number] += 1
    raise AssertionError


MESSAGES = st.lists(
    st.fixed_dictionaries(
        {
            "identifier": st.integers(0, 0x7FF),
            "payload_bytes": st.integers(0, 8),
            "period_us": st.sampled_from([2000, 2500, 3500, 5000, 10_000, 100_000]),
            "jitter_us": st.sampled_from([0, 0, 300, 1900]),
            "identifier_bits": st.sampled_from([11, 29]),
            "fd": st.booleans(),
        }
    ),
    min_size=1,
    max_size=8,
    unique_by=lambda message: (message["identifier"], message["identifier_bits"]),
)


@given(MESSAGES, st.sampled_from([125, 500]))
@settings(max_examples=at_least(15, 120))
def test_a_simulated_arbiter_never_takes_longer_and_reaches_the_bound(
    messages: list[dict[str, Any]], rate: float
) -> None:
    own = network(*messages, bit_rate_kbit_s=rate, data_bit_rate_kbit_s=2000)
    bounds = responses(own)
    if None in bounds:
        return
    for bound, us in zip(bounds, simulated(own), strict=True):
        assert us == pytest.approx(bound)


@pytest.mark.slow
@given(
    st.lists(st.tuples(st.integers(0x170, 0x210), st.sampled_from([11, 29]), st.booleans()), max_size=8),
    st.one_of(st.none(), st.tuples(st.integers(1, 9), st.integers(1, 20))),
)
@settings(max_examples=at_least(40))
def test_identifiers_that_stand_twice_are_told(
    said: list[tuple[int, int, bool]], machine: tuple[int, int] | None
) -> None:
    """With and without a cycle; PDOs of over 8 bytes have frames 256 apart."""
    messages = [
        {"identifier": own, "identifier_bits": bits, "payload_bytes": 1, "period_us": 1e6, "name": f"m{number}"}
        | ({"per_node": True} if each and machine else {})
        for number, (own, bits, each) in enumerate(said)
    ]
    data: dict[str, Any] = {"schema_version": 1, "name": "any", "message": messages}
    data["bus"] = {"kind": "can", "bit_rate_kbit_s": 1000}
    if machine is not None:
        nodes, size = machine
        execution = {"kind": "linear", "base_us": 1.0, "per_byte_us": 0.0}
        data["bus"] |= {"nodes": nodes}
        data |= {"node": {"axes": 1, "execution": execution}, "cycle": {"period_us": 1e5}}
        data |= {"payload": {"read_bytes": size, "write_bytes": size}}
    elif not messages:
        return
    nodes, size = machine or (0, 0)
    frames = [(own, bits) for own, bits, each in said if not (each and machine)]
    frames += [(own + node, bits) for own, bits, each in said if each for node in range(1, nodes + 1)]
    pdos = [first + 0x100 * number for first in (0x181, 0x201) for number in range(-(-size // 8))]
    frames += [(first + node, 11) for first in pdos for node in range(nodes)]
    frames += [(0x80, 11)] if machine else []
    is_shared = len(set(frames)) < len(frames)
    profile = loaded(data)
    assert ("identifiers" in figures(profile).exceeded) == is_shared
    assert any(one.finding.code == "BP122" for one in busplan.check(profile).findings) == is_shared


# --- what each question says ------------------------------------------------------------------------------------------


def test_the_verdict_is_by_load_and_deadlines() -> None:
    answer = busplan.capacity(car())
    figures = answer.verdicts[0].figures
    bits = ((1000 / 33.3) * length for length in (55, 80 + 20, 80 + 60))
    load = sum(us / period_us for us, period_us in zip(bits, (1e6, 1e5, 1e5), strict=True))
    assert busplan.CanMessageFigures.of(figures).bus_load == pytest.approx(load)
    assert (figures.verdict, figures.nodes) == ("fits", 0)
    for key in (
        "period_us",
        "required_us",
        "margin_us",
        "safe_nodes",
        "binding_term",
        "cycle_sync_us",
        "uncertainty_us",
    ):
        assert figures.values()[key] is None
    late = busplan.capacity(car(**{"message.doors.deadline_us": 8000}))
    assert late.verdicts[0].figures.exceeded == ("deadline",)
    assert late.verdicts[0].change is not None
    assert [*late.verdicts[0].change.changes] == ["bus.bit_rate_kbit_s"]
    full = busplan.capacity(car(**{"limits.max_load": 0.05}))
    assert full.verdicts[0].figures.exceeded == ("load",)


def test_a_message_without_a_deadline_is_late_only_without_an_end(run: Run, tmp_path: Path) -> None:
    burst = {"message.doors.burst": 40}
    late: Any = car(**burst)
    free: Any = car(**burst, **{"message.doors.deadline_us": "none", "message.wake.deadline_us": "none"})
    assert figures(late).exceeded == ("deadline",)
    assert responses(free) == responses(late)
    assert figures(free).fits
    none = {f"message.{name}.deadline_us": "none" for name in ("wake", "lights", "doors")}
    assert figures(car(**none, **{"message.doors.period_us": 3000.0})).exceeded == ("load", "deadline")
    for own in (free, car(**burst, **none)):
        number = sum(message.deadline_us == "none" for message in own.message)
        path = tmp_path / f"car-{number}.toml"
        path.write_text(machines.text_of(own), encoding="utf-8")
        card = " ".join(run("capacity", str(path)).stdout.split())
        assert (f"{number} messages without a deadline" in card) is (number == 2)
        assert "us without a deadline" in card or number == 2
        assert [each["deadline_us"] for each in phases(own).values()] == [None, None if number == 3 else 100_000, None]


def test_a_message_without_a_deadline_blocks_as_one_that_may_be_late_for_ever() -> None:
    """The wait of a cycle, with SYNC or with requests, is no shorter than with any deadline."""
    for name in ("can-servo-8", "can-motors-8"):
        message = {"name": "slow", "identifier": 0x7F0, "payload_bytes": 8, "period_us": 50_000.0}
        us = []
        for deadline_us in (1000.0, 1e9, "none"):
            data: Any = busplan.load_profile(name).model_dump(exclude_unset=True)
            data["message"] = [{**message, "deadline_us": deadline_us}]
            us.append(figures(loaded(data)).required_us)
        assert us == sorted(us)
        assert us[-1] == us[-2] < float("inf")


def test_a_card_says_loads_and_the_latest_message_and_nothing_of_a_cycle(run: Run, tmp_path: Path) -> None:
    (tmp_path / "car.toml").write_text(CAR, encoding="utf-8")
    said = run("capacity", "car.toml", cwd=tmp_path).stdout
    assert said.startswith("car  CAN, 3 messages")
    assert "latest message  doors, 8858.9 us of 50000" in said
    for word in ("period", "free", "nodes", "axes", "None", "inf", "nan"):
        assert word not in said
    document = json.loads(run("capacity", "car.toml", "--format", "json", cwd=tmp_path).stdout)
    assert document["results"][0]["available_us"] is None


PERIODS_US = st.sampled_from([500.0, 2000.0, 10_000.0, 100_000.0])
OF_BITS = {
    bits: st.fixed_dictionaries(
        {
            "identifier": st.integers(0, 0x7FF),
            "payload_bytes": st.integers(0, 8),
            "period_us": PERIODS_US,
            **({} if bits is None else {"identifier_bits": st.just(bits)}),
        }
    )
    for bits in (None, 11, 29)
}


@settings(max_examples=at_least(5, 40))
@given(
    messages=st.lists(st.one_of(*OF_BITS.values()), min_size=1, max_size=4),
    bits=st.sampled_from([11, 29]),
    bit_rate_kbit_s=st.sampled_from([20, 125, 1000]),
)
def test_every_question_on_messages_of_either_length_is_answered(
    messages: list[dict[str, Any]], bits: int, bit_rate_kbit_s: float
) -> None:
    own = busplan.load_profile(
        network(*messages, bit_rate_kbit_s=bit_rate_kbit_s), changes={"bus.identifier_bits": bits}
    )
    (verdict,) = busplan.capacity(own).verdicts
    fits = verdict.figures.verdict == "fits"
    assert busplan.check(own).passed == fits
    assert (busplan.plan(own).recommended_changes == {}) == fits
    loads = busplan.sweep(own, vary={"bus.identifier_bits": [11, 29]})["bus_load"]
    each = (
        busplan.capacity(busplan.load_profile(own, changes={"bus.identifier_bits": each})).figures for each in (11, 29)
    )
    assert list(loads) == pytest.approx(
        [busplan.CanMessageFigures.of(result).bus_load for results in each for result in results]
    )


def test_a_length_that_no_message_has_is_no_setting(run: Run, tmp_path: Path) -> None:
    head = CAR[: CAR.index("[[message]]")].replace("33.3", "125")
    message = (
        '[[message]]\nname = "m{0}"\nidentifier = {0}\nidentifier_bits = 11\npayload_bytes = 8\nperiod_us = 2000\n'
    )
    (tmp_path / "car.toml").write_text(head + message.format(1) + message.format(2), encoding="utf-8")
    for command, code in ((("capacity",), 0), (("check",), 1), (("plan",), 0), (("report", "-o", "car.html"), 0)):
        done = run(command[0], "car.toml", *command[1:], cwd=tmp_path)
        assert (done.returncode, "itself failed" in done.stderr) == (code, False)
    free = run("plan", "car.toml", "--free", "identifier_bits", cwd=tmp_path)
    assert "NO PLAN. No change of length of identifiers is enough" in free.stdout


def test_plan_raises_the_bit_rate_to_the_first_that_is_enough() -> None:
    own = car(**{"message.doors.deadline_us": 8000})
    answer = busplan.plan(own)
    assert answer.recommended_changes == {"bus.bit_rate_kbit_s": 50}
    fits = busplan.capacity(busplan.load_profile(own, changes=answer.recommended_changes))
    assert fits.verdict == "fits"
    none = busplan.plan(car(**{"message.doors.deadline_us": 100}))
    assert none.recommended is None


def test_messages_that_all_say_their_11_bits_are_answered_on_a_bus_of_29() -> None:
    alone = network({"identifier": 5, "identifier_bits": 11, "payload_bytes": 8, "period_us": 10_000})
    own = busplan.load_profile(alone, changes={"bus.identifier_bits": 29})
    assert busplan.capacity(own).report().blocks
    assert busplan.plan(own, free=["identifier_bits"]).report().blocks


def test_a_sweep_and_a_map_agree_with_capacity_point_by_point() -> None:
    rates, deadlines_us = [33.3, 125.0], [5000.0, 50_000.0]
    vary = {"bus.bit_rate_kbit_s": rates, "message.doors.deadline_us": deadlines_us}
    rows = busplan.sweep(car(), vary=vary).to_dict()["rows"]
    pictured = busplan.map_(car(), x={"bus.bit_rate_kbit_s": rates}, y={"message.doors.deadline_us": deadlines_us})
    for row in rows:
        own = car(**{key: row[key] for key in vary})
        (figures,) = busplan.capacity(own, timing_model=row["timing_model"]).figures
        for key, value in figures.by_key().items():
            assert row[key] == (pytest.approx(value) if isinstance(value, float) else value), key
        if figures.verdict is not None:
            cells: Any = pictured.rows[deadlines_us.index(row["message.doors.deadline_us"])]
            assert cells[rates.index(row["bus.bit_rate_kbit_s"])].state == figures.verdict
    # Without a cycle there is no margin.
    assert {cell["margin_corrected_us"] for cell in pictured.to_dict()["cells"]} == {None}


@pytest.mark.parametrize("number", [3, 400])
def test_many_messages_are_answered_as_few_are(number: int) -> None:
    messages = [
        {"identifier": own, "payload_bytes": own % 9, "period_us": 30_000 * (1 + own % 7), "jitter_us": own}
        for own in range(number)
    ]
    own = network(*messages, bit_rate_kbit_s=1000)
    each = frames_by_identifier(own)
    assert sum(message.frame_us / message.period_us for message in each) < 1
    us = responses(own)
    for place in {0, number // 2, number - 1}:
        assert us[place] == pytest.approx(_simulated(each[place], each, bit_us=1.0))


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (busplan.timeline, "a network of messages alone has no cycle, which timeline needs"),
        (busplan.compare, "a network of messages alone has no cycle, which compare needs"),
        (busplan.map_, "a network of messages alone has no cycle, which a map of period and axes needs"),
        (lambda own: busplan.capacity(own, sensitivity=True), "messages alone has no cycle"),
        (lambda own: busplan.capacity(own, period_us=4000), "messages alone have no cycle"),
        (lambda own: busplan.plan(own, axes=4), "which a plan for axes needs"),
        (busplan.circle_test, "messages alone have no axes that could move"),
        (lambda own: busplan.explain(own, "required_us"), "required_us: no equation leads to it"),
        (lambda own: busplan.sweep(own, vary={"cycle.period_us": [1000]}), "messages alone have no cycle"),
    ],
)
def test_what_asks_for_a_cycle_refuses_them(ask: Callable[[Any], Any], words: str) -> None:
    with pytest.raises(busplan.BusplanError, match=words):
        ask(car())


@pytest.mark.parametrize(
    ("more", "place", "words"),
    [
        ("[cycle]\nperiod_us = 4000\n", "cycle", "has no nodes; add bus.nodes, [node] and [payload], or remove it"),
        ("[servo]\nstep_us = 100\n", "servo", "asks for nodes, and a network of messages alone has none"),
        ("[limits]\nreserve = 0.1\n", "limits.reserve", "asks for nodes, and a network of messages alone has none"),
        (
            '[[message]]\nname="b"\nidentifier=1\npayload_bytes=1\nperiod_us=1e6\nper_node=true\n',
            "per_node",
            "asks for nodes",
        ),
        ("[payload]\nread_bytes = 8\nwrite_bytes = 8\n", "", "missing section [node]"),
    ],
)
def test_keys_of_a_cycle_are_refused_where_they_stand(more: str, place: str, words: str) -> None:
    with pytest.raises(busplan.BusplanError) as refused:
        loaded(tomllib.loads(CAR + more))
    assert any(words in problem and place in problem for problem in refused.value.problems)


def test_the_report_has_no_part_of_a_cycle(run: Run, tmp_path: Path) -> None:
    (tmp_path / "car.toml").write_text(CAR, encoding="utf-8")
    page = run("report", "car.toml", cwd=tmp_path).stdout
    assert "car" in page
    for word in ("The cycle to scale", "against period", "Is the circle", "execution time", ">None<", "nan"):
        assert word not in page


def test_messages_alone_have_no_figures_of_a_cycle() -> None:
    answer = busplan.capacity(car())
    assert not hasattr(answer.verdicts[0].figures, "period_us")
    for asked in ("results", "margin_us"):
        with pytest.raises(busplan.BusplanError, match="no cycle"):
            getattr(answer, asked)
    with pytest.raises(busplan.BusplanError, match="no cycle"):
        _ = answer.verdicts[0].deciding
