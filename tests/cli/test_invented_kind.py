"""A small invented kind of bus, defined here alone, is asked every question in every form.

What it shows: a kind is its own section, terms, events, limits, settings, rules and figures, and no room outside
`buses` knows it.
"""

import csv
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from io import StringIO
from math import hypot
from pathlib import Path
from typing import Any, ClassVar, Literal

import pytest
from jsonschema import Draft202012Validator
from pydantic import Field

import busplan
from busplan.buses import kind_names, registered
from busplan.buses.bus import Bus
from busplan.buses.cycle import BusCycle, BusEvent, Doubt, Premise
from busplan.buses.cycle import Run as EventRun
from busplan.buses.figure import NONPERIODIC, BusFigures, Figure, OwnFigures
from busplan.buses.limits import ExactLimit
from busplan.buses.network import Network
from busplan.buses.parts import Cost, EventKind, PayloadRange, Perturbation, Setting, Starter, TimingModel
from busplan.buses.rule import Rule, RuleProblem, RuleSubject
from busplan.elementwise import Number, rounded_up
from busplan.sections.base import Section
from busplan.sections.cycle import BusSection
from busplan.sections.machine import DeliverySection
from busplan.sections.profile import Profile

Run = Callable[..., Any]
KINDS = [f'"{one}"' for one in kind_names()]

RATES = (1.0, 2.0, 4.0)
MOST_STATIONS = 40
SHARED = 3
"""Stations that one token serves: the token's share of the cycle grows by steps."""


class RingSection(BusSection):
    """Section [bus] of the invented kind."""

    kind: Literal["ring"] = Field(description="Kind of bus", examples=["ring"])
    nodes: int = Field(ge=1, description="Stations", examples=[5])
    rate_mbit_s: float = Field(default=1.0, gt=0, description="Data rate [Mbit/s]", examples=[1])
    token_us: float = Field(default=5.0, ge=0, description="One round of the token [us]", examples=[5])
    timing_model: Literal["plain"] = Field(default="plain", description="Timing model", examples=["plain"])


class GuardSection(Section):
    """Section [guard], which no other kind has."""

    guard_us: float = Field(default=0.0, ge=0, description="Silence before each token [us]", examples=[1])


class RingDelivery(DeliverySection):
    """Section [delivery], with a key that the cycle depends on."""

    late_us: float = Field(default=0.0, ge=0, description="Silence after each token [us]", examples=[1])


class RingProfile(Profile):
    """A profile of the invented kind."""

    bus: RingSection = Field(description="The bus")
    delivery: RingDelivery = Field(default_factory=RingDelivery, description="How set-points arrive")
    guard: GuardSection = Field(default_factory=GuardSection, description="Silence on the ring")


DATA = Figure("cycle_data_us", "data", "ring", "all data of a cycle", "data", ink="request", letter="D")
TOKEN = Figure("cycle_token_us", "token", "ring", "all rounds of the token", "token", ink="contention", letter="T")
ROUNDS = Figure("rounds", "n_r", "ring", "rounds of the token", "rounds of the token", "rounds", "count")

TERMS = (DATA, TOKEN, NONPERIODIC)


@dataclass(frozen=True)
class RingFigures(OwnFigures):
    """Figures of the invented kind."""

    rounds: int
    cycle_data_us: float
    cycle_token_us: float
    nonperiodic_us: float


class RingCycle(BusCycle):
    """Data of every station, and a round of the token for every few of them."""

    term_figures = TERMS
    record = RingFigures

    def __init__(self, network: Network, model: str) -> None:
        self.network, self.model = network, model

    @cached_property
    def rounds(self) -> Number:
        return rounded_up(self.network.nodes / SHARED)

    @cached_property
    def round_us(self) -> Number:
        profile = self.network.profile
        round_us: Number = profile.bus.token_us + profile.guard.guard_us + profile.delivery.late_us
        return round_us

    def written(self) -> Iterator[BusEvent | EventRun]:
        rate_mbit_s, (group,) = self.network.profile.bus.rate_mbit_s, self.network.groups
        yield EventRun((BusEvent("token", "cycle_token_us", self.round_us, "token"),), self.rounds)
        sent = (
            BusEvent(kind, "cycle_data_us", 8 * size / rate_mbit_s, f"data {kind}", transaction="turn")
            for kind, size in (("in", group.read_bytes), ("out", group.write_bytes))
        )
        yield EventRun(tuple(sent), group.nodes, 0)
        yield BusEvent("nonperiodic", "nonperiodic_us", self.network.nonperiodic_us, "window")

    def figures(self) -> Mapping[str, Number]:
        return {"rounds": self.rounds}


def slow(subject: RuleSubject) -> Iterator[RuleProblem]:
    rate = getattr(subject.profile.bus, "rate_mbit_s")  # noqa: B009 - a key of this kind alone
    if rate < RATES[0]:
        yield RuleProblem("bus.rate_mbit_s", f"{rate:g} Mbit/s is slower than any station")


class Ring(Bus):
    """The invented kind."""

    kind = "ring"
    title = "Token ring"
    timing_models: ClassVar[tuple[TimingModel, ...]] = (TimingModel("plain", "as it is"),)
    deciding_model = "plain"
    figures = BusFigures(TERMS, added=(ROUNDS,), table=(ROUNDS,))
    limits = (
        ExactLimit(
            "nodes",
            "{value:.0f} stations are over the {most:.0f} of a ring",
            lambda network: network.nodes,
            lambda _network: MOST_STATIONS,
            way_out="a second ring has room",
        ),
    )
    starter = Starter('[bus]\nkind = "ring"\nrate_mbit_s = 4.0')
    rules = (Rule("RG101", "slow-ring", "error", "the ring is slower than its stations", "Take a faster one.", slow),)
    event_kinds = (
        EventKind("token", "token", "ring", "T", "contention"),
        EventKind("in", "data in", "ring", "<", "response"),
        EventKind("out", "data out", "ring", ">", "request"),
        EventKind("nonperiodic", "window", "profile", "N", "reserve"),
    )
    stretch_kinds = (EventKind("turn", "turns", "", "#", "in"),)

    def profile_model(self) -> type[Profile]:
        return RingProfile

    def cycle(self, network: Network, *, model: str) -> RingCycle:
        return RingCycle(network, model)

    def settings(self, network: Network) -> tuple[Setting, ...]:
        faster = tuple(rate for rate in RATES if rate > network.profile.bus.rate_mbit_s)
        values = tuple({"bus.rate_mbit_s": rate} for rate in faster)
        return (Setting("rate", "rate", Cost.REGISTER, ("bus.rate_mbit_s",), values),)

    def perturbations(self, network: Network) -> tuple[Perturbation, ...]:
        return (Perturbation("half the rate", {"bus.rate_mbit_s": network.profile.bus.rate_mbit_s / 2}),)

    def payloads(self, network: Network) -> PayloadRange:  # noqa: ARG002 - the same for any ring
        return PayloadRange(1, 64)


TEXT = """\
schema_version = 1
name = "ring"

[bus]
kind = "ring"
nodes = 5

[cycle]
period_us = 1500
slice_ratio = 0.5

[payload]
read_bytes = 8
write_bytes = 8

[node]
axes = 2

[node.execution]
kind = "linear"
base_us = 0
per_byte_us = 0

[servo]
position_gain_per_s = 100

[circle]
radius_mm = 20
feed_mm_per_min = 2000
"""
NEEDED_US = 5 * 8 * 16 + 2 * 5.0
"""Required time of that profile, by hand: five stations of 16 bytes at 1 Mbit/s, and two rounds of the token."""


@pytest.fixture
def ring_file(tmp_path: Path) -> Path:
    """A profile of the invented kind, in a folder of its own."""
    path = tmp_path / "ring.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


@pytest.fixture
def ring(ring_file: Path) -> Iterator[Path]:
    """That profile, while the kind is registered."""
    with registered(Ring()):
        yield ring_file


QUESTIONS = {
    "capacity": ("table", "markdown", "html", "csv", "json"),
    "latency": ("table", "csv"),
    "plan": ("table", "json"),
    "timeline": ("table", "svg", "csv"),
    "map": ("table", "svg", "json"),
    "circle-test": ("table", "json"),
    "report --circle": ("html", "markdown"),
    "check": ("full", "json", "markdown"),
    "compare --buses ring,can": ("table", "svg", "csv"),
    "explain": ("table",),
    "explain rounds": ("table", "json"),
    "explain min_period_us": ("markdown", "csv"),
    "sweep --vary bus.nodes=1:45:4": ("table", "json"),
    "diff paper-1ms": ("table", "json"),
}


@pytest.mark.slow
@pytest.mark.parametrize("has_doubts", [False, True], ids=["sure", "doubted"])
@pytest.mark.parametrize("question", QUESTIONS)
def test_every_question_is_answered(run: Run, ring_file: Path, question: str, has_doubts: bool) -> None:
    command, *options = question.split()
    speaks_of_another = command in {"compare", "diff"}
    with registered(DoubtedRing() if has_doubts else Ring()):
        for form in QUESTIONS[question]:
            done = run(command, "ring.toml", *options, "--format", form, cwd=ring_file.parent)
            assert done.returncode == 0, done
            assert speaks_of_another or not [one for one in ("1394", "gap count", "bus reset") if one in done.stdout]
            if form == "json":
                assert json.loads(done.stdout)["schema"] == 1
            if form == "csv":
                assert [*csv.DictReader(StringIO(done.stdout))]


@pytest.mark.parametrize("name", ["can-servo-8", "gantry-24"])
def test_a_machine_is_compared_on_it(run: Run, ring: Path, name: str) -> None:
    done = run("compare", name, "--buses", "ring,can", "--format", "json", cwd=ring.parent)
    on_ring, on_can = json.loads(done.stdout)["buses"]
    assert (on_ring["kind"], on_can["kind"], on_ring["is_own"]) == ("ring", "can", False)
    # Its nodes cannot be in groups.
    assert [one.partition(":")[0] for one in on_ring["why_not"]] == ["bus.nodes"] * (name == "gantry-24")
    if name == "can-servo-8":
        assumed = {one["key"]: one["value"] for one in on_ring["assumed"] if one["source"] == "new profile"}
        assert assumed == {"bus.rate_mbit_s": 4.0}
        assert "message" in on_ring["left_out"]


def test_its_equations_are_explained(run: Run, ring: Path) -> None:
    said = run("explain", ring.name, "required_us", cwd=ring.parent).stdout
    assert "n_r = ceil(N / 3)" in said
    assert "token = n_r (token_us + guard_us + late_us)" in said
    assert "T_need = data + token + T_npd" in said
    done = run("explain", ring.name, "latency.payload_bytes", cwd=ring.parent)
    assert (done.returncode, "payload_bytes" in done.stderr) == (2, True)


def changed(profile: Path, **values: object) -> Profile:
    """The profile with other values; a key has __ where TOML has a dot."""
    return busplan.load_profile(profile, changes={key.replace("__", "."): value for key, value in values.items()})


def test_its_figures_are_those_by_hand(ring: Path) -> None:
    (one,) = busplan.capacity(ring).results
    assert (one.required_us, RingFigures.of(one).rounds, RingFigures.of(one).cycle_token_us) == (NEEDED_US, 2, 10)
    assert (one.kind, one.timing_model, one.fits) == ("ring", "plain", True)
    assert {term.key: term.us for term in one.terms} == {
        "cycle_data_us": 640,
        "cycle_token_us": 10,
        "nonperiodic_us": 0,
    }
    sums: dict[str, float] = {}
    for event in busplan.timeline(ring).cycle_events:
        sums[event.term] = sums.get(event.term, 0.0) + event.duration_us
    assert {key: us for key, us in sums.items() if key} == pytest.approx({"cycle_data_us": 640, "cycle_token_us": 10})


def test_what_moves_its_margin_is_by_hand(run: Run, ring: Path) -> None:
    done = run("capacity", ring.name, "--sensitivity", "--format", "json", cwd=ring.parent)
    (verdict,) = json.loads(done.stdout)["verdicts"]
    assert [(one["change"], one["margin_change_us"], one["note"]) for one in verdict["sensitivity"]] == [
        ("half the rate", -640.0, None),
        ("payload +4 bytes", -320.0, None),
        ("one more node", -128.0, None),  # the second token serves it, too
        ("execution time +10%", 0.0, None),
        ("one more axis per node", 0.0, "no payload follows the axes"),
    ]
    following = verdict["next_bottleneck"]
    assert (following["binding_term"], following["next_binding_term"]) == ("data", "token")
    # 750 us carry five stations; without that limit a ring has forty.
    assert (following["safe_limited_by"], following["safe_nodes"]) == ("time", 5)
    assert (following["next_safe_limited_by"], following["next_safe_nodes"]) == ("nodes", 40)


@pytest.mark.parametrize("period_us", [100, 266, 276, 277, 1500, 5000, 10_000, 12_000, 1e6])
def test_the_most_stations_are_those_that_a_count_finds(ring: Path, period_us: float) -> None:
    fitting = [nodes for nodes in range(1, MOST_STATIONS + 1) if 128 * nodes + 5 * -(-nodes // SHARED) <= period_us / 2]
    (one,) = busplan.capacity(changed(ring, cycle__period_us=period_us)).results
    assert one.max_nodes == len(fitting)
    assert one.limited_by == ("nodes" if one.max_nodes == MOST_STATIONS else "time")


def test_keys_of_a_section_of_its_own_and_of_a_shared_one_are_the_cycles(run: Run, ring: Path) -> None:
    for key in ("guard.guard_us", "delivery.late_us"):
        done = run("sweep", ring.name, "--vary", f"{key}=0,7", "--format", "csv", cwd=ring.parent)
        rows = list(csv.DictReader(StringIO(done.stdout)))
        assert [float(row["required_us"]) for row in rows] == [NEEDED_US, NEEDED_US + 2 * 7]
        assert key in run("explain", ring.name, "cycle_token_us", cwd=ring.parent).stdout


def test_a_plan_turns_its_setting_and_advice_names_it(run: Run, ring: Path) -> None:
    answer = busplan.plan(ring, nodes=10)
    assert [one.name for one in answer.free] == ["rate", "slice_ratio", "period"]
    assert answer.recommended_changes == {"bus.nodes": 10, "bus.rate_mbit_s": 2.0}
    ring.write_text(TEXT.replace("period_us = 1500", "period_us = 800"), encoding="utf-8")
    (verdict,) = busplan.capacity(ring).verdicts
    assert verdict.change is not None
    assert verdict.change.changes == {"bus.rate_mbit_s": 2.0}
    done = run("check", ring.name, "--no-circle", cwd=ring.parent)
    assert "cheapest cure: bus.rate_mbit_s = 2\n" in done.stdout


def test_its_rule_and_its_limit_are_found_and_listed(run: Run, ring: Path) -> None:
    slower = TEXT.replace("nodes = 5", "nodes = 41\nrate_mbit_s = 0.5").replace("period_us = 1500", "period_us = 1e6")
    ring.write_text(slower, encoding="utf-8")
    done = run("check", ring.name, "--no-circle", cwd=ring.parent)
    assert done.returncode == 1
    assert "ring.toml:7:1: RG101 error: bus.rate_mbit_s: 0.5 Mbit/s is slower than any station" in done.stdout
    # A limit without a rule fails the gate, too.
    assert "BP101 error: cycle.period_us: 41 stations are over the 40 of a ring; a second ring has room" in done.stdout
    assert "41 stations are over the 40 of a ring" in run("capacity", ring.name, cwd=ring.parent).stdout
    assert "RG101" in run("rule", cwd=ring.parent).stdout


# --- how sure its verdict is ------------------------------------------------------------------------------


def test_its_verdict_says_that_no_residual_is_known(run: Run, ring: Path) -> None:
    (one,) = busplan.capacity(ring).results
    # Nothing is known of how far the bus is from the model, which is no certainty.
    assert (one.verdict, one.bias_us, one.uncertainty_us) == ("fits", None, None)
    # Without a bias and without doubts, what is needed is all that there is to show.
    assert (one.safe_required_us, one.margin_corrected_us) == (NEEDED_US, one.margin_us)
    assert (one.safe_nodes, one.safe_limited_by, one.safe_min_period_us) == (one.max_nodes, "time", one.min_period_us)
    said = run("capacity", ring.name, cwd=ring.parent).stdout
    assert "\n  free            100 us\n" in said
    assert "\n  doubt           not known\n" in said
    ring.write_text(TEXT.replace("period_us = 1500", "period_us = 1200"), encoding="utf-8")
    assert "no bias or uncertainty known; cheapest cure" in run("check", ring.name, cwd=ring.parent).stdout
    rows = list(csv.DictReader(StringIO(run("capacity", ring.name, "--format", "csv", cwd=ring.parent).stdout)))
    assert (rows[0]["bias_us"], rows[0]["verdict"]) == ("", "does not fit")


class DoubtedCycle(RingCycle):
    """The rate is known to 1 %, a round of the token to 0.5 us; nobody has measured how far the bus is from it."""

    def doubts(self) -> tuple[Doubt, ...]:
        data, *_ = self.terms
        return (Doubt("bus.rate_mbit_s", "rate", 0.01 * data.us), Doubt("bus.token_us", "token", 0.5 * self.rounds))

    premises = (Premise("guard.guard_us", "no guard time", 10.0),)


class DoubtedRing(Ring):
    """The invented kind, whose cycle is known to rest on what is not."""

    def cycle(self, network: Network, *, model: str) -> RingCycle:
        return DoubtedCycle(network, model)


DOUBT_US = 2 * hypot(6.4, 1.0)
"""U of that profile, by hand: 1 % of 640 us of data and two rounds of 0.5 us each."""


@pytest.fixture
def doubted(ring_file: Path) -> Iterator[Path]:
    """The profile, while the kind with doubts is registered."""
    with registered(DoubtedRing()):
        yield ring_file


@pytest.mark.parametrize(
    ("slice_us", "verdict", "code"),
    [
        (NEEDED_US - DOUBT_US - 0.001, "does not fit", 1),
        (NEEDED_US - DOUBT_US + 0.001, "not shown to fit", 1),
        (NEEDED_US, "not shown to fit", 1),
        (NEEDED_US + DOUBT_US - 0.001, "not shown to fit", 1),
        (NEEDED_US + DOUBT_US + 0.001, "fits", 0),
    ],
)
def test_doubts_without_a_bias_make_three_verdicts(
    run: Run, doubted: Path, slice_us: float, verdict: str, code: int
) -> None:
    doubted.write_text(TEXT.replace("period_us = 1500", f"period_us = {2 * slice_us}"), encoding="utf-8")
    (one,) = busplan.capacity(doubted).results
    assert (one.verdict, one.bias_us) == (verdict, None)
    assert one.uncertainty_us == pytest.approx(DOUBT_US)
    assert one.fits == (slice_us >= NEEDED_US)
    said = run("capacity", doubted.name, "--all", cwd=doubted.parent).stdout
    assert said.splitlines()[0].endswith(f" {verdict.upper()}")
    assert "us, +/- 13\n" in said
    assert "\n  largest doubt   rate, +/- 13 us\n" in said  # 2 * 6.4
    assert "\n  correction      none: the error of this timing model is not known\n" in said
    assert "\n  rests on        no guard time, no slower execution, no other traffic\n" in said
    done = run("check", doubted.name, "--no-circle", cwd=doubted.parent)
    assert done.returncode == code
    codes = {"not shown to fit": {"BP114"}, "does not fit": {"BP101"}, "fits": set()}
    assert {one for one in ("BP101", "BP114") if one in done.stdout} == codes[verdict]


@pytest.mark.parametrize("period_us", [300, 1325.9, 1326, 5000, 12_000])
def test_its_safe_stations_are_those_that_a_count_finds(doubted: Path, period_us: float) -> None:
    def safe_us(nodes: int) -> float:
        rounds = -(-nodes // SHARED)
        return 128 * nodes + 5 * rounds + 2 * hypot(1.28 * nodes, 0.5 * rounds)

    most = sum(safe_us(nodes) <= period_us / 2 for nodes in range(1, MOST_STATIONS + 1))
    (one,) = busplan.capacity(changed(doubted, cycle__period_us=period_us)).results
    assert (one.safe_nodes, one.safe_axes) == (most, 2 * most)


# --- its profile ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            '"ring"\nnodes',
            '"rung"\nnodes',
            f'ring.toml:5:1: bus.kind = "rung": expected {", ".join(KINDS)} or "ring"; did you mean "ring"?',
        ),
        (
            "nodes = 5",
            "nodes = 5\ngap_count = 5",
            'ring.toml:7:1: bus.gap_count: unknown key on this bus; it is a key where bus.kind is "ieee1394"',
        ),
        (
            "nodes = 5",
            "nodes = 5\nflags = 5",
            "ring.toml:7:1: bus.flags: unknown key; known here: kind, nodes, rate_mbit_s, token_us, timing_model",
        ),
        ("nodes = 5", "nodes = 5\nrate_mbit_s = 0", "ring.toml:7:1: bus.rate_mbit_s = 0: must be greater than 0"),
        ("[servo]", "[gard]\n[servo]", "ring.toml:24:2: gard: unknown key; did you mean guard?"),
    ],
)
def test_its_wrong_keys_are_told_as_those_of_any_kind(run: Run, ring: Path, old: str, new: str, said: str) -> None:
    ring.write_text(TEXT.replace(old, new), encoding="utf-8")
    assert run("capacity", ring.name, cwd=ring.parent).stderr == f"{said}\n"


def test_a_name_is_registered_once_and_gone_afterwards(run: Run, ring_file: Path) -> None:
    with registered(Ring()), pytest.raises(ValueError, match="called ring"), registered(Ring()):
        pass
    done = run("capacity", ring_file.name, cwd=ring_file.parent)
    expected = f"{', '.join(KINDS[:-1])} or {KINDS[-1]}"
    assert (done.returncode, done.stderr) == (2, f'ring.toml:5:1: bus.kind = "ring": expected {expected}\n')


def test_one_schema_serves_all_kinds_and_names_the_key(run: Run, ring: Path) -> None:
    schema = Draft202012Validator(json.loads(run("schema", cwd=ring.parent).stdout))
    assert schema.schema["$id"].startswith("https://")
    ours = busplan.load_profile(ring).model_dump(exclude_unset=True)
    paper = busplan.load_profile("paper-1ms").model_dump(mode="json", exclude_unset=True)
    assert not list(schema.iter_errors(ours))
    assert not list(schema.iter_errors(paper))
    wrong = {**ours, "bus": {**ours["bus"], "rate_mbit_s": -1}}
    titles = {name: one["title"] for name, one in schema.schema["$defs"].items() if "title" in one}
    assert (titles["RingSection"], titles["Ieee1394Bus"], titles["Ieee1394CycleSection"]) == ("Bus", "Bus", "Cycle")
    assert ["bus", "rate_mbit_s"] in [list(one.absolute_path) for one in schema.iter_errors(wrong)]
