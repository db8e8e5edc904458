"""Grades that comments of a file give its keys."""

import pytest

from busplan.profile.document import Document
from busplan.profile.shipped import load
from busplan.profile.toml import comment_grade, override, validate
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


def test_a_key_that_was_changed_has_left_its_comment() -> None:
    profile = override(validate(Document("press.toml", TEXT)), {"bus.master_us": 20.0})
    assert comment_grade(profile, "bus.master_us") is None
    assert comment_grade(profile, "bus.master_jitter_us") == "measured"
    assert comment_grade(override(profile, {"cycle.slice_ratio": 0.5}), "bus.master_us") is None


def test_comments_are_no_part_of_a_profile() -> None:
    without = "\n".join(line.partition("#")[0] for line in TEXT.split("\n"))
    assert validate(Document("press.toml", TEXT)) == validate(Document("press.toml", without))


def test_no_key_of_a_shipped_profile_that_is_called_assumed_is_given() -> None:
    profile = load("ethercat-servo-8").profile
    assert {
        given(profile, key).grade for key in ("bus.nodes", "bus.master_us", "payload.read_bytes", "node.cable_m")
    } == {"assumed"}
