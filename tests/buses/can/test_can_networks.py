"""Networks as they are: identifiers of both lengths, messages of each node, PDOs by their lengths, any rate, CAN FD."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import busplan
from tests.buses.can.machines import figures, loaded, phases, responses, terms, text_of

Run = Callable[..., Any]
BASE: dict[str, Any] = {
    "schema_version": 1,
    "name": "arm",
    "bus": {"kind": "can", "bit_rate_kbit_s": 1000, "nodes": 3},
    "cycle": {"period_us": 8000.0},
    "payload": {"read_bytes": 8, "write_bytes": 8},
    "node": {"axes": 2, "execution": {"kind": "linear", "grade": "measured", "base_us": 40.0, "per_byte_us": 1.0}},
}


def message(name: str, identifier: int, **keys: Any) -> dict[str, Any]:
    return {"name": name, "identifier": identifier, "payload_bytes": 8, "period_us": 1e5, **keys}


def profile(*messages: dict[str, Any], **sections: Any) -> busplan.Profile:
    return loaded({**BASE, "message": messages, **sections})


def wins(*names_in_order: str, own: busplan.Profile) -> bool:
    """Whether messages go in an order: one waits for all before it, whose frames are alike."""
    us = responses(own)
    each = [us[name] or 0.0 for name in names_in_order]
    return each == sorted(set(each))


def test_the_base_frame_goes_before_extended_ones_with_its_first_eleven_bits() -> None:
    own = profile(
        message("behind", 0x301),
        message("extended-last", (0x300 << 18) + 0x3FFFF, identifier_bits=29),
        message("extended", 0x300 << 18, identifier_bits=29),
        message("base", 0x300),
        message("lowest", 0x1FFFFFFF, identifier_bits=29),  # blocks each of them
    )
    # A small number of 29 bits goes before everything of 11 bits but the smallest.
    assert wins("base", "extended", "extended-last", "behind", own=own)
    first = profile(message("small", 0x90), message("extended", 0x90, identifier_bits=29))
    assert wins("extended", "small", own=first)
    assert terms(first)["interference"] == 135 + 160  # both go before the PDOs
    assert [phases(first)[name]["frame_us"] for name in ("small", "extended")] == [135, 160]


def test_identifiers_of_unlike_length_do_not_collide(run: Run, tmp_path: Path) -> None:
    own = profile(message("base", 0x90), message("extended", 0x90, identifier_bits=29))
    assert busplan.capacity(own).results[0].exceeded == ()
    same = busplan.load_profile(own, changes={"message.base.identifier_bits": 29})
    assert busplan.capacity(same).results[0].exceeded == ("identifiers",)
    (tmp_path / "arm.toml").write_text(text_of(same), encoding="utf-8")
    said = run("check", "arm.toml", cwd=tmp_path).stdout
    assert "message.extended.identifier: base and extended share the identifier 0x90" in said


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        ([message("long", 0x800)], "is over 2047, the largest of 11 bits"),
        ([message("long", 1 << 29, identifier_bits=29)], "must be 536,870,911 or less"),
        ([message("beat", 0x790, per_node=True)], "leaves no room for 127 nodes below 2047"),
    ],
)
def test_identifiers_keep_their_range(messages: list[dict[str, Any]], words: str) -> None:
    with pytest.raises(busplan.BusplanError, match=words):
        profile(*messages)


@pytest.mark.parametrize("rate", [5, 33.3, 83.333, 1000])
def test_the_bit_rate_is_any_of_a_transceiver(rate: float) -> None:
    own = profile(bus={**BASE["bus"], "bit_rate_kbit_s": rate}, cycle={"period_us": 1e6})
    assert terms(own)["feedback"] == pytest.approx(3 * 135 * 1000 / rate)


@pytest.mark.parametrize("nodes", [1, 3, pytest.param(20, marks=pytest.mark.slow)])
def test_a_message_of_each_node_is_that_many_messages(nodes: int) -> None:
    bus, period = {**BASE["bus"], "nodes": nodes}, {"period_us": 20_000.0}
    early, late = {"period_us": 9000.0, "jitter_us": 50.0}, {"payload_bytes": 1}
    together = profile(
        message("early", 0x80, **early, per_node=True),
        message("beat", 0x700, **late, per_node=True),
        bus=bus,
        cycle=period,
    )
    numbers = range(1, nodes + 1)
    alone = profile(
        *(message(f"early-{number}", 0x80 + number, **early) for number in numbers),
        *(message(f"beat-{number}", 0x700 + number, **late) for number in numbers),
        bus=bus,
        cycle=period,
    )
    one, other = figures(together), figures(alone)
    assert [term.us for term in one.terms] == pytest.approx([term.us for term in other.terms])
    assert one.own.bus_load == pytest.approx(other.own.bus_load)
    assert one.verdict == other.verdict
    found, us = responses(together), responses(alone)
    # The last of them waits longest.
    assert found["beat"] == pytest.approx(us[f"beat-{nodes}"])
    assert found["early"] == pytest.approx(us[f"early-{nodes}"])


def test_more_nodes_send_more_of_a_message_of_each_node() -> None:
    own = profile(message("sdo", 0x580, period_us=20_000.0, per_node=True))
    most = busplan.capacity(own).results[0].safe_nodes
    assert most is not None
    for nodes, is_fit in ((most, True), (most + 1, False)):
        found = busplan.capacity(busplan.load_profile(own, changes={"bus.nodes": nodes})).results[0]
        assert (found.verdict == "fits" and not found.exceeded) is is_fit


def test_pdos_have_the_lengths_that_they_are_given() -> None:
    own = profile(payload={"feedback_pdos": [6, 6], "command_pdos": [2, 8, 1]})
    assert terms(own)["feedback"] == 3 * 2 * (55 + 60)
    assert terms(own)["command"] == 3 * (75 + 135 + 65)
    last = phases(own)["command"]
    assert (last["identifier"], last["data_bytes"]) == (0x401 + 2, 1)


@pytest.mark.parametrize(("size", "frames"), [(5, [5]), (6, [6]), (7, [6, 1]), (12, [6, 6])])
def test_a_payload_fills_pdos_in_their_order(size: int, frames: list[int]) -> None:
    own = profile(payload={"feedback_pdos": [6, 6], "read_bytes": size, "write_bytes": 8})
    assert terms(own)["feedback"] == 3 * sum(55 + 10 * data for data in frames)
    assert phases(own)["feedback"]["data_bytes"] == frames[-1]


def test_a_payload_over_its_pdos_breaks_the_limit(run: Run, tmp_path: Path) -> None:
    own = profile(payload={"feedback_pdos": [6, 6], "read_bytes": 13, "write_bytes": 8})
    assert figures(own).exceeded == ("payload",)
    (tmp_path / "arm.toml").write_text(text_of(own), encoding="utf-8")
    said = run("capacity", "arm.toml", cwd=tmp_path).stdout
    assert "a PDO of 13 bytes is over the 12 bytes of feedback_pdos" in said


def test_pdos_of_each_axis_have_those_lengths_each() -> None:
    own = profile(payload={"feedback_pdos": [4, 2], "command_pdos": [4], "pdo_per": "axis"})
    assert terms(own)["feedback"] == 6 * (55 + 40) + 6 * (55 + 20)
    last = phases(own)["feedback"]
    assert (last["identifier"], last["data_bytes"]) == (0x281 + 5, 2)


def test_full_pdos_are_those_of_a_payload() -> None:
    old = profile(payload={"read_bytes": 12, "write_bytes": 8})
    new = profile(payload={"feedback_pdos": [8, 4], "command_pdos": [8]})
    assert [found.margin_us for found in busplan.capacity(old).results] == [
        found.margin_us for found in busplan.capacity(new).results
    ]
    assert responses(old) == responses(new)


def test_a_machine_on_another_bus_keeps_its_payload() -> None:
    machines = (
        profile(payload={"feedback_pdos": [6, 6], "command_pdos": [6, 2]}),
        profile(payload={"read_bytes": 12, "write_bytes": 8}),
    )
    own, same = (busplan.compare(one, buses=["ethercat", "sercos3"]).to_dict()["buses"] for one in machines)
    for one, other in zip(own, same, strict=True):
        assert one["required_us"] == other["required_us"]


def test_no_pdo_has_0_bytes_or_is_too_long() -> None:
    for lengths in ([0], [65], [1, 1, 1, 1, 1]):
        with pytest.raises(busplan.BusplanError, match="feedback_pdos"):
            profile(payload={"feedback_pdos": lengths, "write_bytes": 8})


FD: dict[str, Any] = {**BASE["bus"], "data_bit_rate_kbit_s": 5000}


def test_an_fd_bus_sends_sync_and_pdos_as_fd_frames() -> None:
    own = profile(bus=FD, payload={"read_bytes": 20, "write_bytes": 64})
    us = terms(own)
    # 32 nominal bits, and at 5 Mbit/s 35, 240 and 680 data bits.
    assert us["sync"] == pytest.approx(32 + 35 / 5)
    assert us["feedback"] == pytest.approx(3 * (32 + (5 + 160 + 4 + 21 + 7 + 1 + 42) / 5))
    assert us["command"] == pytest.approx(3 * (32 + 680 / 5))
    pdos = phases(profile(bus=FD, payload={"feedback_pdos": [12, 48], "command_pdos": [64, 64, 64, 64]}))
    last = [(pdos[name]["identifier"], pdos[name]["data_bytes"]) for name in ("SYNC", "feedback", "command")]
    assert last == [(0x80, 0), (0x281 + 2, 48), (0x501 + 2, 64)]


def test_a_message_says_whether_it_is_fd() -> None:
    own = profile(
        message("classical", 0x300),
        message("fd", 0x301, fd=True),
        message("long", 0x302, fd=True, payload_bytes=48, identifier_bits=29),
        bus=FD,
    )
    us = {name: phases(own)[name]["frame_us"] for name in ("classical", "fd", "long")}
    late = 2  # delimiter and acknowledge of two bits each
    assert us == {"classical": 135, "fd": 32 + 115 / 5 + late, "long": pytest.approx(56 + 520 / 5 + late)}
    # The first 11 bits of the long identifier are 0; the FD message blocks.
    assert responses(own)["classical"] == us["long"] + us["fd"] + 39 + late + 6 * us["fd"] + us["classical"]


def late_by_two_bits(**sections: Any) -> busplan.Profile:
    """Three nodes and a message on CAN FD: SYNC and six PDOs a cycle."""
    return profile(message("fd", 0x300, fd=True, **sections.pop("message", {})), bus=FD, **sections)


def test_two_more_bits_of_each_fd_frame_are_a_doubt_of_the_cycle() -> None:
    wide = figures(late_by_two_bits())
    (late,) = (doubt for doubt in wide.doubts if doubt.key == "fd_late_bits")
    # SYNC, the PDOs and two frames that block are 2 us longer each; U is twice the doubt.
    assert (late.us, wide.verdict) == (1 + 6 + 2, "fits")
    for verdict, us in (("fits", 0.01), ("not shown to fit", -0.01)):
        own = late_by_two_bits(cycle={"period_us": wide.safe_required_us + us}, limits={"max_load": 0.99})
        assert figures(own).verdict == verdict
    assert all(doubt.key != "fd_late_bits" for doubt in figures(profile(message("own", 0x300))).doubts)


@pytest.mark.slow
def test_load_and_deadline_are_kept_with_two_more_bits_and_broken_without() -> None:
    own = late_by_two_bits()
    load, us = figures(own).own.bus_load, responses(own)["fd"]
    longest, before_us = load + 2 * (7 / 8000 + 1 / 1e5), 2 * (7 + 1)
    for verdict, most in (
        ("fits", longest + 1e-6),
        ("not shown to fit", longest - 1e-6),
        ("does not fit", load - 1e-6),
    ):
        assert figures(late_by_two_bits(limits={"max_load": most})).verdict == verdict
    assert us is not None
    ends_us = (("fits", us), ("not shown to fit", us - 0.1), ("does not fit", us - before_us - 0.1))
    for verdict, deadline_us in ends_us:
        assert figures(late_by_two_bits(message={"deadline_us": deadline_us})).verdict == verdict


@pytest.mark.parametrize(
    ("key", "share", "code"), [("limits.max_load", 0.1, "BP121"), ("message.fd.deadline_us", 1, "BP123")]
)
def test_the_gate_reports_what_two_more_bits_leave_open(
    run: Run, tmp_path: Path, key: str, share: float, code: str
) -> None:
    own = late_by_two_bits()
    most = figures(own).own.bus_load + 1e-5 if share < 1 else (responses(own)["fd"] or 0) - 0.1
    path = tmp_path / "own.toml"
    path.write_text(text_of(busplan.load_profile(own, changes={key: most})))
    answer = run("check", "--no-circle", str(path))
    assert answer.returncode == 1
    assert code in answer.stdout


@pytest.mark.parametrize(
    ("bus", "own", "words"),
    [
        (BASE["bus"], {"fd": True}, "asks for bus.data_bit_rate_kbit_s"),
        (FD, {"payload_bytes": 9}, "is over the 8 bytes of a classical frame; fd = true allows 64"),
        (FD, {"fd": True, "payload_bytes": 65}, "must be 64 or less"),
        ({**FD, "data_bit_rate_kbit_s": 500}, {}, "is under bit_rate_kbit_s, 1000"),
        ({**FD, "data_bit_rate_kbit_s": 9000}, {}, "must be 8,000 or less"),
    ],
)
def test_fd_keeps_its_ranges(bus: dict[str, Any], own: dict[str, Any], words: str) -> None:
    with pytest.raises(busplan.BusplanError, match=words):
        profile(message("own", 0x300, **own), bus=bus)
    with pytest.raises(busplan.BusplanError, match="has a PDO over the 8 bytes of a classical frame"):
        profile(payload={"feedback_pdos": [12], "write_bytes": 8})


def test_a_payload_over_four_fd_frames_breaks_the_limit() -> None:
    for size, exceeded in ((256, False), (257, True)):
        own = profile(bus=FD, payload={"read_bytes": size, "write_bytes": 8}, cycle={"period_us": 1e6})
        assert ("payload" in figures(own).exceeded) is exceeded


def test_a_plan_raises_the_data_bit_rate_of_fd_alone() -> None:
    own = profile(bus={**FD, "data_bit_rate_kbit_s": 1000}, payload={"read_bytes": 64, "write_bytes": 64})
    tight = busplan.load_profile(own, changes={"cycle.period_us": 4000.0})
    recommended = busplan.plan(tight, free=["data_bit_rate"]).recommended
    assert recommended is not None
    assert recommended.changes == {"bus.data_bit_rate_kbit_s": 2000}
    with pytest.raises(busplan.BusplanError, match="data_bit_rate"):
        busplan.plan(profile(), free=["data_bit_rate"])
