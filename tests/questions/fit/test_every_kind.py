"""What holds of the cycle of every kind of bus, on random profiles of each."""

from collections import defaultdict
from collections.abc import Mapping
from math import fsum

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from busplan.buses import kind_named, kind_names
from busplan.elementwise import Traced, plain
from busplan.profile.kinds import cycle_keys
from busplan.profile.shipped import load, shipped_names
from busplan.profile.toml import override
from busplan.questions.fit.certainty import FITS, certainty, cycle_of, limits_to_be_safe, limits_with_time
from busplan.questions.fit.figures import figures
from busplan.questions.fit.network import bus_of, model_names, network_of
from busplan.questions.fit.node_limit import most_nodes, safe_nodes
from busplan.sections.profile import Profile

Profiles = Mapping[str, st.SearchStrategy[Profile]]
KINDS = pytest.mark.parametrize("kind", kind_names())
SOME = settings(max_examples=10)  # of each kind
PLACES = st.lists(st.integers(2, 68), min_size=4, max_size=4).map(lambda places: {0, 1, *places})
"""Some of an array, the first two always."""


@KINDS
@SOME
@given(data=st.data())
def test_terms_are_those_that_the_kind_declares_and_events_add_up_to_each(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    bus = bus_of(profile)
    for model in model_names(profile):
        cycle = cycle_of(profile, model=model)
        assert [term.key for term in cycle.terms] == [figure.key for figure in bus.figures.terms]
        assert all(term.us >= 0 for term in cycle.terms)
        of_events: dict[str, list[float]] = defaultdict(list)
        for event in cycle.events():
            assert bus.event_kind(event.kind).key == event.kind
            of_events[event.term].append(plain(event.us))
        for term in cycle.terms:
            assert fsum(of_events.pop(term.key, [])) == pytest.approx(term.us, rel=1e-12, abs=1e-12)
        assert not of_events


@KINDS
def test_every_term_has_an_event(kind: str, profiles_by_kind: Profiles) -> None:
    bus = kind_named(kind)
    written: set[str] = set()

    def look(profile: Profile) -> None:
        cycle = cycle_of(profile, model=bus.deciding_model)
        assert {term.rests_on for term in cycle.terms} - {""} <= set(cycle_keys(profile))
        written.update(event.term for event in cycle.events())

    for profile in (load(name).profile for name in shipped_names()):
        if profile.bus.kind == kind:
            look(profile)
            for setting in bus.settings(network_of(profile)):
                for changes in setting.values:
                    look(override(profile, dict(changes)))
    settings(max_examples=25, derandomize=True)(given(profiles_by_kind[kind])(look))()
    assert written == {figure.key for figure in bus.figures.terms}


@pytest.mark.parametrize("kind", ["can", "ieee1394"])
@SOME
@given(data=st.data())
def test_a_command_arrives_when_its_last_event_has_ended(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    cycle = cycle_of(profile, model=bus_of(profile).deciding_model)
    ends_us: dict[int | None, float] = {}
    now_us = 0.0
    for event in cycle.events():
        now_us += plain(event.us)
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
    profile = data.draw(profiles_by_kind[kind])
    network, nodes = network_of(profile), np.arange(1, 70)
    counts = {place: network.with_nodes(place + 1) for place in data.draw(PLACES)}
    for model in model_names(profile):
        together = bus_of(profile).cycle(network.with_nodes(nodes), model=model)
        us_of_each = {term.key: np.broadcast_to(np.asarray(term.us), nodes.shape) for term in together.terms}
        for place, alone in counts.items():
            us_alone = {one.key: one.us for one in bus_of(profile).cycle(alone, model=model).terms}
            assert {key: float(each[place]) for key, each in us_of_each.items()} == us_alone
        for limit in (*limits_with_time(network, model=model), *limits_to_be_safe(network)):
            truths = np.broadcast_to(np.asarray(limit.is_broken(network.with_nodes(nodes))), nodes.shape)
            for place, alone in counts.items():
                assert bool(truths[place]) == bool(limit.is_broken(alone))
            # Once broken, a limit stays broken: the search by halves rests on that.
            assert sorted(truths.tolist()) == truths.tolist()


@KINDS
@SOME
@given(data=st.data())
def test_of_the_most_nodes_no_limit_is_broken_and_one_more_breaks_it(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    network = network_of(profile)
    for model in model_names(profile):
        limits = limits_with_time(network, model=model)
        found = most_nodes(network, limits)
        count = int(found.nodes)
        # Once broken, a limit stays broken: of any number, these two decide.
        assert count == 0 or not any(one.is_broken(network.with_nodes(count)) for one in limits)
        assert limits[int(found.limit)].is_broken(network.with_nodes(count + 1))


@KINDS
@SOME
@given(data=st.data())
def test_a_traced_number_has_the_same_value(kind: str, data: st.DataObject, profiles_by_kind: Profiles) -> None:
    profile = data.draw(profiles_by_kind[kind])
    network = network_of(profile)
    nodes = data.draw(st.integers(1, 100))
    for model in model_names(profile):
        bus = bus_of(profile)
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
    profile = data.draw(profiles_by_kind[kind])
    other = override(profile, {"cycle.period_us": 12_345.0, "cycle.slice_ratio": 0.123})
    for model in model_names(profile):
        assert cycle_of(profile, model=model).terms == cycle_of(other, model=model).terms


@KINDS
@SOME
@given(data=st.data())
def test_the_safe_nodes_are_safe_and_one_more_is_not(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    bus = bus_of(profile)

    def is_safe(nodes: int) -> bool:
        with_them = override(profile, {"bus.nodes": nodes})
        one = figures(with_them, model=bus.deciding_model)
        return one.verdict == FITS and one.safe

    count, limit = safe_nodes(profile)
    assert count == 0 or is_safe(count)
    assert not is_safe(count + 1)
    (broken,) = (one for one in limits_to_be_safe(network_of(profile)) if one.key == limit)
    assert broken.is_broken(network_of(profile).with_nodes(count + 1))


@KINDS
@SOME
@given(data=st.data())
def test_the_certainty_of_an_array_is_that_of_each_number(
    kind: str, data: st.DataObject, profiles_by_kind: Profiles
) -> None:
    profile = data.draw(profiles_by_kind[kind])
    network, nodes, bus = network_of(profile), np.arange(1, 70), bus_of(profile)
    together = certainty(bus.cycle(network.with_nodes(nodes), model=bus.deciding_model))
    for index in data.draw(PLACES):
        count = int(nodes[index])
        alone = certainty(cycle_of(profile, model=bus.deciding_model, nodes=count))
        for name in ("margin_corrected_us", "uncertainty_us", "safe_required_us"):
            found = np.broadcast_to(getattr(together, name), nodes.shape)[index]
            assert found == pytest.approx(getattr(alone, name), rel=1e-12, abs=1e-9)


def test_every_kind_is_tried(profiles_by_kind: Profiles) -> None:
    assert set(profiles_by_kind) == set(kind_names())
