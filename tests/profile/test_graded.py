"""Grades that comments of a file give its keys."""

from pathlib import Path

import pytest

import busplan
from busplan import Profile
from busplan.profile.edit import profile_text

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


def read(text: str, folder: Path) -> Profile:
    path = folder / "press.toml"
    path.write_text(text, encoding="utf-8")
    return busplan.load_profile(path)


@pytest.fixture
def press(tmp_path: Path) -> Profile:
    return read(TEXT, tmp_path)


def grades(profile: Profile | str) -> dict[str, str]:
    """The grade of each key, as derivations tell it."""
    answers = (busplan.explain(profile, figure) for figure in ("margin_us", "end_to_end_us"))
    return {given.name: given.grade for answer in answers for one in answer.derivations for given in one.inputs}


def test_a_comment_grades_its_key_and_that_of_a_table_its_keys(press: Profile) -> None:
    expected = {
        "bus.master_us": "assumed",
        "bus.master_jitter_us": "measured",
        "bus.mailbox_polls": "given",
        "cycle.period_us": "published",
        "cycle.slice_ratio": "given",  # a default is nobody's comment
        "group.drives.read_bytes": "derived",
        "group.drives.write_bytes": "given",
        "group.drives.execution.base_us": "assumed",
    }
    found = grades(press)
    assert {key: found[key] for key in expected} == expected


def test_a_key_that_was_changed_is_no_longer_measured_and_is_assumed_if_it_was(press: Profile) -> None:
    before = grades(press)
    changed = busplan.load_profile(press, changes={"bus.master_us": 20.0, "cycle.period_us": 250})
    assert grades(changed) == {**before, "cycle.period_us": "given"}
    again = busplan.load_profile(changed, changes={"bus.master_jitter_us": 6})
    assert grades(again) == {**before, "cycle.period_us": "given", "bus.master_jitter_us": "given"}


def test_a_profile_that_is_written_has_the_grades_of_its_comments(press: Profile, tmp_path: Path) -> None:
    profile = busplan.load_profile(press, changes={"bus.master_us": 20.0, "cycle.period_us": 250})
    again = read(profile_text(profile), tmp_path)
    assert again == profile
    assert grades(again) == grades(profile)
    # So a check of a profile in memory warns of what is assumed, as that of its file does.
    servo = busplan.load_profile("ethercat-servo-8")
    assert [one.finding.code for one in busplan.check(servo, circle=False).findings] == ["BP112"]


def test_comments_are_no_part_of_a_profile(press: Profile, tmp_path: Path) -> None:
    assert read("\n".join(line.partition("#")[0] for line in TEXT.split("\n")), tmp_path) == press


def test_no_key_of_a_shipped_profile_that_is_called_assumed_is_given() -> None:
    found = grades("ethercat-servo-8")
    assert {found[key] for key in ("bus.nodes", "bus.master_us", "payload.read_bytes", "node.cable_length_m")} == {
        "assumed"
    }
