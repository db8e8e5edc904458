"""Response times of messages alone, by both forms of the same file, against a simulation and the printed equations.

The simulation of arbitration, tests/oracles/can_simulation.py, knows nothing of the model, and the equations,
tests/oracles/can_textbook.py, nothing of its short cuts.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from random import Random
from typing import Any, Final, NamedTuple
from unittest import mock

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import busplan
from tests.buses.can.machines import WORST, figures, loaded
from tests.oracles import can_textbook as textbook
from tests.oracles.can_simulation import Frame, SimulatedMessage, simulate
from tests.registers import at_least

KBIT_S: Final = 500
BIT_US: Final = 2


FORMS: Final = ("compiled", "python")


@contextmanager
def computed_by(form: str) -> Iterator[None]:
    """Compute with the compiled form, or without it."""
    if form == "compiled":
        pytest.importorskip("busplan.buses.can._response", exc_type=ImportError)
        yield
        return
    with mock.patch("busplan.buses.can.waiting._compiled", return_value=None):
        yield


def network(*messages: dict[str, Any], **bus: Any) -> busplan.Profile:
    """Messages alone, the first goes first."""
    each = [
        {"name": f"m{place}", "identifier": 16 * place, "payload_bytes": 8, **keys}
        for place, keys in enumerate(messages)
    ]
    bus = {"kind": "can", "bit_rate_kbit_s": KBIT_S, **bus}
    return loaded({"schema_version": 1, "name": "bursts", "bus": bus, "message": each})


class Sent(NamedTuple):
    """A message as it is sent, in whole microseconds."""

    frame_us: int
    period_us: int
    jitter_us: int
    burst: int

    def queued(self, identifier: int, until_us: int) -> SimulatedMessage:
        """All instances up to a time, those of before 0 as late as they may be, and then as early."""
        due = (*(-self.jitter_us,) * (self.burst - 1), *range(-self.jitter_us, until_us, self.period_us))
        return SimulatedMessage(Frame(identifier, self.frame_us), due, tuple(max(us, 0) for us in due))


def simulated_us(each: Sequence[Sent], place: int, until_us: int) -> tuple[int, ...]:
    """Responses of a message in the busy period that the longest frame of a lower priority opens [us]."""
    queued = [one.queued(number, until_us) for number, one in enumerate(each[: place + 1])]
    # It has won the arbitration before any of the others came.
    lower = [Frame(-1, one.frame_us) for one in each[place + 1 :]]
    blocking = [SimulatedMessage(max(lower, key=lambda frame: frame.us), (0,), (0,))] if lower else []
    # A frame that is queued within a bit still takes part in the arbitration.
    found = simulate(Frame(0, 1), (), [*queued, *blocking], period_us=1, host_us=(), late_us=BIT_US - 1)
    return found.responses_us[place]


def latencies(own: busplan.Profile, *, form: str = "compiled") -> list[Mapping[str, Any]]:
    """Figures of each message in the worst case."""
    with computed_by(form):
        return [one.phases for one in busplan.latency(own, timing_model=[WORST]).transactions]


def frames_us(own: busplan.Profile) -> list[float]:
    """Frame of each message [us]."""
    return [float(one["frame_us"]) for one in latencies(own)]


def responses_us(own: busplan.Profile) -> list[float | None]:
    """Worst-case response of each message [us]."""
    return [one["worst_response_us"] for one in latencies(own)]


MESSAGES: Final = st.lists(
    st.fixed_dictionaries(
        {
            "payload_bytes": st.integers(0, 8),
            "period_us": st.sampled_from([700, 1300, 2000, 2500, 6000, 20_000]),
            "jitter_us": st.sampled_from([0, 0, 300, 1900, 5000, 30_000]),
            "burst": st.sampled_from([1, 1, 2, 3, 7]),
        },
        optional={"fd": st.just(True), "brs": st.just(False)},
    ).filter(lambda one: one.get("fd", False) or "brs" not in one),
    min_size=1,
    max_size=6,
)


@pytest.mark.parametrize("form", FORMS)
@given(messages=MESSAGES)
@settings(max_examples=at_least(15, 120))
def test_a_simulation_reaches_each_response_and_never_passes_it(messages: list[dict[str, Any]], form: str) -> None:
    # Data at 1000 kbit/s: all frames are whole microseconds, with a switch of bit rate and without.
    found = latencies(network(*messages, data_bit_rate_kbit_s=1000), form=form)
    each = [
        Sent(int(one["frame_us"]), own["period_us"], own["jitter_us"], own["burst"])
        for one, own in zip(found, messages, strict=True)
        if one["worst_response_us"] is not None
    ]
    assume(len(each) == len(messages))
    load = sum(one.frame_us / one.period_us for one in each)
    at_once_us = sum(one.frame_us * (one.burst + (one.jitter_us + 20) / one.period_us + 1) for one in each)
    assume(at_once_us / (1 - load) < 2e5)
    for place, one in enumerate(found):
        us = simulated_us(each, place, int(at_once_us / (1 - load)) + 1)
        assert max(us) == pytest.approx(one["worst_response_us"], abs=1e-6)
        assert us[one["instance"]] == max(us)


@given(MESSAGES, st.randoms(use_true_random=False))
@settings(max_examples=at_least(20))
def test_no_other_start_takes_longer(messages: list[dict[str, Any]], random: Random) -> None:
    found = latencies(network(*messages, data_bit_rate_kbit_s=1000))
    sent = []
    for number, (one, own) in enumerate(zip(found, messages, strict=True)):
        # From one to the next it is a period; what was not sent is made up for later, up to a burst.
        at_us = regular_us = random.randint(0, own["period_us"])
        due = []
        for _ in range(12):
            due.append(at_us)
            regular_us = max(regular_us, at_us) + own["period_us"]
            at_us = max(at_us, regular_us - (own["burst"] - 1) * own["period_us"]) + random.choice([0, 0, 7, 3000])
        queued = [us + random.choice([0, own["jitter_us"], random.randint(0, own["jitter_us"])]) for us in due]
        # They are queued in their order.
        sent.append(SimulatedMessage(Frame(number, int(one["frame_us"])), tuple(due), tuple(sorted(queued))))
    run = simulate(Frame(0, 1), (), sent, period_us=1, host_us=(), late_us=random.choice([0, BIT_US - 1]))
    for one, us in zip(found, run.responses_us, strict=True):
        assert one["worst_response_us"] is None or max(us) <= one["worst_response_us"] + 1e-6


def random_network(random: Random, *, count: int, load: float) -> Any:
    """Messages of all sorts that together make a load, with few periods between them or many."""
    periods_us = [random.uniform(3000, 200_000) for _ in range(random.choice([2, 9, count]))]
    messages = []
    for _ in range(count):
        period_us = random.choice(periods_us)
        keys = {"payload_bytes": random.randint(0, 8), "burst": random.choice([1, 1, 1, 4]), "period_us": period_us}
        messages.append({**keys, "jitter_us": random.choice([0, 0, random.randint(0, int(2 * period_us))])})
    scale = sum(BIT_US * (55 + 10 * one["payload_bytes"]) / one["period_us"] for one in messages) / load
    return network(*({**one, "period_us": round(scale * one["period_us"], 1)} for one in messages))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", range(at_least(3)))
def test_networks_have_the_responses_of_the_printed_equations(seed: int, form: str) -> None:
    random = Random(seed)
    own = random_network(random, count=random.randint(2, 40), load=random.choice([0.3, 0.7, 0.95, 1.05]))
    found = latencies(own, form=form)
    tenths = 10
    each = [
        textbook.Sender(
            tenths * BIT_US * (55 + 10 * one.payload_bytes),
            round(tenths * one.period_us),
            round(tenths * one.jitter_us),
            one.burst,
        )
        for one in own.message
    ]
    for place, one in enumerate(found):
        blocking_us = max((lower.frame_us for lower in each[place + 1 :]), default=0)
        expected = textbook.response_us(each[place], each[:place], blocking_us=blocking_us, bit_us=tenths * BIT_US)
        if expected is None:
            assert one["worst_response_us"] is None
        else:
            assert (one["worst_response_us"], one["instance"]) == (
                pytest.approx(expected[0] / tenths),
                expected[1],
            )


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("sizes", [(8, 8), (0, 8)], ids=["alike", "unlike"])
@pytest.mark.parametrize("seed", range(at_least(3)))
def test_repeated_frames_take_what_tindell_and_burns_print(seed: int, sizes: tuple[int, int], form: str) -> None:
    random = Random(seed)
    messages = [
        {
            "payload_bytes": random.randint(*sizes),
            "period_us": random.choice([5000, 9000, 20_000, 33_000]),
            "jitter_us": random.choice([0, 0, 700]),
        }
        for _ in range(random.randint(2, 12))
    ]
    errors = textbook.Errors(random.choice([2000, 7000, 40_000]), random.choice([1, 2, 4]))
    own: Any = network(*messages, error_period_us=errors.period_us, error_burst=errors.burst)
    each = [
        textbook.Sender(BIT_US * (55 + 10 * one.payload_bytes), int(one.period_us), int(one.jitter_us))
        for one in own.message
    ]
    for place, one in enumerate(latencies(own, form=form)):
        blocking_us = max((lower.frame_us for lower in each[place + 1 :]), default=0)
        expected = textbook.response_us(
            each[place], each[:place], blocking_us=blocking_us, bit_us=BIT_US, errors=errors
        )
        assert expected is not None
        # E is of the wait and the longest frame of all, not of the frame itself: one error more, at most.
        more_us = 0 if sizes[0] == sizes[1] else (31 + 135) * BIT_US
        assert expected[0] <= one["worst_response_us"] <= expected[0] + more_us


@pytest.mark.parametrize("burst", [1, 3])
def test_a_frame_is_repeated_from_its_last_bit_on(burst: int) -> None:
    # 270 us a frame of 8 bytes, 110 of none; an error holds the bus for 31 bits, 62 us.
    short, full = {"period_us": 100_000, "payload_bytes": 0}, {"period_us": 100_000}
    own = network(short, full, short, error_period_us=50_000, error_burst=burst)
    assert responses_us(own) == [270 + 110 + burst * (62 + 110), *[us + burst * (62 + 270) for us in (490, 490)]]


def test_an_error_counts_until_the_frame_itself_has_gone() -> None:
    # A frame and its error take 602 us. An error that comes sooner hits it again.
    once, twice = (network({"period_us": 100_000}, error_period_us=us) for us in (602, 601))
    assert (responses_us(once), responses_us(twice)) == ([332 + 270], [2 * 332 + 270])


def test_an_error_in_each_frame_leaves_no_response_time() -> None:
    assert responses_us(network({"period_us": 1000}, error_period_us=332)) == [None]
    assert responses_us(network({"period_us": 10_000}, error_period_us=500)) != [None]


def test_a_burst_of_errors_asks_for_their_period() -> None:
    with pytest.raises(busplan.BusplanError, match=r"error_burst = 2: asks for error_period_us"):
        network({"period_us": 1000}, error_burst=2)


@pytest.mark.parametrize("seed", range(at_least(2)))
def test_both_forms_give_the_same_floats(seed: int) -> None:
    own = random_network(Random(seed), count=60, load=0.9)
    first, second = (latencies(own, form=form) for form in FORMS)
    assert first == second


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("data_bytes", [(), (2,), (0, 8), (1, 8, 2, 4)])
def test_a_cycle_waits_for_the_three_longest_frames_behind_it(data_bytes: tuple[int, ...], form: str) -> None:
    behind = [
        {"name": f"m{size}", "identifier": 0x7F0 + size, "payload_bytes": size, "period_us": 1e6, "deadline_us": 1e5}
        for size in data_bytes
    ]
    first = {"name": "first", "identifier": 0x90, "payload_bytes": 0, "period_us": 1e6}
    execution = {"kind": "linear", "base_us": 0, "per_byte_us": 0}
    own = loaded(
        {
            "schema_version": 1,
            "name": "cycle",
            "bus": {"kind": "can", "bit_rate_kbit_s": KBIT_S, "nodes": 1},
            "cycle": {"period_us": 5000},
            "payload": {"read_bytes": 8, "write_bytes": 8},
            "node": {"axes": 1, "execution": execution},
            "message": [first, *behind],
        }
    )
    with computed_by(form):
        found = figures(own)
    blocking_us = sum(sorted(BIT_US * (55 + 10 * size) for size in data_bytes)[-3:])
    assert {term.name: term.us for term in found.terms}["blocking"] == blocking_us
    assert found.required_us == BIT_US * (55 + 55 + 2 * 135) + blocking_us


def test_a_burst_waits_for_itself_and_others_wait_for_all_of_it() -> None:
    # 270 us a frame: five at once, and behind them a message that meets one of them and one of a lower priority.
    own = network({"period_us": 100_000, "burst": 5}, {"period_us": 10_000}, {"period_us": 50_000})
    assert frames_us(own) == [270.0] * 3
    assert responses_us(own) == [270 * 6, 270 * 7, 270 * 7]
    first = latencies(own)[0]
    assert (
        first["blocking_us"],
        first["interference_us"],
        first["instance"],
        first["backlog_us"],
    ) == (270, 0, 4, 4 * 270)
    # Its period is the mean: the load is that of a frame in each of them.
    assert figures(own).own.bus_load == pytest.approx(270 / 100_000 + 270 / 10_000 + 270 / 50_000)


def test_the_deadline_of_a_burst_counts_from_when_it_is_queued() -> None:
    burst = {"period_us": 100_000, "burst": 5}
    for deadline_us, is_kept in [(270 * 5, True), (270 * 5 - 1, False)]:
        late = figures(network({**burst, "deadline_us": deadline_us})).exceeded
        assert ("deadline" in late) is not is_kept


def test_a_load_of_one_or_more_has_no_response_time() -> None:
    own = network({"period_us": 540}, {"period_us": 540}, {"period_us": 1e6})
    assert responses_us(own) == [540, None, None]
    assert responses_us(network({"period_us": 540}, {"period_us": 545}))[1] is not None


def test_a_jitter_beyond_the_period_queues_several_at_once() -> None:
    # Three periods late: four are there at once, the first of them was due three periods before, and a fifth comes.
    own = network({"period_us": 1000, "jitter_us": 3000}, {"period_us": 100_000})
    assert responses_us(own) == [3000 + 270 + 270, 270 * 6]


@pytest.mark.parametrize(("size", "bits"), [(0, 67), (8, 147), (64, 712)])
def test_an_fd_frame_without_a_switch_has_the_bit_rate_of_the_bus_in_all_parts(size: int, bits: int) -> None:
    message = {"period_us": 100_000, "payload_bytes": size, "fd": True}
    (us,) = frames_us(network({**message, "brs": False}))
    assert us == frames_us(network(message, data_bit_rate_kbit_s=KBIT_S))[0]
    assert us == (bits + 2) * BIT_US  # two bits more where nodes are far apart
    assert frames_us(network({**message, "brs": False}, data_bit_rate_kbit_s=5000))[0] == us
    assert frames_us(network(message, data_bit_rate_kbit_s=5000))[0] < us


def test_brs_needs_no_data_bit_rate_and_is_of_fd_alone() -> None:
    message = {"period_us": 100_000, "payload_bytes": 64}
    with pytest.raises(busplan.BusplanError, match="brs = false says a frame without a switch"):
        network({**message, "fd": True})
    with pytest.raises(busplan.BusplanError, match="write fd = true"):
        network({"period_us": 100_000, "brs": False})
    own = network({**message, "fd": True, "brs": False})
    with pytest.raises(busplan.BusplanError, match=r"asks for bus\.data_bit_rate_kbit_s"):
        busplan.load_profile(own, changes={"message.m0.brs": True})


@pytest.mark.parametrize("key", ["burst", "jitter_us", "period_us"])
def test_a_sweep_has_at_each_point_what_the_point_has(key: str) -> None:
    own = network(
        {"period_us": 5000, "burst": 3, "deadline_us": 2000},
        {"period_us": 9000, "jitter_us": 10_000, "deadline_us": 20_000},
    )
    values = {"burst": [1, 2, 8], "jitter_us": [0, 400, 12_000], "period_us": [300, 5000, 90_000]}[key]
    swept = busplan.sweep(own, vary={f"message.m0.{key}": values}, timing_model=[WORST])
    for value, load, fits in zip(values, swept["bus_load"], swept["fits"], strict=True):
        alone = figures(busplan.load_profile(own, changes={f"message.m0.{key}": value}))
        assert (load, fits) == (pytest.approx(alone.own.bus_load), alone.fits)
    assert len(set(swept["fits"])) > 1


@pytest.mark.parametrize(
    "changes",
    [{}, {"bus.error_period_us": 1500, "bus.error_burst": 2}, {"bus.queue": "fifo"}],
    ids=["none", "errors", "queues"],
)
@pytest.mark.parametrize("profile", ["can-servo-8", "canopen-6", "can-fd-arm-7"])
def test_a_derivation_lists_the_frames_that_were_counted(profile: str, changes: dict[str, Any]) -> None:
    derivations = busplan.explain(busplan.load_profile(profile, changes=changes), "worst_response_us").to_dict()[
        "derivations"
    ]
    assert len(derivations) > 5
    for one in derivations:
        for step in one["steps"]:
            before, _, listed = step["formula"].partition(", in its worst instance")
            if not before.startswith(("frames of higher priorities before ", "frames of its queue and of higher")):
                continue
            frames = re.findall(r"(\d+) [\w -]+ of ([\d.]+) us", listed)
            assert sum(int(number) * float(us) for number, us in frames) == pytest.approx(step["value"])
            assert bool(frames) == bool(step["value"])


def test_a_derivation_of_a_burst_has_its_periods() -> None:
    own = network({"period_us": 100_000, "burst": 5}, {"period_us": 10_000})
    first = busplan.explain(own, "latency.worst_response_us").to_dict()["derivations"][0]
    steps = {step["key"]: (step["formula"], step["value"]) for step in first["steps"]}
    assert steps["blocking_us"] == ("the longest frame of a lower priority than m0: m1", 270)
    assert steps["burst"] == ("frames of m0 that may come at once", 5)
    assert steps["backlog_us"] == ("q C - (q - b + 1) T", 4 * 270)
    assert [one["name"] for one in first["inputs"] if one["name"].endswith("burst")] == ["message.m0.burst"]


@pytest.mark.parametrize("key", ["error_burst", "error_period_us"])
def test_a_sweep_of_errors_has_at_each_point_what_the_point_has(key: str) -> None:
    own = network({"period_us": 5000, "deadline_us": 2000}, {"period_us": 9000}, error_period_us=3000, error_burst=1)
    values = {"error_burst": [1, 3, 9], "error_period_us": [350, 3000, 90_000]}[key]
    swept = busplan.sweep(own, vary={f"bus.{key}": values}, timing_model=[WORST])
    alone = [figures(busplan.load_profile(own, changes={f"bus.{key}": value})).fits for value in values]
    assert list(swept["fits"]) == alone
    assert len(set(alone)) > 1
