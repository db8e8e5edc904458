"""What is written reads to the same profile; what a profile leaves out stays left out."""

import tomllib
from math import inf, nan
from pathlib import Path

import pytest

import busplan
from busplan import Profile
from busplan.profile.edit import edited_copy, profile_text, short_text, value_text
from busplan.profile.sources import load
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
    # Lines of a text are lines of the file.
    assert '\ndescription = """\ntwo\nlines, a' in profile_text(profile)


def test_an_override_adds_no_section() -> None:
    profile = busplan.load_profile("paper-two-node")
    assert not profile.asks_for_circle
    assert not busplan.load_profile(profile, changes={"bus.nodes": 3}).asks_for_circle
    asked = busplan.load_profile(profile, changes={"delivery.seed": 3})
    assert asked.asks_for_circle
    assert value_at(asked, "delivery.seed") == 3
    assert asked.delivery.model_fields_set == {"seed"}


@pytest.mark.parametrize(
    "value",
    [
        True,
        False,
        0,
        -7,
        1e9,
        0.1,
        1e-7,
        "",
        'a "b" \\ c',
        "\x7f\u200b\t\n\u00fc",
        [1, 2.5, "x"],
        (),
        {"a": {"b": [True]}, "c": 0},
    ],
    ids=repr,
)
def test_a_value_reads_to_itself(value: object) -> None:
    text = value_text(value)
    read_back = tomllib.loads(f"x = {text}")["x"]
    assert read_back == (list(value) if isinstance(value, tuple) else value)
    assert type(read_back) is (list if isinstance(value, tuple) else type(value))
    assert text.isprintable()


def test_what_toml_does_not_have_is_refused() -> None:
    for number in (inf, -inf, nan):
        with pytest.raises(ValueError, match="is not finite"):
            value_text(number)
    for value in (None, {1}, object()):
        with pytest.raises(TypeError, match=r"is no value of a profile$"):
            value_text({"a": [value]})
    assert [*map(short_text, (1200.0, 0.5, 3, True, "x"))] == ["1200", "0.5", "3", "true", '"x"']


def test_a_copy_keeps_the_layout_where_it_takes_the_changes_and_the_grades_anyway(tmp_path: Path) -> None:
    path, text = (
        tmp_path / "line.toml",
        """\
# A comment.
schema_version = 1
name = "line"
bus = {kind = "ieee1394", speed = "S400", nodes = 2}
[cycle]
period_us = 4000   # measured: with a scope
[payload]
read_bytes = 12
write_bytes = 12
[node]
axes = 4
execution = {kind = "linear", base_us = 30, per_byte_us = 0.35}
""",
    )
    path.write_text(text)
    loaded = load(str(path))
    copy = edited_copy(loaded, {"payload.read_bytes": 20}).decode()
    assert copy == text.replace("read_bytes = 12", "read_bytes = 20")
    # An inline table takes no new key: the comments go, and the grade of the period stays.
    other = edited_copy(loaded, {"bus.max_hops": 5}).decode()
    assert "# A comment." not in other
    assert "period_us = 4000.0  # measured\n" in other
    assert read(other, tmp_path) == busplan.load_profile(loaded.profile, changes={"bus.max_hops": 5})
