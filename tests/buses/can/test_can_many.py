"""CAN networks of many messages, and of many points: every command answers, soon."""

import csv
import io
import tomllib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

import busplan
from busplan.buses.can.cycle import WORST, CanCycle
from busplan.buses.can.rules import LIMITS
from busplan.buses.can.section import CanProfile
from busplan.elementwise import pointwise
from busplan.forms.blocks import Chapter, Table
from busplan.profile.edit import profile_text
from busplan.questions.fit.network import network_of
from busplan.sections.base import with_unchecked

Run = Callable[..., Any]
BASE = """\
schema_version = 1
name = "many"
bus = { kind = "can", bit_rate_kbit_s = 1000, nodes = 2, identifier_bits = 29 }
cycle = { period_us = 20000.0 }
payload = { read_bytes = 8, write_bytes = 8 }
node = { axes = 1, execution = { kind = "linear", grade = "assumed", base_us = 100, per_byte_us = 0 } }
"""


def messages(count: int, *, load: float, slow: float, random: Random) -> list[dict[str, Any]]:
    """Some messages that together make a load, a share of them with the longest period."""
    weights = [0.0 if random.random() < slow else random.uniform(0.1, 1) for _ in range(count)]
    found = []
    for number, weight in enumerate(weights):
        period_us = 160 / (load * weight / sum(weights)) if weight else 1e9
        jitter_us = random.choice([0.0, random.uniform(0, period_us)])
        identifier = random.choice([0x10, 0x10000]) + 3 * number
        keys = {"identifier": identifier, "payload_bytes": 8, "period_us": period_us, "jitter_us": jitter_us}
        found.append({"name": f"m{number}", **keys})
    return found


def many(count: int, *, load: float, slow: float = 0.5, seed: int = 1) -> CanProfile:
    sent = messages(count, load=load, slow=slow, random=Random(seed))
    return CanProfile.model_validate({**tomllib.loads(BASE), "message": sent})


@pytest.mark.parametrize("count", [1, 31, 32, 33, 64, 65, 300])
def test_a_search_takes_any_number_of_arguments(count: int) -> None:
    others = range(count - 1)
    found = pointwise(lambda *each: sum(each), np.array([1, 2]), *others, np.array([[10], [20]]), words="")
    assert np.array_equal(np.asarray(found), np.array([[11, 12], [21, 22]]) + sum(others))


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("map", 40),
        ("sweep --vary cycle.period_us=20000,40000 --vary message.m3.jitter_us=0,50", 40),
        ("report --no-circle", 10),
    ],
)
def test_many_messages_are_answered(run: Run, tmp_path: Path, line: str, count: int) -> None:
    (tmp_path / "many.toml").write_text(profile_text(many(count, load=0.4)), encoding="utf-8")
    command, *options = line.split()
    done = run(command, "many.toml", *options, "--format", "json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("load", "slow", "seed"), [(0.995, 0.9, 1), (0.9998, 0.8, 4)])
def test_a_bus_that_is_nearly_full_is_answered(load: float, slow: float, seed: int) -> None:
    profile = many(200, load=load, slow=slow, seed=seed)
    assert busplan.capacity(profile).report().blocks
    found = busplan.latency(profile, timing_model=["worst-stuffing"])
    assert len(found.transactions) == 204


def test_a_response_that_takes_too_many_steps_is_not_computed_and_said() -> None:
    random = Random(3)
    periods_us = [random.uniform(27_000, 54_000) for _ in range(300)]
    scale = sum(135 / us for us in periods_us) / 0.99985
    each = [
        {"name": f"m{number}", "identifier": number, "payload_bytes": 8, "period_us": us}
        for number, us in enumerate([*(us * scale for us in periods_us), 1e9])
    ]
    bus = {"kind": "can", "bit_rate_kbit_s": 1000}
    own = CanProfile.model_validate({"schema_version": 1, "name": "full", "bus": bus, "message": each})
    found = busplan.latency(own, timing_model=[WORST]).transactions
    assert found[-1].phases["worst_response_us"] is None
    assert found[100].phases["worst_response_us"] is not None
    said = [one.finding.message for one in busplan.check(own).findings]
    assert any("its busy period takes over 2000 steps to find" in words for words in said)


def test_groups_have_one_set_of_columns(run: Run, tmp_path: Path) -> None:
    execution = {"kind": "linear", "grade": "measured", "base_us": 50.0, "per_byte_us": 0.0}
    sizes = {"write_bytes": 8, "execution": execution, "nodes": 2, "axes": 1}
    data = tomllib.loads(BASE)
    data = {key: value for key, value in data.items() if key not in ("payload", "node")}
    data["bus"].pop("nodes")
    groups = [{"name": name, "read_bytes": size, **sizes} for name, size in (("left", 8), ("right", 6))]
    profile = CanProfile.model_validate({**data, "group": groups})
    (tmp_path / "two.toml").write_text(profile_text(profile), encoding="utf-8")
    rows = list(csv.DictReader(io.StringIO(run("latency", "two.toml", "--format", "csv", cwd=tmp_path).stdout)))
    assert {row["group"] for row in rows} == {"", "left", "right"}
    assert len({tuple(row) for row in rows}) == 1


@pytest.mark.parametrize("form", ["compiled", "python"])
@pytest.mark.parametrize(
    ("count", "load", "deadline_us"), [(3, 0.2, 4e3), (12, 0.6, 2e4), (60, 0.5, 4e4), (70, 0.8, 1e6)]
)
def test_arrays_of_points_give_what_each_point_gives(
    monkeypatch: pytest.MonkeyPatch, count: int, load: float, deadline_us: float, form: str
) -> None:
    if form == "python":
        monkeypatch.setattr("busplan.buses.can.waiting._compiled", lambda: None)
    sent = messages(count, load=load, slow=0.3, random=Random(count))
    late = [{**one, "jitter_us": 10.0, "deadline_us": deadline_us} for one in sent]
    profile = CanProfile.model_validate({**tomllib.loads(BASE), "message": late})
    periods_us, nodes, write_bytes = (
        np.array([700.0, 2500.0, 6000.0, 20000.0]).reshape(-1, 1, 1),
        np.array([1, 9, 100]).reshape(-1, 1),
        np.array([8, 9]),
    )
    keys = {"cycle.period_us": periods_us, "bus.nodes": nodes, "payload.write_bytes": write_bytes}
    varied = profile
    for key, values in keys.items():
        varied = with_unchecked(varied, key, values.astype(float))
    together = network_of(varied)
    shape = (4, 3, 2)
    cycle = CanCycle(together, WORST)
    found: dict[str, Any] = {one.key: one.is_broken(together) for one in LIMITS}
    found |= {"required": cycle.required_us, "longer": cycle.added_us(37.0)}
    told = {key: np.broadcast_to(each, shape) for key, each in found.items()}
    for place in np.ndindex(shape):
        at = dict(zip(keys, (periods_us[place[0], 0, 0], nodes[place[1], 0], write_bytes[place[2]]), strict=True))
        alone = network_of(busplan.load_profile(profile, changes={key: value.item() for key, value in at.items()}))
        own = CanCycle(alone, WORST)
        expected = {one.key: one.is_broken(alone) for one in LIMITS}
        expected |= {"required": own.required_us, "longer": own.added_us(37.0)}
        assert {key: each[place] for key, each in told.items()} == expected, at
    assert 0 < np.mean(told["deadline"]) < 1


def test_a_long_list_of_inputs_stands_once() -> None:
    chapters = busplan.explain(many(40, load=0.5), "worst_response_us").report().blocks
    sections = [chapter.blocks for chapter in chapters if isinstance(chapter, Chapter)]
    tables = [block for blocks in sections for block in blocks if isinstance(block, Table)]
    shown = [len(table.rows) for table in tables]
    assert len(chapters) > 40
    assert max(shown) > 100
    assert shown.count(max(shown)) < 3  # the messages', and that of the loop


def test_a_thousand_messages_are_answered(run: Run, tmp_path: Path) -> None:
    (tmp_path / "many.toml").write_text(profile_text(many(1000, load=0.2, slow=0)), encoding="utf-8")
    for command in ("capacity", "check", "latency"):
        assert run(command, "many.toml", cwd=tmp_path).returncode in (0, 1)


def test_a_long_file_with_a_wrong_key_says_so_soon(run: Run, tmp_path: Path) -> None:
    text = profile_text(many(10_000, load=0.2, slow=0)).replace("payload_bytes = 8\nperiod", "payload = 8\nperiod")
    (tmp_path / "many.toml").write_text(text, encoding="utf-8")
    assert "more problems of this file are not listed" in run("check", "many.toml", cwd=tmp_path).stdout
