"""One colour for one kind of traffic: in the bar of the terms, in that of the whole cycle and event by event."""

from collections import defaultdict

import pytest

import busplan
from busplan.buses import kind_named, kind_names
from tests.registers import shipped_names

TO_NODES, FROM_NODES = {"request", "out"}, {"response", "in"}


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
    inks = {term.label: term.ink for term in bus.figures.terms}
    for stretch in bus.stretch_kinds:
        assert stretch.ink == inks.get(stretch.label, stretch.ink), stretch.key
    for kind in bus.event_kinds:
        assert kind.ink in {">": TO_NODES, "<": FROM_NODES}.get(kind.mark, {kind.ink}), kind.key
