"""What holds of the cycle of every kind of bus, on random profiles of each."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import fields
from math import fsum
from typing import get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import busplan
from busplan.buses import kind_named, kind_names
from busplan.buses.figure import by_key
from busplan.elementwise import Traced
from busplan.profile.kinds import cycle_keys
from busplan.questions.fit.certainty import (
    FITS,
    certainty,
    deciding_cycle,
    is_shown_to_fit,
    limits_to_be_safe,
    limits_with_time,
)
from busplan.questions.fit.figures import cycle_figures, figures, node_counts
from busplan.questions.fit.network import changed, model_names, network_of
from tests.registers import at_least, shipped_names

Profiles = Mapping[str, st.SearchStrategy[busplan.Profile]]
KINDS = pytest.mark.parametrize("kind", kind_names())
SOME = settings(max_examples=at_least(3, 20))  # of each kind
PLACES = st.lists(st.integers(2, 68), min_size=4, max_size=4).map(lambda places: {0, 1, *places})
"""Some of an array, the first two always."""


@KINDS
@SOME
@given(data=st.data())
def test_the_record_of_a_kind_has_the_keys_of_its_figures_and_values_of_its_types(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    for found in busplan.capacity(profile).results:
        types, register = get_type_hints(type(found.own)), found.bus_figures
        keys = {figure.key for figure in (*register.capacity, *register.compared)} - {one.name for one in fields(found)}
        assert set(types) == keys - (set() if profile.has_cycle else {*by_key(register.terms)})
        for key, type_ in types.items():
            assert isinstance(getattr(found.own, key), type_ | int if isinstance(0.0, type_) else type_), key


@KINDS
@SOME
@given(data=st.data())
def test_terms_are_those_that_the_kind_declares_and_events_add_up_to_each(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    network = network_of(data.draw(profiles_by_kind[kind]))
    bus = network.bus
    for model in model_names(network):
        cycle = network.bus.cycle(network, model=model)
        assert [term.key for term in cycle.terms] == [figure.key for figure in bus.figures.terms]
        assert all(term.us >= 0 for term in cycle.terms)
        of_events: dict[str, list[float]] = defaultdict(list)
        for event in cycle.events():
            assert bus.event_kind(event.kind).key == event.kind
            of_events[event.term].append(event.us)
        for term in cycle.terms:
            assert fsum(of_events.pop(term.key, [])) == pytest.approx(term.us, rel=1e-12, abs=1e-12)
        assert not of_events
        waits_us = cycle_figures(network, model=model).waits_us
        assert fsum(waits_us.values()) == pytest.approx(cycle.required_us, rel=1e-12)


@KINDS
def test_every_term_has_an_event(kind: str, profiles_by_kind: Profiles) -> None:
    bus = kind_named(kind)
    written: set[str] = set()

    def look(profile: busplan.Profile) -> None:
        cycle = deciding_cycle(network_of(profile))
        assert {term.rests_on for term in cycle.terms} - {""} <= set(cycle_keys(profile))
        written.update(event.term for event in cycle.events())

    for profile in (busplan.load_profile(name) for name in shipped_names()):
        if profile.bus.kind == kind:
            look(profile)
            for setting in bus.settings(network_of(profile)):
                for changes in setting.values:
                    look(busplan.load_profile(profile, changes=changes))
    settings(max_examples=at_least(10), derandomize=True)(given(profiles_by_kind[kind])(look))()
    assert written == {figure.key for figure in bus.figures.terms}


@pytest.mark.parametrize("kind", ["can", "ieee1394"])
@SOME
@given(data=st.data())
def test_a_command_arrives_when_its_last_event_has_ended(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    network = network_of(data.draw(profiles_by_kind[kind]))
    cycle = deciding_cycle(network)
    ends_us: dict[int | None, float] = {}
    now_us = 0.0
    for event in cycle.events():
        now_us += event.us
        if (event.transaction, event.kind) in cycle.command_events:
            ends_us[event.node] = now_us
    for node in {1, data.draw(st.integers(1, int(cycle.network.nodes))), int(cycle.network.nodes)}:
        assert cycle.arrival_us(node) == pytest.approx(ends_us.get(node, ends_us.get(None)), rel=1e-12)


@KINDS
@SOME
@given(data=st.data())
def test_an_array_of_nodes_gives_what_each_number_gives(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    network = network_of(data.draw(profiles_by_kind[kind]))
    nodes = np.arange(1, 70)
    counts = {place: network.with_nodes(place + 1) for place in data.draw(PLACES)}
    for model in model_names(network):
        together = network.bus.cycle(network.with_nodes(nodes), model=model)
        us_of_each = {term.key: np.broadcast_to(np.asarray(term.us), nodes.shape) for term in together.terms}
        for place, alone in counts.items():
            us_alone = {one.key: one.us for one in network.bus.cycle(alone, model=model).terms}
            assert {key: float(each[place]) for key, each in us_of_each.items()} == us_alone
        for limit in (*limits_with_time(network, model=model), *limits_to_be_safe(network)):
            truths = np.broadcast_to(np.asarray(limit.is_broken(network.with_nodes(nodes))), nodes.shape)
            for place, alone in counts.items():
                assert bool(truths[place]) == bool(limit.is_broken(alone))
            # Once broken, a limit stays broken: the search for the most nodes rests on that.
            assert sorted(truths.tolist()) == truths.tolist()


@KINDS
@SOME
@given(data=st.data())
def test_of_the_most_nodes_no_limit_is_broken_and_one_more_breaks_it(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    network = network_of(data.draw(profiles_by_kind[kind]))
    for model in model_names(network):
        limits = {limit.key: limit for limit in limits_with_time(network, model=model)}
        (count,) = node_counts(network, model=model)
        # Once broken, a limit stays broken: of any number, these two decide.
        most = network.with_nodes(count.max_nodes)
        assert count.max_nodes == 0 or not any(limit.is_broken(most) for limit in limits.values())
        assert limits[count.limited_by].is_broken(network.with_nodes(count.max_nodes + 1))


@KINDS
@SOME
@given(data=st.data())
def test_a_traced_number_has_the_same_value(kind: str, data: st.DataObject, profiles_by_kind: Profiles) -> None:
    network = network_of(data.draw(profiles_by_kind[kind]))
    nodes = data.draw(st.integers(1, 100))
    for model in model_names(network):
        bus = network.bus
        own = bus.cycle(network.with_nodes(nodes), model=model).required_us
        traced = bus.cycle(network.with_nodes(Traced(float(nodes))), model=model).required_us
        assert isinstance(traced, Traced)
        assert traced.value == own


@KINDS
@SOME
@given(data=st.data())
def test_what_a_cycle_needs_rests_on_neither_the_period_nor_the_slice_ratio(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    network = network_of(data.draw(profiles_by_kind[kind]))
    other = changed(network, {"cycle.period_us": 12_345.0, "cycle.slice_ratio": 0.123})
    for model in model_names(network):
        assert network.bus.cycle(network, model=model).terms == network.bus.cycle(other, model=model).terms


@KINDS
@SOME
@given(data=st.data())
def test_the_safe_nodes_are_safe_and_one_more_is_not(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    network = network_of(data.draw(profiles_by_kind[kind]))

    def is_safe(nodes: int) -> bool:
        with_nodes = changed(network, {"bus.nodes": nodes})
        then = figures(with_nodes, model=network.bus.deciding_model)
        assert is_shown_to_fit(with_nodes) == (then.verdict == FITS)
        return then.verdict == FITS and then.safe

    (count,) = node_counts(network, model=network.bus.deciding_model)
    most = count.safe_nodes
    assert most is not None
    assert most == 0 or is_safe(most)
    assert not is_safe(most + 1)
    (broken,) = (limit for limit in limits_to_be_safe(network) if limit.key == count.safe_limited_by)
    assert broken.is_broken(network.with_nodes(most + 1))


@KINDS
@SOME
@given(data=st.data())
def test_the_certainty_of_an_array_is_that_of_each_number(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    network = network_of(data.draw(profiles_by_kind[kind]))
    nodes = np.arange(1, 70)
    together = certainty(deciding_cycle(network.with_nodes(nodes)))
    for index in data.draw(PLACES):
        count = int(nodes[index])
        alone = certainty(deciding_cycle(network.with_nodes(count)))
        for name in ("margin_corrected_us", "uncertainty_us", "safe_required_us"):
            found = np.broadcast_to(getattr(together, name), nodes.shape)[index]
            assert found == pytest.approx(getattr(alone, name), rel=1e-12, abs=1e-9)


def test_every_kind_is_tried(profiles_by_kind: Profiles) -> None:
    assert set(profiles_by_kind) == set(kind_names())
