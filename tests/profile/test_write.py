"""What is written reads to the same profile; what a profile leaves out stays left out."""

import tomllib

from busplan.profile.document import decode, override, validate
from busplan.profile.edit import profile_text
from busplan.profile.sources import load, shipped_names
from busplan.sections.profile import Profile


def read(text: str) -> Profile:
    return validate(decode(text.encode(), name="new"))


def test_a_written_profile_reads_to_the_same() -> None:
    for name in shipped_names():
        profile = load(name).profile
        nodes_key = profile.node_groups[0].nodes_key
        key, value = {
            "ieee1394": ("bus.gap_count", "optimal"),
            "can": ("bus.sync_counter", True),
            "ethercat": ("bus.process_data", "LRD-LWR"),
            "sercos3": ("bus.version", "V1.0"),
            "sercos2": ("bus.data_rate_mbit_s", 4),
        }[profile.bus.kind]
        changed = override(profile, {nodes_key: 7, key: value, "cycle.period_us": 812.5})
        for one in (profile, changed):
            again = read(profile_text(one))
            assert again == one
            assert again.model_fields_set == one.model_fields_set
        assert tomllib.loads(profile_text(profile)) == load(name).document.data()


def test_text_of_every_kind_survives() -> None:
    profile = override(
        load("paper-4ms").profile,
        {
            "name": 'a "name" \\ with = # [signs] and \u00fc',
            "description": 'two\nlines, a\ttab, """quotes""" and \\ at the end \\',
            "servo.x": {"position_gain_per_s": 1e-7},
            "bus.max_hops": None,
        },
    )
    assert read(profile_text(profile)) == profile


def test_an_override_adds_no_section() -> None:
    profile = load("paper-two-node").profile
    assert not profile.asks_for_circle
    assert not override(profile, {"bus.nodes": 3}).asks_for_circle
    asked = override(profile, {"delivery.seed": 3})
    assert asked.asks_for_circle
    assert asked.delivery.seed == 3
    assert asked.delivery.model_fields_set == {"seed"}
