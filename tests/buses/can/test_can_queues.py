"""Queues that are not by priority: what is known of them, what the verdict says, and the equality with Davis 2007."""

from pathlib import Path
from typing import Any

import pytest

import busplan
from tests.buses.can.machines import figures, loaded, responses
from tests.oracles.can_simulation import Frame, SimulatedMessage, simulate


def changed(**changes: Any) -> busplan.Profile:
    """The shipped profile with some keys changed, __ for the dot."""
    return busplan.load_profile(
        "can-servo-8", changes={key.replace("__", "."): value for key, value in changes.items()}
    )


def test_queues_by_priority_have_the_responses_of_davis_2007() -> None:
    assert responses(changed(bus__queue="priority")) == responses(changed())
    assert responses(changed(node__queue="priority", bus__queue="fifo")) != responses(changed())


def network(*messages: dict[str, Any], **bus: Any) -> busplan.Profile:
    """Messages alone of 130 us each, the first goes first."""
    each = [
        {"name": f"m{place}", "identifier": place, "payload_bytes": 8, "period_us": 10_000, **keys}
        for place, keys in enumerate(messages)
    ]
    bus = {"kind": "can", "bit_rate_kbit_s": 1000, **bus}
    return loaded({"schema_version": 1, "name": "queues", "bus": bus, "message": each})


def test_a_message_waits_for_all_of_its_queue_and_all_that_those_wait_for() -> None:
    # m0 and m3 share a queue: m0 may wait for a frame that blocks, for m1, m2 and m3, and goes itself.
    found = responses(network({"sender": "a"}, {}, {}, {"sender": "a"}, {}, queue="fifo"))
    assert found["m0"] == found["m3"] == 5 * 135
    # To m1 its queue offers m0 up to 4 frames late, which is far from its next period: it is one frame all the same.
    assert found["m1"] == 3 * 135
    by_priority = responses(network({"sender": "a"}, {}, {}, {"sender": "a"}, {}))
    assert by_priority["m0"] == 2 * 135


def test_a_derivation_says_what_the_queue_does_and_who_showed_it() -> None:
    own = network({"sender": "a"}, {"sender": "b"}, {"sender": "c"}, {"sender": "a"}, {"sender": "d"}, queue="fifo")
    first, second = (
        {step["key"]: step for step in busplan.explain(own, name).to_dict()["derivations"][0]["steps"]}
        for name in ("m0", "m1")
    )
    queue = first["last_in_queue"]
    assert (queue["symbol"], queue["value"]) == ("L", 3)
    assert "the lowest priority in the queue, 0x3 of m3: m0 waits for all before it" in queue["formula"]
    assert "Davis, Kollmann, Pollex, Slomka 2011; Davis, Navet 2012" in queue["formula"]
    assert first["blocking_us"]["formula"] == "the longest frame of a lower priority than L: m4"
    assert first["interference_us"]["formula"] == (
        "frames of its queue and of higher priorities than L before m0, in its worst instance: "
        "1 m1 of 135 us, 1 m2 of 135 us, 1 m3 of 135 us"
    )
    response = first["worst_response_us"]
    assert response["formula"] == "J + B(L) + I(L) + q (C - T) + C"
    assert (response["value"], response["reference"]) == (5 * 135, "Davis 2011, 2012")
    # m1 is alone in its queue; m0 comes to it R - C late, from its own.
    assert second["last_in_queue"]["value"] == 1
    assert "1 m0 of 135 us, which its queue may hold up to 540 us" in second["interference_us"]["formula"]
    said = str(busplan.explain(own, "m0"))
    assert "Davis 2011, 2012  L = the lowest priority in the queue" in said
    assert "; Davis 2011, 2012.\n" in said
    assert "higher priorities before m0" in str(busplan.explain(network({}, {}, queue="priority"), "m0").to_dict())


def test_a_derivation_starts_with_the_inputs_of_the_messages_that_it_counts(tmp_path: Path) -> None:
    lines = ["schema_version = 1", 'name = "own"', "[bus]", 'kind = "can"', "bit_rate_kbit_s = 1000 # assumed"]
    for name, identifier, size in (("high", 1, 8), ("mid", 2, 8), ("longest", 3, 8), ("short", 4, 1)):
        keys = ("[[message]]", f'name = "{name}"', f"identifier = {identifier}", f"payload_bytes = {size}")
        lines += [*keys, "period_us = 10000 # assumed"]
    path = tmp_path / "own.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    answer = busplan.explain(path, "mid")
    periods = [f"message.{name}.period_us" for name in ("high", "mid", "longest", "short")]
    assert [name in str(answer) for name in periods] == [True, True, True, False]
    inputs = [given["name"] for given in answer.to_dict()["derivations"][0]["inputs"]]
    assert set(periods) <= set(inputs)


def test_what_was_held_up_in_a_queue_comes_twice_in_short_time() -> None:
    keys = {"k": (10, 700, "a"), "m": (50, 10_000, ""), "x": (100, 50_000, "a")}
    keys |= {f"y{number}": (60 + number, 50_000, "") for number in range(4)}
    sent = [
        {"name": name, "identifier": identifier, "period_us": period_us, **({"sender": sender} if sender else {})}
        for name, (identifier, period_us, sender) in keys.items()
    ]
    # x is behind all y, and k behind x. As x starts m comes, and behind x both k.
    queued_us = {**dict.fromkeys(keys, (0,)), "k": (1, 701), "m": (4 * 135 + 1,)}
    messages = [
        SimulatedMessage(Frame(identifier, 135), queued_us[name], queued_us[name], sender or name)
        for name, (identifier, _, sender) in keys.items()
    ]
    run = simulate(Frame(0, 1), (), messages, period_us=1, host_us=(), orders={"a": None})
    (response_us,) = run.responses_us[list(keys).index("m")]
    assert response_us == 4 * 135 - 1
    assert responses(network(*sent, queue="fifo"))["m"] == 4 * 135
    assert responses(network(*sent, queue="priority"))["m"] == 3 * 135


@pytest.mark.parametrize(("queue", "period_us"), [("priority", 866), ("fifo", 1136)])
def test_late_pdos_of_a_queue_come_as_late_as_the_cycle_ends(queue: str, period_us: int) -> None:
    """A cycle takes 730 us: SYNC of 55, two PDOs of 135, the host's message, and two frames of another that may block.

    Late PDOs come 460 us behind SYNC, or out of a queue behind the message as late as the cycle ends. They and the
    message take 405 us and a bit of 1 us, and then the next PDOs may come.
    """
    execution = {"kind": "linear", "grade": "measured", "base_us": 0, "per_byte_us": 0, "uncertainty_us": 0}
    sent = {"payload_bytes": 8, "period_us": 100_000}
    own = loaded(
        {
            "schema_version": 1,
            "name": "line",
            "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "nodes": 1, "queue": queue},
            "cycle": {"period_us": period_us},
            "payload": {"read_bytes": 8, "write_bytes": 8},
            "node": {"axes": 1, "execution": execution},
            "message": [
                {"name": "first", "identifier": 0x10, "sender": "host", **sent},
                {"name": "last", "identifier": 0x600, "sender": "other", **sent},
            ],
        }
    )
    assert figures(own).required_us == 730
    sooner = busplan.load_profile(own, changes={"cycle.period_us": period_us - 1})
    assert (responses(own)["last"], responses(sooner)["last"]) == (595, 595 + 2 * 135)


@pytest.mark.parametrize("order", ["fifo", "single-buffer"])
def test_a_deadline_missed_by_the_bound_alone_is_not_shown(order: str) -> None:
    sent = ({"sender": "a", "deadline_us": 500}, {"sender": "b"}, {"sender": "b"}, {"sender": "a"}, {"sender": "b"})
    assert figures(network(*sent, queue="priority")).verdict == "fits"
    assert figures(network(*sent, queue=order)).verdict == "not shown to fit"
    # Its own frame is later than this.
    late = ({**sent[0], "deadline_us": 100}, *sent[1:])
    assert figures(network(*late, queue=order)).verdict == "does not fit"


def test_a_cycle_too_long_by_the_queues_alone_is_not_shown() -> None:
    own = {"cycle__period_us": 3500, "limits__max_load": 0.99, "node__execution__grade": "measured"}
    # Five frames of a drive may be before its feedback, whatever their priority.
    more = {f"message__sdo-response__{key}": value for key, value in {"burst": 5, "period_us": 4000}.items()}
    assert figures(changed(**own, **more)).verdict == "fits"
    found = figures(changed(**own, **more, node__queue="fifo"))
    assert (found.verdict, found.required_us > 3500) == ("not shown to fit", True)


@pytest.mark.parametrize("order", ["fifo", "single-buffer"])
def test_without_a_sender_nothing_is_shown_where_a_queue_is_not_by_priority(order: str) -> None:
    known = network({"sender": "a"}, {"sender": "b"}, queue=order)
    assert figures(known).verdict == "fits"
    unknown = network({"sender": "a"}, {}, queue=order)
    assert figures(unknown).verdict == "not shown to fit"
    assert "m1: who sends it is not known" in str(busplan.capacity(unknown).to_dict()["verdicts"][0]["lines"])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"bus__queue": "priority"}, "priority"),
        ({"node__queue": "fifo"}, "fifo (senders host, node)"),
        # A sender that is misspelt stands there.
        (
            {"bus__queue": "single-buffer", "message__sdo-request__sender": "hots"},
            "single-buffer (senders hots, node)",
        ),
        (
            {"bus__queue": "priority", "node__queue": "single-buffer"},
            "priority and single-buffer (senders host, node)",
        ),
    ],
)
def test_the_card_says_what_is_known_of_queues(changes: dict[str, Any], words: str) -> None:
    card = busplan.capacity(changed(**changes)).to_dict()["verdicts"][0]
    assert [line["text"] for line in card["lines"] if line["label"] == "queues"] == [words]
    # An order that is given for all is no premise; one of the nodes leaves that of others.
    others = [part["words"] for part in card["rests_on"] if part["key"] == "bus.queue"]
    assert others == ([] if "bus__queue" in changes else ["priority queues"])


def test_queues_that_nobody_gives_are_what_the_card_rests_on() -> None:
    card = busplan.capacity(changed()).to_dict()["verdicts"][0]
    assert "queues" not in {line["label"] for line in card["lines"]}
    assert {"bus.queue", "node.queue"} <= {
        part["key"] for part in card["rests_on"] if part["words"] == "priority queues"
    }
