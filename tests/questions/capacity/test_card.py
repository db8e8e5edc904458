"""The card: what a person reads first."""

import re
from collections.abc import Callable
from math import floor, log10
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_called, kind_named, variant_called
from busplan.cli.options import time_us
from busplan.forms import terminal
from busplan.forms.blocks import Card, Command, Gauge
from busplan.forms.numbers import known_text, sentence_text
from busplan.profile.document import decode, validate
from busplan.profile.sources import shipped_names
from busplan.profile.starter import Machine, machine_text, shared_out
from tests.registers import at_least

SHIPPED = ("paper-4ms", "gantry-24", "can-servo-8", "ethercat-servo-8", "sercos2-servo-8", "sercos3-servo-8")


def changed(profile: busplan.Profile, changes: dict[str, Any]) -> Any:
    return busplan.load_profile(profile, changes=changes)


def card_block(answer: busplan.CapacityAnswer) -> Card:
    return next(block for block in answer.report().blocks if isinstance(block, Card))


def card_of(answer: busplan.CapacityAnswer) -> tuple[str, dict[str, str]]:
    """The verdict and the lines of the first card."""
    card = card_block(answer)
    return card.verdict.text, {label: sentence_text(words) for label, words in card.lines}


def test_every_kind_says_how_full_how_fast_and_how_many_more() -> None:
    for name in SHIPPED:
        verdict, lines = card_of(busplan.capacity(name))
        assert verdict == "FITS"
        assert {"used", "free", "fastest period", "room for", "largest term", "never measured"} <= {*lines}
        assert not re.search("slice|squared|JCGM|alpha", " ".join(lines.values()))


def test_used_and_free_are_the_figures_of_the_verdict() -> None:
    answer = busplan.capacity("ethercat-servo-8")
    figures = answer.verdicts[0].deciding
    assert (figures.margin_corrected_us, figures.uncertainty_us, figures.safe_nodes) == pytest.approx(
        (895.144, 46.357, 75), abs=1e-3
    )
    _, lines = card_of(answer)
    assert lines["used"] == "105 us of 1000, 10 %"
    assert lines["free"] == "895 us, +/- 46; 100 must stay free"
    # 209.79 us + 124.43 us before SYNC0 at half of the period: 668.4 us, and up.
    assert lines["fastest period"] == (
        "669 us, limited by SYNC0, before which commands must arrive; 481 us with bus.sync_shift = 0.7"
    )
    assert lines["room for"] == "67 more nodes: 75 nodes, 75 axes in all"
    assert lines["assumed"] == "bus.master_us: measure it first"


def test_a_period_mends_no_limit_that_it_plays_no_part_in() -> None:
    _, lines = card_of(busplan.capacity(busplan.load_profile("dvrk", changes={"group.full.nodes": 12})))
    assert lines["limit"].startswith("the hub's block of 2116 bytes")
    assert lines["fastest period"] == "none, for no period mends the limit"
    _, lines = card_of(busplan.capacity("can-servo-8", period_us=1000))
    # 2950 us + 350 us, of which a tenth more stays free: 3667 us, and up.
    assert lines["fastest period"] == "3.67 ms"
    measured = {"cycle.period_us": 300, "node.execution.grade": "measured"}
    _, lines = card_of(busplan.capacity(busplan.load_profile("sercos3-servo-8", changes=measured)))
    assert (lines["limit"], lines["fastest period"]) == (
        "the bus allows no period of 300 us; the next are 250 and 500 us",
        "250 us",
    )


def known_us(doubt_us: float) -> float:
    """The last place of a time that a doubt leaves known: that of its first digit up to 1 us, of two from 100 us on."""
    place = floor(log10(doubt_us))
    return 10.0 ** (place - 1 if doubt_us >= 100 else max(min(0, place), -6))


US = {"us": 1.0, "ms": 1e3, "s": 1e6}


def fastest(answer: busplan.CapacityAnswer) -> tuple[float, float] | None:
    """The fastest period that the card names, and the next one that is faster, in the digits that it has [us]."""
    said = card_of(answer)[1]["fastest period"]
    matched = re.match(r"([\d.e+]+) (us|ms|s)\b", said)
    if matched is None:
        assert said.startswith(("none: ", "none; ", "none, "))
        longest_us = max(kind_named(answer.profile.bus.kind).periods.us, default=1e6)
        assert verdict(answer.profile, cycle__period_us=longest_us) != "fits"
        return None
    us, doubt_us = float(matched[1]) * US[matched[2]], answer.verdicts[0].deciding.uncertainty_us
    known = [one for one in kind_named(answer.profile.bus.kind).periods.us if one < us]
    if kind_named(answer.profile.bus.kind).periods.us:
        return us, max(known, default=0.0)
    return us, us - (known_us(doubt_us) if doubt_us else 10.0 ** -min(max(0, 2 - floor(log10(us))), 6))


def verdict(profile: busplan.Profile, **changes: float) -> str | None:
    """Verdict after changes; none where no profile has such values, or its bus would not be set safely."""
    try:
        found = busplan.capacity(changed(profile, {key.replace("__", "."): value for key, value in changes.items()}))
    except busplan.BusplanError:
        return None
    deciding = found.verdicts[0].deciding
    return deciding.verdict if deciding.safe else None


def with_tight_deadlines(profile: Any, share: float) -> Any:
    """The same traffic with the deadlines of messages at a share of their worst responses in slow cycles."""
    slow = {f"message.{message.name}.deadline_us": 1e6 for message in profile.message}
    rows = busplan.latency(changed(profile, {**slow, "cycle.period_us": 50_000}), timing_model="worst-stuffing")
    responses = {row.transaction: row.phases["worst_response_us"] for row in rows.transactions}
    keys = {message.name: f"message.{message.name}.deadline_us" for message in profile.message}
    return changed(profile, {keys[name]: us * share for name, us in responses.items() if us and name in keys})


KINDS = ("ieee1394", "can", "ethercat", "sercos2", "sercos3")


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*KINDS, "can with deadlines"])
@given(data=st.data())
def test_the_period_and_the_nodes_that_it_names_fit_and_the_next_do_not(
    kind: str, data: st.DataObject, profiles_by_kind: dict[str, st.SearchStrategy[busplan.Profile]]
) -> None:
    drawn = data.draw(profiles_by_kind[kind.partition(" ")[0]])
    profile = with_tight_deadlines(drawn, data.draw(st.sampled_from([1.0, 1.02, 1.3]))) if " " in kind else drawn
    found = fastest(busplan.capacity(profile))
    if found is None or found[0] > 1e9:
        return
    us, faster_us = found
    at_fastest = changed(profile, {"cycle.period_us": us})
    answer = busplan.capacity(at_fastest)
    assert answer.verdicts[0].deciding.verdict == "fits"
    assert faster_us < 1 or verdict(profile, cycle__period_us=faster_us) != "fits"
    words = card_of(answer)[1].get("room for", "")
    if words:
        nodes = at_fastest.bus.nodes + (
            0 if words == "no more nodes" else int(words.split(" more node")[0].replace(",", ""))
        )
        assert verdict(at_fastest, bus__nodes=nodes) in ("fits", None if nodes == at_fastest.bus.nodes else "fits")
        assert verdict(at_fastest, bus__nodes=nodes + 1) != "fits"


@pytest.mark.parametrize("groups", [1, 3, 6, 7, 60])
def test_a_few_groups_with_room_are_named_and_the_others_counted(groups: int) -> None:
    start = "schema_version = 1\nname = 'e'\nbus.kind = 'ethercat'\ncycle = {period_us = 20000, slice_ratio = 1}\n"
    execution = "execution = {kind = 'linear', grade = 'assumed', base_us = 20, per_byte_us = 0}\n"
    sizes = [
        f"[[group]]\nname = 'g{number}'\nnodes = 1\naxes = 1\nread_bytes = {number + 1}\n" for number in range(groups)
    ]
    text = start + "".join(f"{size}write_bytes = 4\n{execution}" for size in sizes)
    answer = busplan.capacity(validate(decode(text.encode(), name="machine.toml")))
    counts = [(count.safe_nodes or 0) - count.nodes for count in answer.verdicts[0].deciding.counts]
    assert min(counts) > 0
    words = card_of(answer)[1]["room for"]
    named = re.findall(r"([0-9,]+) more nodes of g(\d+)", words)
    assert [(int(more.replace(",", "")), int(place)) for more, place in named] == [
        (counts[place], place) for place in range(groups if groups < 7 else 5)
    ]
    assert words.endswith(f" or more nodes of {groups - 5} other groups") == (groups > 6)


def test_a_deadline_asks_for_a_slower_cycle_than_time_does() -> None:
    # 1.115 ms have room for the cycle; m2 has to be there within 1000 us, which PDOs every 1.386 ms leave it.
    measured = {"node.execution.grade": "measured"}
    profile = busplan.load_profile(Path(__file__).with_name("fastest-period.toml"), changes=measured)
    answer = busplan.capacity(profile)
    assert card_of(answer)[1]["fastest period"] == "1.386 ms, limited by deadline"
    # The next one of three digits.
    short = changed(profile, {"cycle.period_us": 1000})
    assert busplan.plan(short, free=["period"]).recommended_changes == {"cycle.period_us": 1390}
    assert verdict(profile, cycle__period_us=1386) == "fits"
    assert verdict(profile, cycle__period_us=1385) == "does not fit"


def test_the_cure_stands_where_there_is_something_to_cure() -> None:
    verdict, lines = card_of(busplan.capacity("ethercat-servo-8", period_us=500))
    assert verdict == "NOT SHOWN TO FIT"
    assert lines["limit"] == "the last command comes at 209.8 +/- 124.4 us, SYNC0 at 250.0 us"
    assert lines["cure"].startswith("bus.sync_shift = 0.7 (drives act, and sample, later), which leaves 395 us")
    assert "buses" not in lines
    verdict, lines = card_of(busplan.capacity("paper-4ms", period_us=500))
    assert verdict == "DOES NOT FIT"
    assert lines["short by"] == "20 us, +/- 6"
    assert lines["buses"] == "2 such buses, of 1 node or fewer"
    assert lines["paper model"] == "fits: 207 us of 250; the standard model decides"
    assert "room for" not in lines
    # Where nodes differ, nobody said which of them are to be more: no change is looked for, and none is spoken of.
    verdict, lines = card_of(busplan.capacity("gantry-24", period_us=1900))
    assert (verdict, lines["room for"]) == ("FITS", "no more nodes")
    assert "one more" not in lines
    verdict, lines = card_of(busplan.capacity(busplan.load_profile("paper-1ms", changes={"bus.gap_count": 3})))
    assert verdict == "FITS, BUT"
    assert lines["unsafe"] == "gap count"


@pytest.mark.slow
@settings(max_examples=at_least(15))
@given(
    period_us=st.sampled_from([2500, 4000, 20000]),
    jitters_us=st.lists(st.integers(0, 9000), min_size=3, max_size=3),
    deadlines_us=st.lists(st.sampled_from([812.5, 3000, 5000, 10000]), min_size=3, max_size=3),
)
def test_can_says_its_load_and_the_message_closest_to_its_deadline(
    period_us: int, jitters_us: list[int], deadlines_us: list[float]
) -> None:
    names = ("sdo-request", "sdo-response", "heartbeats")
    changes: dict[str, float] = {"cycle.period_us": period_us}
    changes |= {f"message.{name}.jitter_us": us for name, us in zip(names, jitters_us, strict=True)}
    changes |= {f"message.{name}.deadline_us": us for name, us in zip(names, deadlines_us, strict=True)}
    profile = busplan.load_profile("can-servo-8", changes=changes)
    answer = busplan.capacity(profile)
    figures: Any = answer.verdicts[0].deciding
    _, lines = card_of(answer)
    assert lines["load"] == f"{100 * figures.own.bus_load:.1f} %, 80 allowed".replace(".0 ", " ")
    phases: dict[str, Any] = {
        row.transaction: row.phases
        for row in busplan.latency(profile, timing_model="worst-stuffing").transactions
        if row.transaction in names
    }
    shares = {name: phase["worst_response_us"] / phase["deadline_us"] for name, phase in phases.items()}
    latest = lines["latest message"].split(",")[0]
    assert shares[latest] == max(shares.values())
    us, deadline_us = phases[latest]["worst_response_us"], phases[latest]["deadline_us"]
    assert lines["latest message"] == f"{latest}, {us:.1f} us of {deadline_us:.1f}".replace(".0", "")


def test_can_without_messages_has_none_that_is_late() -> None:
    _, lines = card_of(busplan.capacity(busplan.load_profile("can-servo-8").model_copy(update={"message": ()})))
    assert "load" in lines
    assert "latest message" not in lines


@settings(max_examples=at_least(8, 60))
@given(name=st.sampled_from(SHIPPED), period_us=st.sampled_from([250, 1000, 2000, 4000, 64000]))
def test_what_is_used_and_free_fills_what_the_bus_may_use(name: str, period_us: int) -> None:
    answer = busplan.capacity(name, period_us=period_us)
    figures = answer.verdicts[0].deciding
    _, lines = card_of(answer)
    used = float(lines["used"].split()[0])
    free = float(lines["free"].split()[0]) if "free" in lines else -float(lines["short by"].split()[0])
    unit = known_us(figures.uncertainty_us) if figures.uncertainty_us else figures.available_us / 100
    assert used + free == pytest.approx(figures.available_us, abs=1.01 * unit)


@given(
    used=st.floats(0, 3),
    doubt=st.floats(0, 2),
    most=st.floats(0, 1),
    reserve=st.floats(0, 1),
)
def test_the_parts_of_a_bar_fill_it(used: float, doubt: float, most: float, reserve: float) -> None:
    gauge = Gauge(used, doubt, most * (1 - reserve), most, "passes")
    parts = gauge.parts()
    assert [part.start for part in parts] == [0.0, *(part.end for part in parts[:-1])]
    assert parts[-1].end == 1.0
    assert parts[0].end == min(1.0, used)


MOST_LINES = 22
"""Lines of a card in a terminal of 80 columns, what to ask next among them."""
STARTERS = ("firewire", "can", "can-fd", "ethercat", "sercos3", "sercos2", "profibus", "dynamixel", "modbus")


@pytest.mark.slow
@pytest.mark.parametrize("columns", [80, None])
def test_capacity_is_a_card_of_few_lines_for_every_shipped_profile_and_starter(columns: int | None) -> None:
    profiles: dict[str, busplan.Profile | str] = {name: name for name in shipped_names()}
    for bus in STARTERS:
        kind, groups = kind_called(bus), shared_out(16, nodes=4)
        starter = kind_named(kind).starter
        machine = Machine(groups, time_us(starter.period, option=""), 8, starter.host or None)
        machine = machine._replace(variant=variant_called(bus))
        profiles[bus] = validate(decode(machine_text(machine, kind=kind, name=bus, file="x").encode(), name=bus))
    for name, profile in profiles.items():
        report = busplan.capacity(profile).report()
        commands = tuple(Command(f"busplan {name} --set {number}") for number in range(3))
        text = terminal.text(report._replace(next_commands=commands, whole_by="--all shows all."), width=columns)
        assert len(text.splitlines()) <= MOST_LINES, text
        assert not re.search(r"\n\n|bias|variance|as set|sync0\b|may hide|longer bits|checked against", text), text
        assert max(map(len, text.splitlines())) <= (columns or 1000)


@pytest.mark.parametrize(
    ("us", "doubt_us", "said"), [(6764.2, 424.0, "6760"), (461.4, 56.8, "461"), (73.31, 0.42, "73.3")]
)
def test_a_figure_has_no_more_digits_than_its_uncertainty_allows(us: float, doubt_us: float, said: str) -> None:
    assert known_text(us, doubt_us) == said
    assert "e" not in known_text(us * 1e9, doubt_us * 1e9)
    assert known_text(370.4, 370.4) == "370"


def test_all_adds_the_figures_in_a_terminal_and_in_a_pipe(
    on_terminal: Callable[..., tuple[int, str]], run: Callable[..., Any], tmp_path: Path
) -> None:
    code, alone = on_terminal("capacity", "gantry-24", cwd=tmp_path, env={"COLUMNS": "80", "LINES": "90"})
    assert (code, "corrected margin" in alone) == (0, False)
    assert "corrected margin" not in run("capacity", "gantry-24").stdout
    assert "\ncorrected margin" in run("capacity", "gantry-24", "--all").stdout


def test_every_form_has_the_lines_of_the_card() -> None:
    answer = busplan.capacity("paper-4ms", period_us=500)
    (verdict,) = answer.to_dict()["verdicts"]
    _, lines = card_of(answer)
    details = {label: sentence_text(words) for label, words in card_block(answer).details}
    assert {"correction", "checked against"} <= {*details}
    assert {line["label"]: line["text"] for line in verdict["lines"]} == {**lines, **details}
    assert lines["short by"] == "20 us, +/- 6"
    assert all(f"{label}: {words}" in verdict["text"] for label, words in lines.items())
    assert all(f"  {label.ljust(15)} {words}\n" in f"{answer}\n" for label, words in lines.items())
    assert '<p class="answer">DOES NOT FIT</p>' in answer.html
    assert '<rect class="used fails" x="0.000%" y="0" width="' in answer.html
    assert "| short by | 20 us, +/- 6 |" in busplan.forms.render(answer.report(), "markdown")


@pytest.mark.parametrize("name", ["paper-4ms", "dynamixel-arm-14", "ethercat-servo-8", "can-servo-8"])
def test_what_a_cycle_waits_for_adds_up_to_what_is_used(name: str) -> None:
    _, lines = card_of(busplan.capacity(name))
    used_us = float(lines["used"].split(" us of")[0].split()[-1])
    assert sum(map(float, re.findall(r"([\d.]+) us", lines["waits for"]))) == pytest.approx(used_us, rel=0.005)
