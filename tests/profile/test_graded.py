"""Grades that comments of a file give its keys."""

import pytest

import busplan
from busplan.profile.document import Document, comment_grade, override, validate
from busplan.profile.edit import profile_text
from busplan.profile.kinds import dotted_keys
from busplan.profile.sources import load
from busplan.questions.fit.inputs import given

TEXT = """\
schema_version = 1
name = "press"
[bus]
kind = "ethercat"
master_us = 30 # assumed: as on the last machine
master_jitter_us = 5 #measured on this one
mailbox_polls = 1 # one, assumed or not
[cycle] # assumed: the machine is not designed yet
period_us = 500 # published: what its drives like
[[group]]
name = "drives"
nodes = 4
axes = 1
read_bytes = 8 # derived: from their objects
write_bytes = 8
[group.execution] # assumed
kind = "linear"
base_us = 20
per_byte_us = 0
"""


@pytest.mark.parametrize(
    ("key", "grade"),
    [
        ("bus.master_us", "assumed"),
        ("bus.master_jitter_us", "measured"),
        ("bus.mailbox_polls", "given"),
        ("cycle.period_us", "published"),
        ("cycle.slice_ratio", "given"),  # a default is nobody's comment
        ("group.drives.read_bytes", "derived"),
        ("group.drives.write_bytes", "given"),
        ("group.drives.execution.base_us", "assumed"),
    ],
)
def test_a_comment_grades_its_key_and_that_of_a_table_its_keys(key: str, grade: str) -> None:
    assert given(validate(Document("press.toml", TEXT)), key).grade == grade


def test_a_key_that_was_changed_is_no_longer_measured_and_is_assumed_if_it_was() -> None:
    profile = override(validate(Document("press.toml", TEXT)), {"bus.master_us": 20.0, "cycle.period_us": 250})
    assert comment_grade(profile, "bus.master_us") == "assumed"
    assert comment_grade(profile, "cycle.period_us") is None
    assert comment_grade(profile, "bus.master_jitter_us") == "measured"
    assert comment_grade(override(profile, {"bus.master_jitter_us": 6}), "cycle.period_us") is None
    assert comment_grade(override(profile, {"bus.master_jitter_us": 6}), "bus.master_jitter_us") is None


def test_a_profile_that_is_written_has_the_grades_of_its_comments() -> None:
    profile = override(validate(Document("press.toml", TEXT)), {"bus.master_us": 20.0, "cycle.period_us": 250})
    again = validate(Document("again.toml", profile_text(profile)))
    assert again == profile
    keys = [*dotted_keys(profile)]
    assert [comment_grade(again, key) for key in keys] == [comment_grade(profile, key) for key in keys]
    # So a check of a profile in memory warns of what is assumed, as that of its file does.
    press = busplan.load_profile("ethercat-servo-8")
    assert [one.finding.code for one in busplan.check(press, circle=False).findings] == ["BP112"]


def test_comments_are_no_part_of_a_profile() -> None:
    without = "\n".join(line.partition("#")[0] for line in TEXT.split("\n"))
    assert validate(Document("press.toml", TEXT)) == validate(Document("press.toml", without))


def test_no_key_of_a_shipped_profile_that_is_called_assumed_is_given() -> None:
    profile = load("ethercat-servo-8").profile
    assert {
        given(profile, key).grade for key in ("bus.nodes", "bus.master_us", "payload.read_bytes", "node.cable_m")
    } == {"assumed"}
