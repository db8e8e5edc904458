"""One colour for one kind of traffic: in the bar of the terms, in that of the whole cycle and event by event."""

from collections import defaultdict
from colorsys import rgb_to_hls

import pytest

import busplan
from busplan.buses import kind_named, kind_names
from busplan.forms.inks import INKS
from busplan.profile.sources import shipped_names

TO_NODES, FROM_NODES = {"request", "out"}, {"response", "in"}


def hue(colour: str) -> float:
    return 360 * rgb_to_hls(*(int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)))[0]


@pytest.mark.parametrize("inks", [TO_NODES, FROM_NODES])
def test_traffic_of_one_direction_has_one_hue(inks: set[str]) -> None:
    for hues in zip(
        *([hue(colour) for colour in colours] for ink, colours in INKS.items() if ink in inks), strict=True
    ):
        assert max(hues) - min(hues) < 15


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
