"""One colour for one kind of traffic: in the bar of the terms, in that of the whole cycle and event by event."""

from collections import defaultdict

import pytest

import busplan
from busplan.buses import kind_named, kind_names
from tests.registers import shipped_names

TO_NODES, FROM_NODES = {"request", "out"}, {"response", "in"}
SAME = {
    "can": {"feedback": "cycle_feedback_us", "command": "cycle_command_us"},
    "sercos2": {"at_stretch": "cycle_at_us", "mdt_stretch": "cycle_mdt_us"},
    "sercos3": {"at": "cycle_at_us", "mdt": "cycle_mdt_us"},
}
"""Terms that are a stretch of the cycle, by its key."""


@pytest.mark.parametrize("name", kind_names())
def test_a_term_has_the_colour_of_its_events(name: str) -> None:
    bus = kind_named(name)
    kinds = defaultdict(set)
    for profile in shipped_names():
        if busplan.load_profile(profile).bus.kind == name:
            for event in busplan.timeline(profile).cycle_events:
                kinds[event.term].add(bus.event_kind(event.kind))
    for term in bus.figures.terms:
        assert not kinds[term.key] or term.ink in {kind.ink for kind in kinds[term.key]}, term.key
    terms = {term.key: term.ink for term in bus.figures.terms}
    stretches = {stretch.key: stretch.ink for stretch in bus.stretch_kinds}
    for stretch, term_key in SAME.get(name, {}).items():
        assert stretches[stretch] == terms[term_key], stretch
    for kind in bus.event_kinds:
        assert kind.ink in {">": TO_NODES, "<": FROM_NODES}.get(kind.mark, {kind.ink}), kind.key
