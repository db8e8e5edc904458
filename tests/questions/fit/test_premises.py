"""What a profile does not give and makes a plan worse is said: a property over the schema of every kind."""

from collections.abc import Iterable, Iterator, Mapping
from math import inf
from typing import Any, Literal, get_args, get_origin

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

import busplan
from busplan.buses import kind_named, kind_names
from busplan.errors import BusplanError
from busplan.profile.document import decode, validate
from busplan.profile.kinds import models_of
from busplan.profile.starter import Machine, machine_text, shared_out
from busplan.questions.fit.certainty import certainty, deciding_cycle
from busplan.questions.fit.network import network_of

SECTIONS = ("bus", "cycle", "node", "host")
"""What the machine is. A payload, limits and tolerances are what is asked of it: the user states them."""
MESSAGE = """
[[message]]
name = "door"
identifier = 0x100
payload_bytes = 8
period_us = 20000
"""
OF_MESSAGE = {"identifier_bits", "per_node", "fd", "brs", "burst", "deadline_us"}
"""What a message is, and when it must have arrived, the user states, too; without a burst, that it has none."""
KNOWLEDGE = ("grade", "uncertainty_us", "jitter_cycles", "residual", "measured_gap_count")
"""Ends of keys that say how well another value is known: without that value they say nothing."""


def starters() -> Iterator[Any]:
    for kind in kind_names():
        for variant in ("", *kind_named(kind).starter.variants):
            yield pytest.param(kind, variant, id=f"{kind} {variant}".strip())


def new_profile(kind: str, variant: str, more: str = "") -> busplan.Profile:
    """The profile that `init` writes, and more."""
    machine = Machine(shared_out(6, nodes=6), 10_000.0, 4, variant=variant)
    text = machine_text(machine, kind=kind, name="new", file="new.toml") + more
    return validate(decode(text.encode(), name="new"))


def not_given(section: BaseModel, prefix: str) -> Iterator[tuple[str, FieldInfo]]:
    """Keys that a section does not give, with their fields."""
    for name, field in type(section).model_fields.items():
        key, value = f"{prefix}.{name}", getattr(section, name)
        if isinstance(value, BaseModel):
            yield from not_given(value, key)
        elif name not in section.model_fields_set and not models_of(field.annotation):
            yield key, field


def candidates(field: FieldInfo, default: object) -> Iterator[object]:
    """Values by the schema: the other truth, each word, the examples and ten times each number."""
    if isinstance(default, bool):
        yield not default
        return
    yield from words_of(field.annotation)
    for value in field.examples or ():
        yield value
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield 10 * value
            if default:
                yield type(value)(2 * default)  # type: ignore[operator]


def words_of(annotation: Any) -> Iterator[str]:
    if get_origin(annotation) is Literal:
        yield from (word for word in get_args(annotation) if isinstance(word, str))
    for argument in get_args(annotation):
        yield from words_of(argument)


def worth(profile: busplan.Profile) -> Mapping[str, float]:
    """All that may get worse: times, responses and bounds, the larger the worse."""
    network = network_of(profile)
    cycle = deciding_cycle(network)
    weighed = certainty(cycle)
    found = {
        "required": cycle.required_us,
        "possible": cycle.possible_us(),
        "safe": weighed.safe_required_us + cycle.possible_us(),
        "jitter": cycle.sync_jitter_us(),
    }
    for limit in network.bus.limits:
        least = limit.value(network) + limit.uncertainty(network)
        found[f"limit {limit.key}"] = least - limit.most(network)
    for latency in cycle.latencies():
        # Each part and the total. A wait for the next frame or SYNC0 takes what the parts before it leave.
        found |= {
            f"{latency.label} {key}": us
            for key, us in latency.phases.items()
            if key.endswith("_us") and not key.endswith(("_wait_us", "deadline_us"))
        }
    return found


def worse(profile: busplan.Profile, left_out: Iterable[tuple[str, FieldInfo]]) -> Mapping[str, tuple[object, str]]:
    """Keys left out that make a plan worse, each with a value and what gets worse."""
    network = network_of(profile)
    bus, before, found = network.bus, worth(profile), dict[str, tuple[object, str]]()
    usual = {premise.key: premise.usual for premise in deciding_cycle(network).premises}
    # Settings that a plan turns, and words that select a formula, are the design's choice.
    chosen = {key for setting in bus.settings(network) for key in setting.keys}
    chosen |= {key for key, facts in bus.keys.items() if facts.chooses}
    for key, field in left_out:
        if key in chosen or key.endswith(KNOWLEDGE):
            continue
        default = field.get_default(call_default_factory=True)
        for value in [usual[key]] if usual.get(key) is not None else candidates(field, default):
            try:
                after = worth(busplan.load_profile(profile, changes={key: value}))
            except (BusplanError, ValueError):
                continue
            names = [name for name in before if after.get(name, -inf) > before[name] + 1e-9 * (1 + abs(before[name]))]
            if names:
                found[key] = value, names[0]
                break
    return found


def said(profile: busplan.Profile) -> set[str]:
    """Keys of the premises that the answers name."""
    return {part.key for part in deciding_cycle(network_of(profile)).rests_on()}


@pytest.mark.parametrize(("kind", "variant"), list(starters()))
def test_what_is_not_given_and_makes_a_plan_worse_is_said(kind: str, variant: str) -> None:
    profile = new_profile(kind, variant)
    parts = ((section, getattr(profile, section, None)) for section in SECTIONS)
    left_out = (each for section, part in parts if part is not None for each in not_given(part, section))
    found = worse(profile, left_out)
    assert {key: found[key] for key in found.keys() - said(profile)} == {}


def test_so_is_what_a_message_does_not_give() -> None:
    profile: Any = new_profile("can", "", MESSAGE)
    (message,) = profile.message
    keys = [each for each in not_given(message, "message.door") if each[0].rpartition(".")[2] not in OF_MESSAGE]
    found = worse(profile, keys)
    assert "message.door.jitter_us" in found
    assert {key: found[key] for key in found.keys() - said(profile)} == {}


@pytest.mark.parametrize("kind", ["ieee1394", "can", "polled"])
@pytest.mark.parametrize("period_us", [3000.0, 5000.0, 8000.0, 12_000.0, 20_000.0])
def test_a_verdict_on_a_guess_holds_at_twice_the_guess(kind: str, period_us: float) -> None:
    profile = busplan.load_profile(new_profile(kind, ""), changes={"cycle.period_us": period_us, "limits.reserve": 0.0})
    execution: Any = profile.node_groups[0].node.execution
    names = ("time_us",) if execution.kind == "table" else ("base_us", "per_byte_us")
    values = {f"node.execution.{name}": getattr(execution, name) for name in names}
    twice = {key: [2 * one for one in us] if isinstance(us, tuple) else 2 * us for key, us in values.items()}
    doubled = busplan.load_profile(profile, changes=twice)
    (found, *_), (then, *_) = busplan.capacity(profile).results, busplan.capacity(doubled).results
    assert found.verdict != "fits" or then.fits
