"""What is written reads to the same profile; what a profile leaves out stays left out."""

import tomllib
from pathlib import Path

import busplan
from busplan import Profile
from busplan.profile.edit import profile_text
from busplan.sections.base import value_at

SHIPPED = sorted((Path(__file__).parents[2] / "profiles").glob("*.toml"))


def read(text: str, folder: Path) -> Profile:
    path = folder / "new.toml"
    path.write_text(text, encoding="utf-8")
    return busplan.load_profile(path)


def test_a_written_profile_reads_to_the_same(tmp_path: Path) -> None:
    for path in SHIPPED:
        profile = busplan.load_profile(path)
        nodes_key = f"group.{profile.group[0].name}.nodes" if profile.group else "bus.nodes"
        key, value = {
            "ieee1394": ("bus.gap_count", "optimal"),
            "can": ("bus.identifier_bits", 29),
            "ethercat": ("bus.process_data", "LRD-LWR"),
            "sercos3": ("bus.version", "V1.0"),
            "sercos2": ("bus.data_rate_mbit_s", 4),
            "polled": ("bus.adapter", "ftdi"),
        }[profile.bus.kind]
        changed = busplan.load_profile(profile, changes={nodes_key: 7, key: value, "cycle.period_us": 812.5})
        for one in (profile, changed):
            again = read(profile_text(one), tmp_path)
            assert again == one
            assert again.model_fields_set == one.model_fields_set
        assert tomllib.loads(profile_text(profile)) == tomllib.loads(path.read_text(encoding="utf-8"))


def test_text_of_every_kind_survives(tmp_path: Path) -> None:
    profile = busplan.load_profile(
        "paper-4ms",
        changes={
            "name": 'a "name" \\ with = # [signs] and \u00fc',
            "description": 'two\nlines, a\ttab, """quotes""" and \\ at the end \\',
            "servo.x": {"position_gain_per_s": 1e-7},
            "bus.max_hops": None,
        },
    )
    assert read(profile_text(profile), tmp_path) == profile


def test_an_override_adds_no_section() -> None:
    profile = busplan.load_profile("paper-two-node")
    assert not profile.asks_for_circle
    assert not busplan.load_profile(profile, changes={"bus.nodes": 3}).asks_for_circle
    asked = busplan.load_profile(profile, changes={"delivery.seed": 3})
    assert asked.asks_for_circle
    assert value_at(asked, "delivery.seed") == 3
    assert asked.delivery.model_fields_set == {"seed"}
