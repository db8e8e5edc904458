"""Polled buses beside an event simulation, published figures, and what a user may get wrong."""

import os
import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from typer.testing import CliRunner

import busplan
from busplan import BusplanError, Profile
from busplan.buses import kind_named
from busplan.buses.polled.cycle import PolledCycle
from busplan.cli import app
from busplan.questions.fit.network import network_of
from busplan.sections.base import value_at
from busplan.sourced import Grade
from tests.oracles.polled_simulation import DYNAMIXEL, FEETECH, RATIOS, modbus_us, profibus_us, servos_us

OWN = """\
schema_version = 1
name = "own"
[bus]
kind = "polled"
bit_rate_kbit_s = 500
nodes = 5
[bus.protocol]
bits_per_byte = 10
read_request_bytes = 6
read_answer_bytes = 5
write_request_bytes = 6
[cycle]
period_us = 10000
[payload]
read_bytes = 4
write_bytes = 4
[node]
axes = 1
[node.execution]
kind = "linear"
grade = "measured"
base_us = 100
per_byte_us = 0
"""


def changed(name: str, **changes: Any) -> Profile:
    """A shipped profile with other values by dotted key, __ for the dot."""
    return busplan.load_profile(name, changes={key.replace("__", "."): value for key, value in changes.items()})


def required_us(profile: Profile | Path, model: str = "standard") -> float:
    (result,) = busplan.capacity(profile, timing_model=[model]).results
    return float(result.required_us)


def servo(**changes: Any) -> Profile:
    """The shipped arm, with a servo's own time of 50 us, without adapter and host."""
    own: dict[str, Any] = {"node__execution__base_us": 50.0, "bus__adapter": "none", "bus__host_us": 0.0}
    return changed("dynamixel-arm-14", **{**own, **changes})


drives = st.lists(st.tuples(st.integers(1, 244), st.integers(1, 244)), min_size=1, max_size=6)


@given(
    st.sampled_from(sorted(RATIOS)),
    st.integers(1, 20),
    st.integers(1, 244),
    st.integers(1, 244),
    st.booleans(),
    st.data(),
)
def test_profibus_lies_between_its_ends_and_the_ends_are_simulated(
    rate: float, nodes: int, read: int, write: int, is_isochronous: bool, data: st.DataObject
) -> None:
    profile = changed(
        "profibus-drives-6",
        bus__bit_rate_kbit_s=float(rate),
        bus__nodes=nodes,
        bus__global_control=is_isochronous,
        payload__read_bytes=read,
        payload__write_bytes=write,
        bus__clock_tolerance=0.0,
        cycle__nonperiodic_us=0.0,
        cycle__period_us=1e6,
    )

    def simulated(sdr: int | None) -> float:
        def wait() -> Fraction:
            return Fraction(data.draw(st.integers(32, RATIOS[rate][0])) if sdr is None else sdr)

        return profibus_us(rate, [(write, read)] * nodes, sdr=wait, is_isochronous=is_isochronous)

    (result,) = busplan.capacity(profile, timing_model=["standard"]).results
    middle_us, u_us = result.required_us, float(result.uncertainty_us or 0)
    assert required_us(profile, "typical") == pytest.approx(simulated(32), rel=1e-9)
    assert middle_us - u_us == pytest.approx(simulated(32), rel=1e-9)
    assert middle_us + u_us == pytest.approx(simulated(RATIOS[rate][0]), rel=1e-9)
    assert middle_us - u_us - 1e-6 <= simulated(None) <= middle_us + u_us + 1e-6


@given(
    st.sampled_from(["dynamixel-2", "feetech"]),
    st.sampled_from([57.6, 115.2, 1000.0]),
    st.integers(1, 40),
    st.integers(0, 60),
    st.integers(0, 60),
    st.integers(1, 4),
    st.booleans(),
    st.sampled_from([0.0, 250.0, 500.0]),
)
@example("dynamixel-2", 1000.0, 6, 0, 4, 1, True, 250.0)
@example("feetech", 1000.0, 6, 6, 0, 2, True, 250.0)
def test_servos_are_those_of_the_simulation(
    protocol: str,
    rate: float,
    nodes: int,
    read: int,
    write: int,
    reads: int,
    is_sync: bool,
    delay_us: float,
) -> None:
    assume(read or write)
    profile = servo(
        bus__protocol=protocol,
        bus__bit_rate_kbit_s=rate,
        bus__nodes=nodes,
        bus__reads=reads,
        bus__requests="sync" if is_sync else "single",
        bus__return_delay_us=delay_us,
        payload__read_bytes=read,
        payload__write_bytes=write,
    )
    simulated_us = servos_us(
        FEETECH if protocol == "feetech" else DYNAMIXEL,
        rate,
        nodes,
        read=read,
        write=write,
        reads=reads,
        is_sync=is_sync,
        turn_us=delay_us + 50,
    )
    assert required_us(profile) == pytest.approx(simulated_us, rel=1e-9)


def modbus(rate: float = 19.2, **changes: Any) -> Profile:
    changes = {"bus__nodes": 3, "bus__requests": "exchange", **changes}
    return servo(bus__protocol="modbus-rtu", bus__bit_rate_kbit_s=rate, **changes)


@given(
    st.sampled_from([9.6, 19.2, 38.4, 115.2]), st.booleans(), st.integers(0, 80), st.integers(0, 80), st.integers(1, 4)
)
def test_modbus_is_that_of_the_simulation(rate: float, is_exchange: bool, read: int, write: int, reads: int) -> None:
    assume(read or write)
    reads = 1 if is_exchange else reads
    way = "exchange" if is_exchange else "single"
    profile = modbus(rate, bus__requests=way, bus__reads=reads, payload__read_bytes=read, payload__write_bytes=write)
    simulated_us = modbus_us(rate, 3, read=read, write=write, node_us=50, is_exchange=is_exchange, reads=reads)
    assert required_us(profile) == pytest.approx(simulated_us, rel=1e-9)
    drawn_us = sum(event.duration_us for event in busplan.timeline(profile).cycle_events if event.term)
    assert drawn_us == pytest.approx(simulated_us, rel=1e-9)


def test_a_register_of_modbus_has_two_bytes() -> None:
    # 4 nodes at 19.2 kbit/s: 13 + 4 and 5 + 4 bytes of 11 bits, and 38.5 bits behind each.
    profile = modbus(payload__read_bytes=3, payload__write_bytes=3, bus__nodes=4, node__execution__base_us=0.0)
    assert required_us(profile) == pytest.approx(4 * (26 * 11 + 2 * 38.5) / 0.0192)


def uncertainty_us(profile: Profile) -> float:
    (result,) = busplan.capacity(profile, timing_model=["standard"]).results
    return float(result.uncertainty_us or 0)


@pytest.mark.parametrize("protocol", ["modbus-rtu", "dynamixel-2", "feetech", "profibus-dp"])
def test_uarts_at_the_end_of_their_tolerance_stay_within_u(protocol: str) -> None:
    def simulated(rate: float) -> float:
        if protocol == "profibus-dp":
            return required_us(profile) * 500 / rate  # all its times are bits
        if protocol == "modbus-rtu":
            return modbus_us(rate, 3, read=10, write=4, node_us=50, is_exchange=True)
        kind = FEETECH if protocol == "feetech" else DYNAMIXEL
        return servos_us(kind, rate, 14, read=10, write=4, reads=1, is_sync=True, turn_us=50)

    rate, tolerance = {"modbus-rtu": (9.6, 0.01), "profibus-dp": (500.0, 0.005)}.get(protocol, (115.2, 0.005))
    changes: dict[str, Any] = {"bus__protocol": protocol, "bus__bit_rate_kbit_s": rate}
    changes |= {"node__execution__grade": "measured", "node__execution__uncertainty_us": None}
    if protocol == "modbus-rtu":
        changes |= {"bus__nodes": 3, "bus__requests": "exchange"}
    if protocol == "profibus-dp":
        changes |= {"bus__max_turn_bits": 32.0, "payload__read_bytes": 10, "payload__write_bytes": 10}
        profile = changed("profibus-drives-6", cycle__nonperiodic_us=0.0, **changes)
    else:
        profile = servo(**changes)
    u_us = uncertainty_us(profile)
    for share in (-1, 1):
        moved_us = abs(simulated(rate * (1 + share * tolerance)) - simulated(rate))
        assert moved_us <= u_us == pytest.approx(2 / 3**0.5 * moved_us, rel=0.015)
    # Exact clocks are taken, and a tolerance of the user's own.
    exact, double = (
        busplan.load_profile(profile, changes={"bus.clock_tolerance": value}) for value in (0.0, 2 * tolerance)
    )
    assert uncertainty_us(exact) < 0.1 * moved_us
    assert uncertainty_us(double) == pytest.approx(2 * u_us, rel=0.01)


def test_feedback_is_in_answers_and_commands_are_in_requests() -> None:
    # Robotis, protocol 2.0: a sync read has 14 bytes and 1 of each servo, its answers 11 and the data; a sync write has
    # 14, and 1 and the data of each servo. A byte takes 10 us at 1 Mbit/s.
    profile = servo(
        bus__bit_rate_kbit_s=1000,
        bus__nodes=3,
        bus__reads=1,
        bus__writes=1,
        payload__read_bytes=4,
        payload__write_bytes=2,
    )
    figures = busplan.capacity(profile, timing_model="standard").results[0].values()
    assert figures["cycle_request_us"] == pytest.approx(10 * (14 + 3 * 1 + 14 + 3 * (1 + 2)))
    assert figures["cycle_answer_us"] == pytest.approx(10 * 3 * (11 + 4))


@pytest.mark.parametrize("protocol", ["modbus-rtu", "dynamixel-2", "feetech"])
def test_a_longest_turn_around_counts_once(protocol: str) -> None:
    more: Any = {"bus__max_turn_bits": 100.0, "bus__clock_tolerance": 0.0, "node__execution__grade": "measured"}
    more["node__execution__uncertainty_us"] = None
    if protocol == "modbus-rtu":
        profile = modbus(**more)
        shortest_us, longest_us = (
            modbus_us(19.2, 3, read=10, write=4, node_us=50 + bits / 0.0192, is_exchange=True) for bits in (0, 100)
        )
    else:
        kind = FEETECH if protocol == "feetech" else DYNAMIXEL
        profile = servo(bus__protocol=protocol, bus__requests="single", **more)
        shortest_us, longest_us = (
            servos_us(kind, 1000, 14, read=10, write=4, reads=1, is_sync=False, turn_us=50 + bits) for bits in (0, 100)
        )
    middle_us, u_us = required_us(profile), uncertainty_us(profile)
    assert middle_us == pytest.approx((shortest_us + longest_us) / 2, rel=1e-9)
    assert u_us == pytest.approx((longest_us - shortest_us) / 2, rel=1e-4)


def test_worldfip_by_hand() -> None:
    # 8 bits a byte at 1 Mbit/s: ID_DAT 8 bytes and RP_DAT 9 and its data, a turn-around of 10 to 70 bits behind each.
    profile = servo(bus__protocol="worldfip", bus__requests="single", bus__nodes=1, bus__return_delay_us=0.0)
    read_us = (8 + 9 + 10) * 8 + (10 + 70) / 2 + 70
    write_us = (8 + 9 + 4) * 8 + 2 * 70
    assert required_us(profile) == read_us + write_us


def test_the_manual_of_profibus_has_its_own_sum() -> None:
    # 20 slaves, 80 bytes, 1.5 Mbit/s: (33 + 33 + 150) + (33 + 66 + 300) + 20 (33 + 2 * 99 + 4 * 11 + 32 + 37) bits
    profile = changed(
        "profibus-drives-6",
        bus__nodes=20,
        bus__bit_rate_kbit_s=1500.0,
        bus__global_control=False,
        payload__read_bytes=2,
        payload__write_bytes=2,
        cycle__nonperiodic_us=0.0,
    )
    assert required_us(profile, "typical") == pytest.approx(7495 / 1.5)
    assert required_us(profile, "typical") == pytest.approx(4917, rel=0.1)


@pytest.mark.parametrize(
    ("period_us", "verdict"),
    [(1153.0, "fits"), (1152.0, "not shown to fit"), (769.0, "not shown to fit"), (768.0, "does not fit")],
)
def test_between_the_ends_nothing_is_shown(period_us: float, verdict: str) -> None:
    (result,) = busplan.capacity(
        changed("profibus-drives-6", cycle__period_us=period_us), timing_model=["standard"]
    ).results
    assert result.verdict == verdict


def test_a_retry_is_a_request_and_a_timeout() -> None:
    more_us = required_us(changed("profibus-drives-6", bus__retries=2)) - required_us(changed("profibus-drives-6"))
    assert more_us == pytest.approx(2 * (33 + (9 + 10) * 11 + 1000) / 12)
    more_us = required_us(servo(bus__retries=1, bus__timeout_us=3000.0)) - required_us(servo())
    assert more_us == pytest.approx((14 + 14) * 10 + 3000)


def test_a_slave_with_a_shorter_delay_of_its_own() -> None:
    (result,) = busplan.capacity(
        changed("profibus-drives-6", bus__max_turn_bits=100.0, bus__clock_tolerance=0.0), timing_model=["standard"]
    ).results
    assert result.uncertainty_us == pytest.approx(6 * (100 - 32) / 2 / 12)


def test_groups_have_a_sync_read_each(tmp_path: Path) -> None:
    text = OWN.replace("nodes = 5\n", "").replace(
        "write_request_bytes = 6",
        "write_request_bytes = 6\nsync_read_bytes = 8\nsync_write_bytes = 8\nsync_node_bytes = 1",
    )
    head = text[: text.index("[payload]")]
    group = (
        '[[group]]\nname = "{}"\nnodes = {}\naxes = 1\nread_bytes = {}\nwrite_bytes = 4\n'
        'execution = {{kind = "linear", grade = "measured", base_us = 100, per_byte_us = 0}}\n'
    )
    path = tmp_path / "groups.toml"
    path.write_text(head + group.format("arm", 3, 4) + group.format("hand", 2, 8), encoding="utf-8")
    arm = (8 + 3) * 20 + 3 * (100 + (5 + 4) * 20) + (8 + 3 * 5) * 20
    hand = (8 + 2) * 20 + 2 * (100 + (5 + 8) * 20) + (8 + 2 * 5) * 20
    assert required_us(path) == arm + hand


def test_a_protocol_of_the_users_own(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(OWN, encoding="utf-8")
    by_hand_us = 5 * (6 * 20 + 100 + (5 + 4) * 20) + 5 * (6 + 4) * 20
    assert required_us(path) == by_hand_us
    (derivation,) = busplan.explain(path, "required_us", timing_model="standard").derivations
    assert derivation.value == by_hand_us
    # Nobody answers a write: five times of nodes count, and what each may err.
    doubtful = busplan.load_profile(path, changes={"node.execution.uncertainty_us": 3.0})
    doubts = busplan.capacity(doubtful).verdicts[0].deciding.doubts
    assert [doubt.us for doubt in doubts if doubt.key == "node.execution"] == [5 * 3]


def test_a_telegram_of_a_protocol_with_words_holds_whole_ones(tmp_path: Path) -> None:
    path = tmp_path / "words.toml"
    text = OWN.replace("bits_per_byte = 10\n", "bits_per_byte = 10\nword_bytes = 3\nmax_bytes = 5\n")
    path.write_text(text, encoding="utf-8")
    (result,) = busplan.capacity(path, timing_model=["standard"]).results
    assert result.required_us == 5 * (6 * 20 + 100 + (5 + 6) * 20) + 5 * (6 + 6) * 20
    assert result.exceeded == ("payload",)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "read_request_bytes = 6\n",
            "read_requst_bytes = 6\n",
            "bus.protocol.read_requst_bytes: unknown key; did you mean read_request_bytes?",
        ),
        ("bits_per_byte = 10", "bits_per_byte = 100", "bus.protocol.bits_per_byte = 100: must be 12 or less"),
        ("read_request_bytes = 6\n", "", "has no request that reads a node"),
    ],
)
def test_a_wrong_protocol_says_where(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(OWN.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(BusplanError) as refused:
        busplan.load_profile(path)
    assert words in str(refused.value)
    assert "(a " not in str(refused.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"bus.protocol": "profinet"},
            'expected "profibus-dp", "modbus-rtu", "dynamixel-2", "feetech", "worldfip" or "mesa-hm2-eth"',
        ),
        ({"bus.requests": "exchange"}, "it has sync, fast-sync, single"),
        ({"bus.retries": 1}, "give bus.timeout_us"),
        ({"bus.global_control": True}, "no broadcast that opens a cycle"),
    ],
)
def test_what_a_protocol_cannot_do_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(BusplanError, match=words):
        busplan.load_profile("dynamixel-arm-14", changes=changes)


@pytest.mark.parametrize(
    ("changes", "limit"),
    [
        ({"bus.nodes": 254}, "nodes"),
        ({"bus.bit_rate_kbit_s": 5000.0}, "range"),
        ({"bus.protocol": "feetech", "payload.read_bytes": 250}, "payload"),
    ],
)
def test_limits_of_a_protocol(changes: dict[str, Any], limit: str) -> None:
    profile = busplan.load_profile("dynamixel-arm-14", changes={**changes, "cycle.period_us": 1e6})
    (result,) = busplan.capacity(profile, timing_model=["standard"]).results
    assert result.exceeded == (limit,)


def test_a_plan_asks_all_at_once_and_sets_the_return_delay(tmp_path: Path) -> None:
    text = Path("profiles/dynamixel-arm-14.toml").read_text(encoding="utf-8")
    path = tmp_path / "slow.toml"
    text = (
        text.replace('requests = "sync"', 'requests = "single"')
        .replace("dynamixel-2", "feetech")
        .replace("return_delay_us = 0 ", "return_delay_us = 500 ")
    )
    path.write_text(text.replace("period_us = 10000", "period_us = 8000"), encoding="utf-8")
    plan = busplan.plan(path, free=["return_delay", "requests"])
    assert plan.recommended is not None
    assert dict(plan.recommended.changes) == {"bus.requests": "sync", "bus.return_delay_us": 0.0}


def test_a_command_of_an_exchange_rests_on_the_cycle_before() -> None:
    drives_of = PolledCycle(network_of(changed("profibus-drives-6")), "standard")
    arm = PolledCycle(network_of(servo()), "standard")
    assert [drives_of.loop_periods(at_sync=sync) for sync in (False, True)] == [1, 2]
    assert [arm.loop_periods(at_sync=sync) for sync in (False, True)] == [0, 1]
    # Node 1 has its command with the request; all servos have theirs with the sync write at the end.
    assert drives_of.arrival_us(1) == pytest.approx(163.75 + 976 / 12 + (33 + 209) / 12)
    assert arm.arrival_us(1) == arm.arrival_us(14) == pytest.approx(14 * 50 + 4060)


@pytest.mark.parametrize(
    ("word", "protocol"),
    [
        ("profibus", "profibus-dp"),
        ("PROFIBUS DP", "profibus-dp"),
        ("modbus", "modbus-rtu"),
        ("Dynamixel 2", "dynamixel-2"),
        ("feetech", "feetech"),
        ("worldfip", "worldfip"),
        ("mesa", "mesa-hm2-eth"),
        ("polled", "profibus-dp"),
    ],
)
def test_a_new_profile_is_of_the_bus_that_is_asked_for(word: str, protocol: str, tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    done = CliRunner().invoke(app, ["init", str(path), "--bus", word, "--nodes", "6", "--axes", "6"])
    assert done.exit_code == 0, done.output
    assert value_at(busplan.load_profile(path), "bus.protocol") == protocol


def test_a_thread_of_linuxcnc_by_hand() -> None:
    """Frames with preamble, header and FCS at 0.08 us a byte, a gap of 12 bytes behind each, and the answer's turn."""
    request, answer, write = (8 + max(length, 60) + 4 for length in (48, 62, 84))
    answered_us = (request + 12 + answer) * 0.08 + 47.4
    assert answered_us == pytest.approx(60, abs=0.1)
    assert required_us(busplan.load_profile("mesa-hm2-eth")) == pytest.approx(answered_us + (12 + write + 12) * 0.08)


def test_a_sweep_is_its_points() -> None:
    answer = busplan.sweep(
        "profibus-drives-6",
        vary={"bus.bit_rate_kbit_s": [187.5, 1500.0, 12000.0], "bus.retries": [0, 2]},
        timing_model=["standard"],
    )
    columns = (answer[name] for name in ("bus.bit_rate_kbit_s", "bus.retries", "required_us"))
    for rate, retries, us in zip(*columns, strict=True):
        profile = changed("profibus-drives-6", bus__bit_rate_kbit_s=float(rate), bus__retries=int(retries))
        assert us == pytest.approx(required_us(profile), rel=1e-12)


def test_each_protocol_names_what_tests_it_and_no_other() -> None:
    said = {}
    for name in ("profibus-drives-6", "dynamixel-arm-14"):
        (verdict,) = busplan.capacity(name).to_dict()["verdicts"]
        said[name] = next(line["text"] for line in verdict["lines"] if line["label"] == "checked against")
    assert said["profibus-drives-6"] == "no published figures"
    assert said["dynamixel-arm-14"].startswith("rates of 14 servos")
    (on_profibus,) = (
        row["tested"]
        for row in busplan.compare("gantry-24", buses=["polled"]).to_dict()["buses"]
        if row["kind"] == "polled"
    )
    assert on_profibus == []


INVENTED = """
[INVENTED]
name = "invented-3"
called = ["Invented 3", "Invented"]
rates = { kbit_s = [250, 500], grade = "assumed", source = "chosen" }
grade = "assumed"
source = "chosen"
unit = "bytes"
meaning = "a telegram"
start = "bit_rate_kbit_s = 250   # assumed"
BITS_PER_BYTE = { value = 10 }
READ_REQUEST_BYTES = { value = 6 }
READ_ANSWER_BYTES = { value = 5 }
WRITE_REQUEST_BYTES = { value = 6 }
"""


@pytest.mark.slow
def test_a_table_is_a_protocol(tmp_path: Path) -> None:
    shutil.copytree(
        Path(busplan.__file__).parent, tmp_path / "busplan", ignore=shutil.ignore_patterns("*.pyc.*", "*.html")
    )
    with (tmp_path / "busplan/buses/polled/constants.toml").open("a", encoding="utf-8") as file:
        file.write(INVENTED)

    def run(*words: str) -> str:
        command = [sys.executable, "-m", "busplan", *words]
        environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("init", "machine.toml", "--bus", "Invented 3", "--nodes", "6", "--axes", "6")
    assert 'protocol = "invented-3"' in (tmp_path / "machine.toml").read_text(encoding="utf-8")
    assert "machine  Invented 3, 6 nodes" in run("capacity", "machine.toml", "--set", "cycle.period_us=100000")


def test_usual_bit_rates_have_a_grade_and_a_source_and_are_ones_of_the_protocol() -> None:
    constants = kind_named("polled").constants
    for table, words in constants.beside.items():
        rates = words["rates"]
        assert rates["grade"] in get_args(Grade)
        assert rates["source"]
        assert max(rates["kbit_s"]) <= constants.by_key(table).get("MAX_BIT_RATE_KBIT_S", 1e9), table


def test_a_length_field_of_16_bits_bounds_the_data_of_a_servo() -> None:
    # The field counts instruction, error and CRC, too: 4 bytes.
    limits = [
        busplan.capacity(busplan.load_profile("dynamixel-arm-14", changes={"payload.read_bytes": size})).verdicts[0]
        for size in (65_531, 65_532)
    ]
    said = [str(verdict.card.lines) for verdict in limits]
    assert ["over 65531" in words for words in said] == [False, True]
